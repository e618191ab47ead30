//! The settings of Slurm.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How runs are submitted to Slurm and watched there: the cluster's defaults where an option is not given.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlurmSettings {
    /// Partition (`--partition`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partition: Option<String>,
    /// Account (`--account`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub account: Option<String>,
    /// Time limit of one array element \[min\] (`--time`), 1 to 525 600. Default: the time limit of a run times `chunk`,
    /// half a minute for each run, and a minute.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_min: Option<u32>,
    /// Memory of one array element \[MB\] (`--mem`), at least 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_mb: Option<u64>,
    /// Processors of one array element (`--cpus-per-task`), 1 to 65 536.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpus: Option<u32>,
    /// Further options of sbatch in their long form: `--qos=low`, `--constraint=avx2`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extra: Vec<String>,
    /// Shell commands before the runs of each array element: `module load lammps`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Most array elements that run at the same time (the `%K` of an array). Default: as many as Slurm allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_parallel: Option<u32>,
    /// Number of runs in one array element, one after the other; default 1. Many are faster where Slurm would take longer
    /// to start a run than the run itself takes.
    #[serde(skip_serializing_if = "is_default_chunk")]
    pub chunk: u32,
    /// First wait between two calls of squeue \[s\], at least 0.01, default 1; it grows by half each time.
    #[serde(skip_serializing_if = "is_default_poll_min")]
    pub poll_min_s: f64,
    /// Longest wait between two calls of squeue \[s\], at least `poll_min_s`, default 30.
    #[serde(skip_serializing_if = "is_default_poll_max")]
    pub poll_max_s: f64,
    /// Time after which a run without a result is lost, once it is gone from the queue \[s\], default 60: network file
    /// systems show files late.
    #[serde(skip_serializing_if = "is_default_grace")]
    pub grace_s: f64,
    /// Longest wait for an answer of sbatch, squeue, scancel, scontrol or sacct \[s\], at least 0.1, default 30.
    #[serde(skip_serializing_if = "is_default_command_timeout")]
    pub command_timeout_s: f64,
}

const CHUNK: u32 = 1;
const POLL_MIN_S: f64 = 1.0;
const POLL_MAX_S: f64 = 30.0;
const GRACE_S: f64 = 60.0;
const COMMAND_TIMEOUT_S: f64 = 30.0;

fn is_default_chunk(chunk: &u32) -> bool {
    *chunk == CHUNK
}

fn is_default_poll_min(seconds: &f64) -> bool {
    *seconds == POLL_MIN_S
}

fn is_default_poll_max(seconds: &f64) -> bool {
    *seconds == POLL_MAX_S
}

fn is_default_grace(seconds: &f64) -> bool {
    *seconds == GRACE_S
}

fn is_default_command_timeout(seconds: &f64) -> bool {
    *seconds == COMMAND_TIMEOUT_S
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
            chunk: CHUNK,
            poll_min_s: POLL_MIN_S,
            poll_max_s: POLL_MAX_S,
            grace_s: GRACE_S,
            command_timeout_s: COMMAND_TIMEOUT_S,
        }
    }
}

/// A setting that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("slurm.{field}: {found}; expected {expected}")]
pub struct SlurmSettingError {
    /// The field.
    pub field: &'static str,
    /// Its value.
    pub found: String,
    /// Values that are allowed.
    pub expected: String,
}

/// Options of sbatch that the executor sets itself, or that would make it lose sight of its jobs.
const RESERVED: [&str; 14] = [
    "--array",
    "--job-name",
    "--output",
    "--error",
    "--input",
    "--chdir",
    "--parsable",
    "--wrap",
    "--wait",
    "--test-only",
    "--clusters",
    "--cluster",
    "--help",
    "--version",
];

impl SlurmSettings {
    /// Checks every setting.
    ///
    /// # Errors
    ///
    /// [`SlurmSettingError`] with the first mistake.
    pub fn check(&self) -> Result<(), SlurmSettingError> {
        self.check_words()?;
        for (field, count, most) in [
            ("time_min", self.time_min.map(u64::from), 525_600),
            ("memory_mb", self.memory_mb, 1 << 30),
            ("cpus", self.cpus.map(u64::from), 1 << 16),
            ("max_parallel", self.max_parallel.map(u64::from), 1 << 20),
            ("chunk", Some(u64::from(self.chunk)), 1 << 20),
        ] {
            if let Some(count) = count
                && !(1..=most).contains(&count)
            {
                return wrong(field, count, format!("a whole number from 1 to {most}"));
            }
        }
        for (field, seconds, least) in [
            ("poll_min_s", self.poll_min_s, 0.01),
            ("poll_max_s", self.poll_max_s, self.poll_min_s),
            ("grace_s", self.grace_s, 0.0),
            ("command_timeout_s", self.command_timeout_s, 0.1),
        ] {
            // At most a day; NaN is in no range.
            if !(least..=86_400.0).contains(&seconds) {
                return wrong(field, seconds, format!("{least} to 86400 [s]"));
            }
        }
        Ok(())
    }

    fn check_words(&self) -> Result<(), SlurmSettingError> {
        for (field, text) in [("partition", &self.partition), ("account", &self.account)] {
            if let Some(text) = text
                && (text.is_empty() || text.contains(|c: char| c.is_whitespace() || c.is_control()))
            {
                return wrong(field, format_args!("{text:?}"), "a name without blanks".into());
            }
        }
        for option in &self.extra {
            let name = option.split(['=', ' ']).next().unwrap_or_default();
            if !name.starts_with("--") || option.contains(char::is_control) {
                let expected = "options of sbatch in their long form, one per entry: \"--qos=low\"";
                return wrong("extra", format_args!("{option:?}"), expected.into());
            }
            // Slurm's commands take any beginning of a long option that is not ambiguous.
            let taken = |long: &&str| *long == name || (name.len() > 5 && long.starts_with(name));
            if RESERVED.iter().any(taken) {
                let expected = "only options that this program does not set itself".into();
                return wrong("extra", format_args!("{option:?}"), expected);
            }
        }
        for line in &self.setup {
            if line.contains(['\0', '\n', '\r']) {
                let expected = "one shell line per entry".into();
                return wrong("setup", format_args!("{line:?}"), expected);
            }
        }
        Ok(())
    }
}

fn wrong(
    field: &'static str,
    found: impl fmt::Display,
    expected: String,
) -> Result<(), SlurmSettingError> {
    Err(SlurmSettingError { field, found: found.to_string(), expected })
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
        assert_eq!(of(|s| s.time_min = Some(525_601)), Some("time_min"));
        assert_eq!(of(|s| s.cpus = Some(0)), Some("cpus"));
        assert_eq!(of(|s| s.memory_mb = Some(0)), Some("memory_mb"));
        assert_eq!(of(|s| s.setup = vec!["a\nb".into()]), Some("setup"));
        assert_eq!(of(|s| s.poll_min_s = f64::NAN), Some("poll_min_s"));
        assert_eq!(of(|s| s.poll_max_s = 0.5), Some("poll_max_s"), "below poll_min_s");
        assert_eq!(of(|s| s.grace_s = -1.0), Some("grace_s"));
        assert_eq!(of(|s| s.command_timeout_s = 0.0), Some("command_timeout_s"));
        let error = SlurmSettings { chunk: 0, ..good }.check().expect_err("no runs");
        assert_eq!(error.to_string(), "slurm.chunk: 0; expected a whole number from 1 to 1048576");
    }

    #[test]
    fn options_that_are_set_already_are_refused_in_every_spelling() {
        let check = |option: &str| {
            field_of(&SlurmSettings { extra: vec![option.into()], ..SlurmSettings::default() })
        };
        for good in ["--qos=low", "--constraint=avx2&ib", "--exclusive", "--mail-type=END"] {
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
            "-pshort",
        ] {
            assert_eq!(check(bad), Some("extra"), "{bad}");
        }
    }

    #[test]
    fn unknown_fields_are_refused_and_missing_ones_have_defaults() {
        let settings: SlurmSettings = serde_json::from_str(r#"{"chunk": 5}"#).expect("settings");
        assert_eq!(settings, SlurmSettings { chunk: 5, ..SlurmSettings::default() });
        assert!(serde_json::from_str::<SlurmSettings>(r#"{"chunks": 5}"#).is_err());
        // And what is at its default is not written.
        assert_eq!(serde_json::to_string(&settings).expect("JSON"), r#"{"chunk":5}"#);
        assert_eq!(serde_json::to_string(&SlurmSettings::default()).expect("JSON"), "{}");
    }
}
