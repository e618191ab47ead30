//! The report of a study: its folder, its table, its figures, and where and when it was made.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use figures::{Figure, Width};
use workbench::error::RunError;

/// Output folder of a study: `report.md`, `table.csv` and figures as SVG.
pub(crate) struct Report {
    folder: PathBuf,
    header: Header,
    start: Instant,
    figures: Vec<String>,
}

/// Command, machine, revision and date of a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Header {
    command: String,
    machine: String,
    revision: String,
    date: String,
}

impl Report {
    /// Makes the folder of a study, named after it.
    pub(crate) fn begin(out: &Path, study: &str) -> Result<Self, RunError> {
        Self::part(out, study, study)
    }

    /// Makes the folder of a part of a study, which a command of its own makes.
    pub(crate) fn part(out: &Path, folder: &str, command: &str) -> Result<Self, RunError> {
        let folder = out.join(folder);
        fs::create_dir_all(&folder)
            .map_err(|error| RunError::new(format_args!("{}: {error}", folder.display())))?;
        Ok(Self {
            folder,
            header: Header::now(command),
            start: Instant::now(),
            figures: Vec::new(),
        })
    }

    /// Path of a file in the report's folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Revision of the code that the report is made by; none where it is not that of a commit.
    pub(crate) fn commit(&self) -> Option<&str> {
        Some(&*self.header.revision).filter(|revision| !revision.contains(' '))
    }

    /// Writes `table.csv`.
    pub(crate) fn table(&self, table: &Table) -> Result<(), RunError> {
        self.write("table.csv", &table.csv(&self.header)?)
    }

    /// Writes a figure as `NAME.svg`, for the width of a page.
    pub(crate) fn figure(&mut self, name: &str, figure: &dyn Figure) -> Result<(), RunError> {
        let picture = figure.render(Width::Full).map_err(RunError::new)?;
        if !self.figures.iter().any(|known| known == name) {
            self.figures.push(name.to_owned());
        }
        self.write(&format!("{name}.svg"), &picture.svg)
    }

    /// Writes `report.md`: heading, header, time that the study took, text, figures.
    pub(crate) fn page(&self, heading: &str, text: &str) -> Result<(), RunError> {
        let took = seconds(self.start.elapsed().as_secs_f64());
        let header = self.header.lines("- ");
        let mut page = format!("# {heading}\n\n{header}- run time: {took}\n\n{text}");
        for name in &self.figures {
            let _ = write!(page, "\n![{name}]({name}.svg)\n");
        }
        self.write("report.md", &page)
    }

    fn write(&self, name: &str, text: &str) -> Result<(), RunError> {
        let path = self.folder.join(name);
        fs::write(&path, text)
            .map_err(|error| RunError::new(format_args!("{}: {error}", path.display())))
    }
}

impl Header {
    /// Of this moment on this machine.
    fn now(study: &str) -> Self {
        Self {
            command: format!("cargo run --release -p studies -- {study}"),
            machine: machine(),
            revision: revision(),
            date: today(),
        }
    }

    /// One line per fact, with a prefix.
    fn lines(&self, prefix: &str) -> String {
        let Self { command, machine, revision, date } = self;
        format!(
            "{prefix}made by: {command}\n{prefix}machine: {machine}\n{prefix}revision: {revision}\n{prefix}date: {date}\n"
        )
    }
}

fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
        .map_or(std::env::consts::ARCH, |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{name}, {cores} cores, {}", std::env::consts::OS)
}

fn revision() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short", "HEAD"]) else {
        return format!("version {}", env!("CARGO_PKG_VERSION"));
    };
    match git(&["status", "--porcelain", "--untracked-files=no", "--", "crates"]) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit} with changes"),
    }
}

fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (year, month, day) = civil((seconds / 86_400) as i64);
    format!("{year}-{month:02}-{day:02}")
}

/// Year, month and day of a number of days since 1970-01-01 (H. Hinnant, *chrono-compatible low-level date
/// algorithms*).
fn civil(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let of_era = shifted.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year_of_era + era * 400 + i64::from(month <= 2), month, day)
}

/// A table that is written as CSV and as Markdown.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Table {
    columns: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(columns: &[&'static str]) -> Self {
        Self { columns: columns.to_vec(), rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.columns.len());
        self.rows.push(row);
    }

    fn csv(&self, header: &Header) -> Result<String, RunError> {
        let mut writer = csv::Writer::from_writer(header.lines("# ").into_bytes());
        writer.write_record(&self.columns).map_err(RunError::new)?;
        for row in &self.rows {
            writer.write_record(row).map_err(RunError::new)?;
        }
        let bytes = writer.into_inner().map_err(RunError::new)?;
        String::from_utf8(bytes).map_err(RunError::new)
    }

    pub(crate) fn markdown(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(text, "| {} |", self.columns.join(" | "));
        let _ = writeln!(text, "|{}", "---|".repeat(self.columns.len()));
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        text
    }
}

/// A time to three digits with its unit.
pub(crate) fn seconds(time_s: f64) -> String {
    let (scale, unit) = match time_s {
        t if t >= 1.0 => (1.0, "s"),
        t if t >= 1e-3 => (1e3, "ms"),
        t if t >= 1e-6 => (1e6, "µs"),
        _ => (1e9, "ns"),
    };
    format!("{} {unit}", workbench::number::significant(time_s * scale, 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_since_1970_become_dates() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        assert_eq!(civil(20_778), (2026, 11, 21));
    }

    #[test]
    fn commas_and_bars_stay_inside_their_cells() {
        let mut table = Table::new(&["a", "b"]);
        table.push(vec!["1,5".to_owned(), "x|y".to_owned()]);
        let header = Header::now("test");
        let csv = table.csv(&header).expect("text");
        assert!(csv.ends_with("a,b\n\"1,5\",x|y\n"));
        assert!(table.markdown().ends_with("| 1,5 | x\\|y |\n"));
        assert!(csv.starts_with("# made by: cargo run --release -p studies -- test\n# machine: "));
    }
}
