//! Tables and figures of a benchmark, each with where and when it was made.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use figures::{Figure, Width};
use workbench::error::RunError;
use workbench::output;
use workbench::tables::quoted;

/// Machine, revision and date of a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    machine: String,
    revision: String,
    date: String,
    command: String,
}

impl Header {
    /// Of this moment on this machine.
    pub(super) fn now(command: &str) -> Self {
        Self {
            machine: machine(),
            revision: revision(),
            date: today(),
            command: command.to_owned(),
        }
    }

    /// One line per fact, with a prefix.
    pub(super) fn lines(&self, prefix: &str) -> String {
        let Self { machine, revision, date, command } = self;
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
pub(super) struct Table {
    columns: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new(columns: &[&'static str]) -> Self {
        Self { columns: columns.to_vec(), rows: Vec::new() }
    }

    pub(super) fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.columns.len());
        self.rows.push(row);
    }

    pub(super) fn csv(&self, header: &Header) -> String {
        let line = |fields: Vec<String>| fields.join(",") + "\n";
        let mut text = header.lines("# ");
        text += &line(self.columns.iter().map(|name| quoted(name)).collect());
        for row in &self.rows {
            text += &line(row.iter().map(|value| quoted(value)).collect());
        }
        text
    }

    pub(super) fn markdown(&self) -> String {
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

/// Writes a figure as PNG and SVG.
pub(super) fn figure(folder: &Path, name: &str, figure: &dyn Figure) -> Result<(), RunError> {
    let picture = figure.render(Width::Full).map_err(|error| RunError::new(error.to_string()))?;
    output::write_file(&folder.join(format!("{name}.png")), &picture.png)?;
    output::write_file(&folder.join(format!("{name}.svg")), picture.svg.as_bytes())
}

/// Makes the folder.
pub(super) fn folder(path: &Path) -> Result<(), RunError> {
    std::fs::create_dir_all(path)
        .map_err(|error| RunError::new(format_args!("{}: cannot be made: {error}", path.display())))
}

/// A time for a person.
pub(super) fn seconds(time_s: f64) -> String {
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
    fn dates_are_wrong() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11_016), (2000, 2, 29));
        assert_eq!(civil(20_778), (2026, 11, 21));
    }

    #[test]
    fn a_table_loses_a_comma_or_a_bar() {
        let mut table = Table::new(&["a", "b"]);
        table.push(vec!["1,5".to_owned(), "x|y".to_owned()]);
        let header = Header::now("test");
        assert!(table.csv(&header).ends_with("a,b\n\"1,5\",x|y\n"));
        assert!(table.markdown().ends_with("| 1,5 | x\\|y |\n"));
        assert!(table.csv(&header).starts_with("# made by: test\n# machine: "));
    }
}
