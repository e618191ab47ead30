//! What a plan says about Slurm.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How runs are submitted to Slurm and watched there. Every field has a default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlurmSettings {
    /// Partition (`--partition`); the cluster's default where none is given.
    pub partition: Option<String>,
    /// Account (`--account`); the user's default where none is given.
    pub account: Option<String>,
    /// Time limit of one array element \[min\] (`--time`), whole minutes as Slurm counts. Where none is given: the time
    /// limit of a run times `chunk`, half a minute for each, and a minute.
    pub time_min: Option<u32>,
    /// Memory of one array element \[MB\] (`--mem`); the cluster's default where none is given.
    pub memory_mb: Option<u64>,
    /// Processors of one array element (`--cpus-per-task`).
    pub cpus: Option<u32>,
    /// Further options of sbatch, each beginning with `-`: `--qos=low`, `--constraint=avx2`.
    pub extra: Vec<String>,
    /// Shell commands before the runs of each array element: `module load lammps`.
    pub setup: Vec<String>,
    /// How many array elements may run at the same time (the `%K` of an array); as many as Slurm allows where none is given.
    pub max_parallel: Option<u32>,
    /// Runs in one array element, one after the other: many for short runs, which Slurm would take longer to start than
    /// to run.
    pub chunk: u32,
    /// How soon squeue is asked again at first \[s\]; the wait grows by half each time.
    pub poll_min_s: f64,
    /// The longest wait between two calls of squeue \[s\].
    pub poll_max_s: f64,
    /// How long a run may be gone from the queue until its result must be seen \[s\]: network file systems show files late.
    pub grace_s: f64,
    /// The longest wait for an answer of sbatch, squeue, scancel, scontrol or sacct \[s\].
    pub command_timeout_s: f64,
}

impl Default for SlurmSettings {
    fn default() -> Self {
        Self {
            partition: None,
            account: None,
            time_min: None,
            memory_mb: None,
            cpus: None,
            extra: Vec::new(),
            setup: Vec::new(),
            max_parallel: None,
            chunk: 1,
            poll_min_s: 1.0,
            poll_max_s: 30.0,
            grace_s: 60.0,
            command_timeout_s: 30.0,
        }
    }
}

/// A setting that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("slurm.{field}: {problem}")]
pub struct SlurmSettingError {
    /// The field.
    pub field: &'static str,
    /// What is wrong, with the value and the remedy.
    pub problem: String,
}

/// Options of sbatch that the executor sets itself, or that would make it lose sight of its jobs.
const RESERVED: [(&str, &str); 14] = [
    ("--array", "-a"),
    ("--job-name", "-J"),
    ("--output", "-o"),
    ("--error", "-e"),
    ("--input", "-i"),
    ("--chdir", "-D"),
    ("--parsable", "--parsable"),
    ("--wrap", "--wrap"),
    ("--wait", "-W"),
    ("--test-only", "--test-only"),
    ("--clusters", "-M"),
    ("--cluster", "--cluster"),
    ("--help", "-h"),
    ("--version", "-V"),
];

impl SlurmSettings {
    /// Checks the settings.
    ///
    /// # Errors
    ///
    /// [`SlurmSettingError`] with the first mistake.
    pub fn check(&self) -> Result<(), SlurmSettingError> {
        let wrong = |field, problem| Err(SlurmSettingError { field, problem });
        for (field, text) in [("partition", &self.partition), ("account", &self.account)] {
            if let Some(text) = text
                && (text.is_empty() || text.contains(|c: char| c.is_whitespace() || c.is_control()))
            {
                return wrong(field, format!("{text:?} is not a name"));
            }
        }
        let counts = [
            ("time_min", self.time_min),
            ("cpus", self.cpus),
            ("max_parallel", self.max_parallel),
            ("chunk", Some(self.chunk)),
        ];
        for (field, count) in counts {
            if count == Some(0) {
                return wrong(field, "0 is too few; give at least 1".into());
            }
        }
        if self.memory_mb == Some(0) {
            return wrong(
                "memory_mb",
                "0 would be all the memory of a node; give megabytes".into(),
            );
        }
        for option in &self.extra {
            let name = option.split(['=', ' ']).next().unwrap_or_default();
            if !name.starts_with('-') || option.contains(char::is_control) {
                return wrong("extra", format!("{option:?} is no option; write --NAME=VALUE"));
            }
            let short = |short: &str| short.len() == 2 && name.starts_with(short);
            // Slurm's commands take any beginning of a long option that is not ambiguous.
            let long = |long: &str| long == name || (name.len() > 5 && long.starts_with(name));
            let taken =
                RESERVED.iter().any(|(l, s)| long(l) || (!name.starts_with("--") && short(s)));
            if taken {
                return wrong("extra", format!("{option:?} is set by this program; leave it out"));
            }
        }
        for line in &self.setup {
            if line.contains(['\0', '\n', '\r']) {
                return wrong(
                    "setup",
                    format!("{line:?} is more than one line; give a list of lines"),
                );
            }
        }
        for (field, seconds, least) in [
            ("poll_min_s", self.poll_min_s, 0.01),
            ("poll_max_s", self.poll_max_s, self.poll_min_s),
            ("grace_s", self.grace_s, 0.0),
            ("command_timeout_s", self.command_timeout_s, 0.1),
        ] {
            // Up to a day; also refuses what is no number.
            if !(least..=86_400.0).contains(&seconds) {
                return wrong(field, format!("{seconds} s; give {least} s to 86400 s"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field_of(settings: &SlurmSettings) -> Option<&'static str> {
        settings.check().err().map(|error| error.field)
    }

    #[test]
    fn defaults_are_right_and_every_mistake_is_named() {
        let good = SlurmSettings::default();
        assert_eq!(field_of(&good), None);
        let of = |change: fn(&mut SlurmSettings)| {
            let mut settings = SlurmSettings::default();
            change(&mut settings);
            field_of(&settings)
        };
        assert_eq!(of(|s| s.partition = Some("a b".into())), Some("partition"));
        assert_eq!(of(|s| s.account = Some(String::new())), Some("account"));
        assert_eq!(of(|s| s.chunk = 0), Some("chunk"));
        assert_eq!(of(|s| s.max_parallel = Some(0)), Some("max_parallel"));
        assert_eq!(of(|s| s.time_min = Some(0)), Some("time_min"));
        assert_eq!(of(|s| s.memory_mb = Some(0)), Some("memory_mb"));
        assert_eq!(of(|s| s.setup = vec!["a\nb".into()]), Some("setup"));
        assert_eq!(of(|s| s.poll_min_s = f64::NAN), Some("poll_min_s"));
        assert_eq!(of(|s| s.poll_max_s = 0.5), Some("poll_max_s"), "below poll_min_s");
        assert_eq!(of(|s| s.grace_s = -1.0), Some("grace_s"));
        assert_eq!(of(|s| s.command_timeout_s = 0.0), Some("command_timeout_s"));
    }

    #[test]
    fn options_that_are_set_already_are_refused_in_every_spelling() {
        let check = |option: &str| {
            field_of(&SlurmSettings { extra: vec![option.into()], ..SlurmSettings::default() })
        };
        for good in
            ["--qos=low", "--constraint=avx2&ib", "-pshort", "--exclusive", "--mail-type=END"]
        {
            assert_eq!(check(good), None, "{good}");
        }
        for bad in [
            "qos=low",
            "",
            "--array=0-3",
            "-a0-3",
            "--job-name=x",
            "--wait",
            "--clusters=c",
            "--outp=x",
            "-J x",
        ] {
            assert_eq!(check(bad), Some("extra"), "{bad}");
        }
    }

    #[test]
    fn unknown_fields_are_refused_and_missing_ones_have_defaults() {
        let settings: SlurmSettings = serde_json::from_str(r#"{"chunk": 5}"#).expect("settings");
        assert_eq!(settings, SlurmSettings { chunk: 5, ..SlurmSettings::default() });
        assert!(serde_json::from_str::<SlurmSettings>(r#"{"chunks": 5}"#).is_err());
    }
}
