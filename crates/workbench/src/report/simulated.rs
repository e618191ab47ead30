//! `simulated.csv`: what a function of the calling program gave for each sample, written and read again.
//!
//! The values of built-in simulators are computed again where they are needed, those of programs are among their runs. A
//! function can be called by its own program alone.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{InputError, Mistake};
use crate::input::text_file;
use crate::plan::Plan;

/// Its name.
pub(crate) const FILE: &str = "simulated.csv";

/// The text: a column for each observation, a row for each sample, empty where its simulation failed.
pub(crate) fn csv<'a>(plan: &Plan, rows: impl Iterator<Item = Option<&'a [f64]>>) -> String {
    let names = plan.observables().flat_map(|(_, observable)| {
        (0..observable.values.len()).map(|row| format!("{}[{row}]", observable.name))
    });
    let mut text = names.collect::<Vec<_>>().join(",");
    text.push('\n');
    for row in rows {
        for place in 0..plan.observations() {
            if place > 0 {
                text.push(',');
            }
            if let Some(values) = row {
                let _ = write!(text, "{:e}", values[place]);
            }
        }
        text.push('\n');
    }
    text
}

/// Reads the values of every sample of a run; none where the simulation failed.
///
/// # Errors
///
/// [`InputError`] for a file that is missing, cut off or edited.
pub fn read_simulated(plan: &Plan, folder: &Path) -> Result<Vec<Option<Vec<f64>>>, InputError> {
    let path = folder.join(FILE);
    let (name, text) = (path.display().to_string(), text_file::read(&path)?);
    let damaged = |line: usize, found: String| {
        InputError::new(&name, Mistake::Damaged)
            .at_line(line)
            .found(found)
            .help("the file is cut off or edited; run the calibration again")
    };
    let width = plan.observations();
    let row = |(place, line): (usize, &str)| {
        if line.bytes().all(|byte| byte == b',') {
            return Ok(None);
        }
        let values: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
        match values {
            Ok(values) if values.len() == width => Ok(Some(values)),
            _ => Err(damaged(place + 1, format!("not {width} numbers"))),
        }
    };
    let rows: Vec<_> = text.lines().enumerate().skip(1).map(row).collect::<Result<_, _>>()?;
    match rows.len() {
        found if !text.ends_with('\n') => Err(damaged(found + 1, "half a line".to_owned())),
        found if found == plan.budget() || (found > 0 && plan.sampler.ess_target.is_some()) => {
            Ok(rows)
        }
        found => Err(damaged(found + 1, format!("{found} samples of {}", plan.budget()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;

    #[test]
    fn what_is_written_reads_back_and_what_is_cut_off_is_refused() {
        let options =
            PairOptions { material: Some(Material::Ps), samples: 16, ..PairOptions::default() };
        let plan = options.plan().expect("a plan").plan;
        let values = vec![0.1 + 0.2; plan.observations()];
        let rows: Vec<Option<Vec<f64>>> =
            (0..16).map(|k| (k != 3).then(|| values.clone())).collect();
        let text = csv(&plan, rows.iter().map(Option::as_deref));
        let folder = tempfile::tempdir().expect("a folder");
        let read = |text: &str| {
            std::fs::write(folder.path().join(FILE), text).expect("a file");
            read_simulated(&plan, folder.path())
        };
        assert_eq!(read(&text).expect("values"), rows);
        let (whole, _) = text.trim_end().rsplit_once('\n').expect("lines");
        for (damaged, words) in [
            (format!("{whole}\n"), "15 samples of 16"),
            (text[..text.len() - 9].to_owned(), "half a line"),
            (text.replacen("e-1", "f-1", 1), "line 2: not "),
            (text.replacen("e-1,", "e-1", 1), "line 2: not "),
        ] {
            let error = read(&damaged).expect_err(words).to_string();
            assert!(
                error.contains(words) && error.contains("run the calibration again"),
                "{error}"
            );
        }
    }
}
