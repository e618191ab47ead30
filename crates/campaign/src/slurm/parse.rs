//! Output of Slurm's commands, read strictly: anything unexpected is an error, and an error never means "no jobs".

use std::ops::RangeInclusive;

/// Columns that squeue is asked to print, see [`squeue`].
pub(super) const SQUEUE_FORMAT: &str = "%j|%F|%K|%T|%r";
/// The header it prints then. An answer without it is no answer.
const SQUEUE_HEADER: &str = "NAME|ARRAY_JOB_ID|ARRAY_TASK_ID|STATE|REASON";
/// Columns that sacct is asked to print, see [`sacct`].
pub(super) const SACCT_FORMAT: &str = "JobID,JobName,State,ExitCode";
const SACCT_HEADER: &str = "JobID|JobName|State|ExitCode";

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// In the queue, not yet started.
    Pending,
    /// Started and not ended, or in a state that this program does not know.
    Running,
    /// Over.
    Ended(Ending),
}

/// How a job ended, as Slurm says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    Completed,
    /// The worker exited with a code other than 0: it cannot do its work.
    ExitCode,
    Cancelled,
    TimeLimit,
    OutOfMemory,
    /// The node failed, the job was preempted or killed by a signal: nothing that it brought upon itself.
    Killed,
}

impl Ending {
    /// In words, for people.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Completed => "ended well",
            Self::ExitCode => "failed",
            Self::Cancelled => "was cancelled",
            Self::TimeLimit => "came to its time limit",
            Self::OutOfMemory => "ran out of memory",
            Self::Killed => "was killed, or its node failed",
        }
    }
}

impl State {
    /// Reads Slurm's word, which may be followed by more (`CANCELLED by 1000`).
    pub(super) fn parse(text: &str) -> Self {
        let word = text.split([' ', '+']).next().unwrap_or_default();
        match word {
            "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "REQUEUE_FED" | "SPECIAL_EXIT" => {
                Self::Pending
            }
            "COMPLETED" => Self::Ended(Ending::Completed),
            "FAILED" => Self::Ended(Ending::ExitCode),
            "CANCELLED" => Self::Ended(Ending::Cancelled),
            "TIMEOUT" | "DEADLINE" => Self::Ended(Ending::TimeLimit),
            "OUT_OF_MEMORY" => Self::Ended(Ending::OutOfMemory),
            "NODE_FAIL" | "BOOT_FAIL" | "PREEMPTED" | "REVOKED" => Self::Ended(Ending::Killed),
            _ => Self::Running,
        }
    }

    /// Slurm calls it a failure too when a signal ended the job.
    fn unless_exited(self, exited: bool) -> Self {
        match self {
            Self::Ended(Ending::ExitCode) if !exited => Self::Ended(Ending::Killed),
            state => state,
        }
    }
}

/// Elements of a job array: `5-19%5`, `1,3,7-9`, `0-10:2`, `0-3,7,...`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Elements {
    ranges: Vec<(RangeInclusive<u32>, usize)>,
    /// There are more, unnamed: Slurm cut the list off, or gave none.
    more: bool,
}

impl Elements {
    /// Reads what squeue and sacct print for the elements of an array.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} are no elements of a job array");
        let inner = text.strip_prefix('[').unwrap_or(text);
        let inner = inner.strip_suffix(']').unwrap_or(inner);
        // The limit of elements at the same time belongs to the whole list.
        let list = inner.split('%').next().unwrap_or_default();
        let mut elements = Self { ranges: Vec::new(), more: false };
        // What is left of an array that was cancelled before any of its elements started.
        if list == "N/A" {
            elements.more = true;
            return Ok(elements);
        }
        for part in list.split(',') {
            if part == "..." {
                elements.more = true;
                continue;
            }
            let (range, step) = part.split_once(':').unwrap_or((part, "1"));
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            let first: u32 = first.parse().map_err(|_| wrong())?;
            let last: u32 = last.parse().map_err(|_| wrong())?;
            let step: usize = step.parse().map_err(|_| wrong())?;
            if first > last || step == 0 {
                return Err(wrong());
            }
            elements.ranges.push((first..=last, step));
        }
        Ok(elements)
    }

    /// Whether the element is named.
    pub(super) fn name(&self, element: u32) -> bool {
        self.ranges.iter().any(|(range, step)| {
            range.contains(&element) && ((element - range.start()) as usize).is_multiple_of(*step)
        })
    }

    /// Whether the element is named, or may be among those that are not.
    pub(super) fn may_hold(&self, element: u32) -> bool {
        self.more || self.name(element)
    }
}

/// One line of squeue: elements of an array in the same state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct QueueRow {
    pub(super) name: String,
    pub(super) job: u64,
    pub(super) elements: Elements,
    pub(super) state: State,
    /// Why it waits, or how it ended, in Slurm's word.
    pub(super) reason: String,
}

/// Reads squeue's table of job arrays.
pub(super) fn squeue(text: &str) -> Result<Vec<QueueRow>, String> {
    let mut lines = content(text);
    match lines.next() {
        Some(SQUEUE_HEADER) => {}
        Some(other) => return Err(format!("squeue printed {other:?} where its header should be")),
        None => return Err("squeue printed nothing, not even its header".into()),
    }
    lines.filter(|line| *line != SQUEUE_HEADER).map(queue_row).collect()
}

fn queue_row(line: &str) -> Result<QueueRow, String> {
    let fields: Vec<&str> = line.splitn(5, '|').collect();
    let &[name, job, elements, state, reason] = fields.as_slice() else {
        return Err(format!("squeue printed {line:?}, which is no line of its table"));
    };
    let job = job.parse().map_err(|_| format!("squeue printed {job:?} as the number of a job"))?;
    if !state.starts_with(|first: char| first.is_ascii_uppercase()) {
        return Err(format!("squeue printed {state:?} as the state of job {job}"));
    }
    Ok(QueueRow {
        name: name.to_owned(),
        job,
        elements: Elements::parse(elements)?,
        state: State::parse(state).unless_exited(reason.starts_with("NonZeroExitCode")),
        reason: reason.to_owned(),
    })
}

/// The number of the job from `sbatch --parsable`: `1234` or `1234;cluster`.
pub(super) fn sbatch(text: &str) -> Result<u64, String> {
    let last = content(text).last().unwrap_or_default();
    let job = last.split(';').next().unwrap_or_default();
    job.parse()
        .map_err(|_| format!("sbatch printed {last:?} where the number of the job should be"))
}

/// `MaxArraySize` from `scontrol show config`: the highest element is one less.
pub(super) fn max_array_size(text: &str) -> Result<u32, String> {
    let value = text.lines().find_map(|line| {
        let (name, value) = line.split_once('=')?;
        (name.trim() == "MaxArraySize").then(|| value.trim())
    });
    let Some(value) = value else {
        return Err("scontrol show config does not give MaxArraySize".into());
    };
    match value.parse() {
        Ok(size @ 2..) => Ok(size),
        _ => Err(format!("this Slurm has no job arrays: MaxArraySize = {value}")),
    }
}

/// One line of sacct: how elements of an array ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AccountRow {
    pub(super) job: u64,
    pub(super) elements: Elements,
    pub(super) name: String,
    pub(super) state: State,
}

/// Reads sacct's table of job arrays.
pub(super) fn sacct(text: &str) -> Result<Vec<AccountRow>, String> {
    let mut lines = content(text);
    if lines.next() != Some(SACCT_HEADER) {
        return Err("sacct did not print its header".into());
    }
    lines
        .map(|line| {
            let wrong = || format!("sacct printed {line:?}, which is no line of its table");
            let fields: Vec<&str> = line.split('|').collect();
            let &[id, name, state, exit] = fields.as_slice() else { return Err(wrong()) };
            let (job, elements) = id.split_once('_').ok_or_else(wrong)?;
            Ok(AccountRow {
                job: job.parse().map_err(|_| wrong())?,
                elements: Elements::parse(elements)?,
                name: name.to_owned(),
                state: State::parse(state).unless_exited(exit.ends_with(":0")),
            })
        })
        .collect()
}

/// Lines that say something. With several clusters, Slurm names each above its table.
fn content(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("CLUSTER: "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elements_of(text: &str) -> Vec<u32> {
        let elements = Elements::parse(text).expect("elements");
        (0..30).filter(|&element| elements.may_hold(element)).collect()
    }

    #[test]
    fn elements_are_read_in_every_form_that_slurm_prints() {
        assert_eq!(elements_of("7"), [7]);
        assert_eq!(elements_of("[3-7,9%2]"), [3, 4, 5, 6, 7, 9]);
        assert_eq!(elements_of("5-8%5"), [5, 6, 7, 8]);
        assert_eq!(elements_of("1,3,7-9"), [1, 3, 7, 8, 9]);
        assert_eq!(elements_of("0-10:5"), [0, 5, 10]);
        assert_eq!(elements_of("0,2,..."), (0..30).collect::<Vec<_>>(), "cut off: may be any");
        assert_eq!(
            elements_of("N/A"),
            (0..30).collect::<Vec<_>>(),
            "cancelled before it was split"
        );
        assert!(!Elements::parse("N/A").expect("elements").name(0));
        for wrong in ["", "a-b", "5-3", "3-", "-3", "1,,2", "0-4:0", "[]", "4294967296"] {
            assert!(Elements::parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn squeue_gives_rows_of_real_output() {
        let text = "NAME|ARRAY_JOB_ID|ARRAY_TASK_ID|STATE|REASON\n\
                    x-1|12|5-19%5|PENDING|JobArrayTaskLimit\n\
                    x-1|12|0|RUNNING|None\n\
                    x-1|12|1|CANCELLED|None\n\
                    x-2|13|0|PENDING|ReqNodeNotAvail, UnavailableNodes:n[1-2]\n\
                    x-2|13|1|FAILED|NonZeroExitCode\n\
                    x-2|13|2|FAILED|JobLaunchFailure\n";
        let rows = squeue(text).expect("a table");
        assert_eq!(rows.len(), 6);
        assert_eq!(rows[4].state, State::Ended(Ending::ExitCode));
        assert_eq!(rows[5].state, State::Ended(Ending::Killed), "by a signal");
        assert_eq!((rows[0].job, rows[0].state), (12, State::Pending));
        assert!(rows[0].elements.name(19) && !rows[0].elements.name(4));
        assert_eq!(rows[1].state, State::Running);
        assert_eq!(rows[2].state, State::Ended(Ending::Cancelled));
        assert_eq!(rows[3].name, "x-2");
        assert!(rows[3].reason.ends_with("n[1-2]"));
    }

    #[test]
    fn squeue_with_a_header_alone_has_no_jobs_and_without_one_is_unknown() {
        let header = "NAME|ARRAY_JOB_ID|ARRAY_TASK_ID|STATE|REASON\n";
        assert_eq!(squeue(header), Ok(vec![]));
        assert_eq!(squeue(&format!("CLUSTER: a\n{header}CLUSTER: b\n{header}")), Ok(vec![]));
        for silent in
            ["", "\n\n", "slurm_load_jobs error: Unable to contact slurm controller", "1|2"]
        {
            assert!(squeue(silent).is_err(), "{silent:?}");
        }
        for garbage in
            ["x", "x|y|0|RUNNING|None", "x|1|0|???|None", "x|1|0", "x|1|zero|RUNNING|None"]
        {
            assert!(squeue(&format!("{header}{garbage}\n")).is_err(), "{garbage:?}");
        }
    }

    #[test]
    fn a_state_that_is_not_known_counts_as_running() {
        assert_eq!(State::parse("COMPLETING"), State::Running);
        assert_eq!(State::parse("STAGE_OUT"), State::Running);
        assert_eq!(State::parse("SOMETHING_NEW"), State::Running);
        assert_eq!(State::parse("CANCELLED by 1000"), State::Ended(Ending::Cancelled));
        assert_eq!(State::parse("CANCELLED+"), State::Ended(Ending::Cancelled));
        assert_eq!(State::parse("NODE_FAIL"), State::Ended(Ending::Killed));
    }

    #[test]
    fn the_number_of_a_job_is_read_and_nothing_else() {
        assert_eq!(sbatch("1234\n"), Ok(1234));
        assert_eq!(sbatch("1234;cluster\n"), Ok(1234));
        assert_eq!(sbatch("Welcome to the cluster!\n77\n"), Ok(77));
        for garbage in ["", "Submitted batch job", "-3", "12 13"] {
            assert!(sbatch(garbage).is_err(), "{garbage:?}");
        }
    }

    #[test]
    fn the_largest_array_is_read() {
        let config = "Configuration data as of 2026-11-21\nMaxArraySize            = 1001\nMaxDBDMsgs  = 20016\n";
        assert_eq!(max_array_size(config), Ok(1001));
        assert!(max_array_size("").is_err());
        assert!(max_array_size("MaxArraySize = 0").expect_err("off").contains("no job arrays"));
        assert!(max_array_size("MaxArraySize = many").is_err());
    }

    #[test]
    fn sacct_says_how_elements_ended() {
        let text = "JobID|JobName|State|ExitCode\n12_3|x-1|TIMEOUT|0:0\n12_[4-9%2]|x-1|PENDING|0:0\n\
                    12_10|x-1|CANCELLED by 0|0:15\n12_11|x-1|FAILED|1:0\n12_12|x-1|FAILED|0:9\n";
        let rows = sacct(text).expect("a table");
        assert_eq!(rows[0].state, State::Ended(Ending::TimeLimit));
        assert!(rows[0].elements.name(3) && rows[0].job == 12 && rows[0].name == "x-1");
        assert!(rows[1].elements.name(9) && rows[1].state == State::Pending);
        assert_eq!(rows[2].state, State::Ended(Ending::Cancelled));
        assert_eq!(rows[3].state, State::Ended(Ending::ExitCode));
        assert_eq!(rows[4].state, State::Ended(Ending::Killed), "by a signal");
        assert!(sacct("Slurm accounting storage is disabled\n").is_err());
        assert!(sacct("").is_err());
    }
}
