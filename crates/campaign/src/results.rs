//! From the tables of a run to its values at the observation points.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use crate::outcome::FailureKind;
use crate::spec::{Interpolation, OutputSpec, ResultSpec};
use crate::table::{Format, Table, TableError};

/// Largest table that is read \[bytes\].
const LARGEST_BYTES: u64 = 512 << 20;

/// What a run without values is to be put down to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Blame {
    /// The run.
    Run,
    /// The run, or a disk that was full for a while: the file ends in the middle.
    Cut,
    /// The disk or the system, which could not give the file.
    Environment,
}

/// Why a run gives no values: the cause, and what was seen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub(crate) kind: FailureKind,
    pub(crate) detail: String,
    pub(crate) blame: Blame,
}

impl Refusal {
    fn of_run(kind: FailureKind, detail: String) -> Self {
        Self { kind, detail, blame: Blame::Run }
    }
}

/// The values of all observables of a run, one observable after the other; all finite.
pub(crate) fn read(folder: &Path, outputs: &[OutputSpec]) -> Result<Vec<f64>, Refusal> {
    let mut values = Vec::with_capacity(outputs.iter().map(|output| output.at.len()).sum());
    for output in outputs {
        values.extend(read_one(folder, output)?);
    }
    Ok(values)
}

fn read_one(folder: &Path, output: &OutputSpec) -> Result<Vec<f64>, Refusal> {
    let result = &output.result;
    let refused = |error| refusal(&result.file, error);
    let text = read_text(folder, &result.file)?;
    check_end(&text, result)?;
    let table = Table::parse(&text, result.format).map_err(refused)?;
    let values = table.column(&result.value).map_err(refused)?;
    let Some(control_name) = &result.control else {
        if values.len() != output.at.len() {
            let detail = format!("{} rows, {} observation points", values.len(), output.at.len());
            let (file, column) = (result.file.clone(), result.value.clone());
            return Err(Refusal::of_run(FailureKind::NoMatch { file, column }, detail));
        }
        check_finite(output, &values)?;
        return Ok(values);
    };
    let control = table.column(control_name).map_err(refused)?;
    if control.len() != values.len() {
        let (rows, others) = (control.len(), values.len());
        let detail = format!("{rows} values of {control_name}, {others} of {}", result.value);
        return Err(malformed(&result.file, detail));
    }
    if let Some(row) = control.iter().position(|at| !at.is_finite()) {
        let (file, column) = (Some(result.file.clone()), control_name.clone());
        let detail = format!("data row {}: {}", row + 1, control[row]);
        return Err(Refusal::of_run(FailureKind::NotANumber { file, column }, detail));
    }
    let found = match result.interpolate {
        Interpolation::Linear => interpolate(output, control_name, &control, &values),
        Interpolation::Refuse => pick(output, control_name, &control, &values),
    }?;
    check_finite(output, &found)?;
    Ok(found)
}

fn read_text(folder: &Path, file: &str) -> Result<String, Refusal> {
    let path = folder.join(file);
    let mut bytes = Vec::new();
    // A pipe or a device would never end.
    let plain = path.metadata().and_then(|metadata| {
        let not_plain = || io::Error::new(io::ErrorKind::IsADirectory, "it is not a plain file");
        if metadata.is_file() { Ok(()) } else { Err(not_plain()) }
    });
    let read = plain
        .and_then(|()| File::open(&path))
        .and_then(|file| file.take(LARGEST_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 > LARGEST_BYTES => {
            Err(malformed(file, format!("it is larger than {} MiB", LARGEST_BYTES >> 20)))
        }
        // Only names can be in another encoding, and those are then not found.
        Ok(_) => Ok(match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
        }),
        Err(error) if error.kind() == io::ErrorKind::NotFound && folder.is_dir() => {
            let kind = FailureKind::MissingOutput { file: file.to_owned() };
            Err(Refusal::of_run(kind, String::new()))
        }
        Err(error) if is_of_the_run(&error) => Err(malformed(file, error.to_string())),
        Err(error) => {
            let refusal = malformed(file, format!("{file} cannot be read: {error}"));
            Err(Refusal { blame: Blame::Environment, ..refusal })
        }
    }
}

fn refusal(file: &str, error: TableError) -> Refusal {
    match error {
        TableError::MissingColumn { column, names, .. } => {
            let kind = FailureKind::MissingColumn { file: file.to_owned(), column };
            Refusal::of_run(kind, format!("it has {}", names.join(", ")))
        }
        other => malformed(file, other.to_string()),
    }
}

fn malformed(file: &str, detail: impl Into<String>) -> Refusal {
    let kind = FailureKind::MalformedOutput { file: file.to_owned() };
    Refusal::of_run(kind, detail.into())
}

/// Whether an error on reading a file comes from what the run left there; any other is one of the disk or the system.
fn is_of_the_run(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidFilename, IsADirectory, NotADirectory, PermissionDenied};
    // A chain of links without end has no kind of its own yet.
    #[cfg(unix)]
    let loops = error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error());
    #[cfg(not(unix))]
    let loops = false;
    let kinds = [InvalidFilename, IsADirectory, NotADirectory, PermissionDenied];
    loops || kinds.contains(&error.kind())
}

/// Refuses a file that ends in the middle of a line, or of a JSON value: its last number may be cut off.
fn check_end(text: &str, result: &ResultSpec) -> Result<(), Refusal> {
    let (whole, wanted) = match result.format {
        Format::Json => (text.trim_end().ends_with(['}', ']']), "a closing bracket"),
        Format::Csv | Format::Whitespace => (text.ends_with(['\n', '\r']), "a line end"),
    };
    if whole {
        return Ok(());
    }
    let what = if text.is_empty() {
        "it is empty".to_owned()
    } else {
        format!("it does not end with {wanted}: its last number may be cut off")
    };
    Err(Refusal { blame: Blame::Cut, ..malformed(&result.file, what) })
}

/// Distance from an observation point within which a row counts as being at it: the rounding of a printed number.
///
/// # Formula
///
/// 1e-6 |at| + 1e-12 (largest − smallest `at`), but at most 1e-3 of the smallest distance between two
/// observation points. A table printed with six digits is within it.
struct Tolerance {
    range: f64,
    smallest_gap: f64,
}

impl Tolerance {
    fn new(at: &[f64]) -> Self {
        let mut sorted = at.to_vec();
        sorted.sort_by(f64::total_cmp);
        let range = sorted.last().unwrap_or(&0.0) - sorted.first().unwrap_or(&0.0);
        let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|&gap| gap > 0.0);
        Self { range, smallest_gap: gaps.fold(f64::INFINITY, f64::min) }
    }

    fn around(&self, at: f64) -> f64 {
        (1e-6 * at.abs() + 1e-12 * self.range).min(1e-3 * self.smallest_gap)
    }
}

fn interpolate(
    output: &OutputSpec,
    control_name: &str,
    control: &[f64],
    values: &[f64],
) -> Result<Vec<f64>, Refusal> {
    if let Some(row) = control.windows(2).position(|pair| pair[1] < pair[0]) {
        let (before, after) = (control[row], control[row + 1]);
        let detail = format!(
            "{control_name} goes back from {before} to {after} (data row {}): nothing can be interpolated",
            row + 2
        );
        return Err(malformed(&output.result.file, detail));
    }
    let (Some(&first), Some(&last)) = (control.first(), control.last()) else {
        return Err(malformed(&output.result.file, "it has no rows"));
    };
    let tolerance = Tolerance::new(&output.at);
    let mut found = Vec::with_capacity(output.at.len());
    for &at in &output.at {
        let near = tolerance.around(at);
        if at < first - near || at > last + near {
            let (file, column) = (output.result.file.clone(), control_name.to_owned());
            let detail =
                format!("{control_name} = {at} is needed, the table has {first} to {last}");
            return Err(Refusal::of_run(FailureKind::Extrapolation { file, column }, detail));
        }
        let at = at.clamp(first, last);
        // The first row at or after the point; there is one.
        let after = control.partition_point(|&row| row < at).min(control.len() - 1);
        found.push(if control[after] == at {
            values[after]
        } else {
            let (t0, t1) = (control[after - 1], control[after]);
            let weight = (at - t0) / (t1 - t0);
            values[after - 1] * (1.0 - weight) + values[after] * weight
        });
    }
    Ok(found)
}

/// The rows at the observation points, in their order, so that loading and unloading are told apart.
fn pick(
    output: &OutputSpec,
    control_name: &str,
    control: &[f64],
    values: &[f64],
) -> Result<Vec<f64>, Refusal> {
    let tolerance = Tolerance::new(&output.at);
    let mut found = Vec::with_capacity(output.at.len());
    let mut next = 0;
    for &at in &output.at {
        let near = tolerance.around(at);
        let Some(row) = control[next..].iter().position(|row| (row - at).abs() <= near) else {
            let (file, column) = (output.result.file.clone(), control_name.to_owned());
            let rows = control.len();
            let detail = format!(
                "none of the {} rows from data row {} on is at {control_name} = {at}",
                rows - next,
                next + 1
            );
            return Err(Refusal::of_run(FailureKind::NoMatch { file, column }, detail));
        };
        found.push(values[next + row]);
        next += row + 1;
    }
    Ok(found)
}

fn check_finite(output: &OutputSpec, values: &[f64]) -> Result<(), Refusal> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(place) => {
            let (file, column) = (Some(output.result.file.clone()), output.result.value.clone());
            let detail = format!("{} at observation point {}", values[place], output.at[place]);
            Err(Refusal::of_run(FailureKind::NotANumber { file, column }, detail))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn output(at: &[f64], interpolate: Interpolation) -> OutputSpec {
        let result = ResultSpec {
            file: "out.csv".into(),
            format: Format::Csv,
            control: Some("t".into()),
            value: "x".into(),
            interpolate,
        };
        OutputSpec { result, at: at.to_vec() }
    }

    fn values(table: &str, output: &OutputSpec) -> Result<Vec<f64>, FailureKind> {
        let dir = tempfile::tempdir().expect("a directory");
        std::fs::write(dir.path().join("out.csv"), table).expect("written");
        read(dir.path(), std::slice::from_ref(output)).map_err(|refusal| refusal.kind)
    }

    fn extrapolation() -> FailureKind {
        FailureKind::Extrapolation { file: "out.csv".into(), column: "t".into() }
    }

    fn no_match(column: &str) -> FailureKind {
        FailureKind::NoMatch { file: "out.csv".into(), column: column.into() }
    }

    #[test]
    fn a_straight_line_is_interpolated_exactly_and_never_extrapolated() {
        let table = "t,x\n0,1\n1,3\n4,9\n";
        let line = output(&[0.0, 0.25, 1.0, 2.5, 4.0], Interpolation::Linear);
        assert_eq!(values(table, &line), Ok(vec![1.0, 1.5, 3.0, 6.0, 9.0]));
        for beyond in [-0.001, 4.001, 1e300] {
            let output = output(&[0.5, beyond], Interpolation::Linear);
            assert_eq!(values(table, &output), Err(extrapolation()), "{beyond}");
        }
        // The last printed time may be rounded down.
        let rounded = output(&[0.5, 4.000_001], Interpolation::Linear);
        assert_eq!(values(table, &rounded), Ok(vec![2.0, 9.0]));
    }

    #[test]
    fn the_error_of_interpolation_falls_with_the_square_of_the_step() {
        let error = |n: u32| {
            let mut table = String::from("t,x\n");
            for i in 0..=n {
                let t = f64::from(i) / f64::from(n);
                table.push_str(&format!("{t},{}\n", t.exp()));
            }
            let at: Vec<f64> = (0..97).map(|i| f64::from(i) / 96.7).collect();
            let found = values(&table, &output(&at, Interpolation::Linear)).expect("inside");
            at.iter().zip(found).map(|(t, x)| (x - t.exp()).abs()).fold(0.0, f64::max)
        };
        let ratio = error(20) / error(40);
        assert!((3.5..4.5).contains(&ratio), "{ratio}");
    }

    #[test]
    fn without_interpolation_every_point_needs_its_row() {
        let table = "t,x\n0,1\n0.333333,2\n0.666667,3\n1,4\n";
        let exact = output(&[0.0, 1.0 / 3.0, 1.0], Interpolation::Refuse);
        assert_eq!(values(table, &exact), Ok(vec![1.0, 2.0, 4.0]));
        let off = output(&[0.0, 0.34, 1.0], Interpolation::Refuse);
        assert_eq!(values(table, &off), Err(no_match("t")));
        // Loading and unloading: the same control twice, in order.
        let path = "t,x\n0,1\n1,2\n0,3\n";
        let both = output(&[0.0, 1.0, 0.0], Interpolation::Refuse);
        assert_eq!(values(path, &both), Ok(vec![1.0, 2.0, 3.0]));
        let wrong = output(&[0.0, 0.0, 1.0], Interpolation::Refuse);
        assert_eq!(values(path, &wrong), Err(no_match("t")));
    }

    #[test]
    fn without_a_control_the_rows_are_the_points() {
        let mut plain = output(&[5.0, 6.0], Interpolation::Refuse);
        plain.result.control = None;
        assert_eq!(values("x\n1\n2\n", &plain), Ok(vec![1.0, 2.0]));
        assert_eq!(values("x\n1\n", &plain), Err(no_match("x")));
        assert_eq!(values("x\n1\n2\n3\n", &plain), Err(no_match("x")));
    }

    #[test]
    fn nan_counts_where_it_is_needed_and_only_there() {
        let nan = |column: &str| FailureKind::NotANumber {
            file: Some("out.csv".into()),
            column: column.into(),
        };
        let table = "t,x\n0,1\n1,nan\n2,3\n3,4\n";
        let around = output(&[0.0, 2.5], Interpolation::Linear);
        assert_eq!(values(table, &around), Ok(vec![1.0, 3.5]));
        let at = output(&[0.5], Interpolation::Linear);
        assert_eq!(values(table, &at), Err(nan("x")));
        assert_eq!(
            values("t,x\n0,1\n1,inf\n", &output(&[1.0], Interpolation::Refuse)),
            Err(nan("x"))
        );
        assert_eq!(values("t,x\nnan,1\n1,2\n", &at), Err(nan("t")));
    }

    #[test]
    fn a_control_that_goes_back_cannot_be_interpolated() {
        let malformed = FailureKind::MalformedOutput { file: "out.csv".into() };
        let output = output(&[0.5], Interpolation::Linear);
        assert_eq!(values("t,x\n0,1\n1,2\n0.5,3\n", &output), Err(malformed));
        // A row printed twice is no step back.
        assert_eq!(values("t,x\n0,1\n0,1\n1,2\n", &output), Ok(vec![1.5]));
    }

    #[test]
    fn each_kind_of_broken_table_has_its_own_cause() {
        let read = |text: Option<&str>, format| {
            let dir = tempfile::tempdir().expect("a directory");
            if let Some(text) = text {
                std::fs::write(dir.path().join("out"), text).expect("written");
            }
            let result = ResultSpec {
                file: "out".into(),
                format,
                control: None,
                value: "t".into(),
                interpolate: Interpolation::Refuse,
            };
            read_one(dir.path(), &OutputSpec { result, at: vec![0.0] })
        };
        let kind = read(None, Format::Csv).expect_err("missing").kind;
        assert_eq!(kind, FailureKind::MissingOutput { file: "out".into() });
        let malformed = FailureKind::MalformedOutput { file: "out".into() };
        for (text, format) in [
            ("", Format::Csv),
            ("# t x\n", Format::Whitespace),
            ("1,2\n", Format::Csv),
            ("t,x\n1,2\n1", Format::Csv),
            ("t t\n1 2\n", Format::Whitespace),
            ("{\"t\": [1, 2", Format::Json),
            ("[1, 2]", Format::Json),
            ("3", Format::Json),
            ("{\"t\": \"1\"}", Format::Json),
            ("[{\"t\": 1}, {}]", Format::Json),
        ] {
            assert_eq!(read(Some(text), format).expect_err(text).kind, malformed, "{text:?}");
        }
        let column = read(Some("a,b\n1,2\n"), Format::Csv).expect_err("no such column");
        let expected = FailureKind::MissingColumn { file: "out".into(), column: "t".into() };
        assert_eq!((column.kind, &*column.detail), (expected, "it has a, b"));
        let folder = tempfile::tempdir().expect("a directory");
        std::fs::create_dir(folder.path().join("out")).expect("made");
        let error = read_text(folder.path(), "out").expect_err("a directory");
        assert_eq!(error.kind, malformed);
    }
}
