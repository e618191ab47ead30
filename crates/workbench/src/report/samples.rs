//! `samples.csv` and `draws.csv`: every sample and draw of a run, written and read again.

use std::fmt::Write as _;
use std::path::Path;

use smc_calib::{Parameter, ParameterSummary, Posterior};

use super::quoted;
use crate::checksums;
use crate::error::{InputError, Mistake};
use crate::record::Record;

/// The weighted samples of a run: what figures need beside the record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleColumns {
    /// One column per parameter \[SI\].
    pub parameters: Vec<Vec<f64>>,
    /// Normalised weights.
    pub weights: Vec<f64>,
}

impl SampleColumns {
    /// The columns of a posterior.
    #[must_use]
    pub fn of(posterior: &Posterior) -> Self {
        let samples = &posterior.samples;
        let column = |d: usize| samples.iter().map(|sample| sample.theta[d]).collect();
        Self {
            parameters: (0..posterior.parameters.len()).map(column).collect(),
            weights: samples.iter().map(|sample| sample.weight).collect(),
        }
    }
}

/// Every simulated sample with its weight: parameters in SI, normal scores, log likelihood (empty where the
/// simulation failed), weight, stage and sub-net.
#[must_use]
pub(super) fn samples_csv(posterior: &Posterior) -> String {
    let mut text = header(&posterior.parameters);
    text.push_str(",log_likelihood,weight,stage,replicate\n");
    text.reserve(posterior.samples.len() * 150);
    for sample in &posterior.samples {
        numbers(&mut text, sample.theta.iter().chain(&sample.z));
        let log_likelihood = sample.log_likelihood.map_or_else(String::new, |l| l.to_string());
        let _ = writeln!(
            text,
            ",{log_likelihood},{:e},{},{}",
            sample.weight, sample.stage, sample.replicate
        );
    }
    text
}

/// Equally weighted posterior draws: parameters in SI, normal scores, and the noise sigma of each observable that has
/// one.
pub(super) fn draws_csv(record: &Record, posterior: &Posterior) -> String {
    let mut text = header(&posterior.parameters);
    let with_sigma: Vec<_> =
        posterior.groups.iter().filter(|group| !group.sigma_draws.is_empty()).collect();
    for group in &with_sigma {
        let observable = record.observables().find(|(_, found)| found.label == group.name);
        let unit = observable.map_or("", |(plan, _)| plan.unit.as_str());
        let unit = if unit.is_empty() { "1" } else { unit };
        text.push(',');
        text.push_str(&quoted(&format!("sigma_{} [{unit}]", group.name)));
    }
    // One observable has the noise of the draw itself.
    let single = posterior.groups.is_empty();
    text.push_str(if single { ",sigma [1],sample\n" } else { ",sample\n" });
    text.reserve(posterior.draws.len() * 150);
    for (place, draw) in posterior.draws.iter().enumerate() {
        let sample = &posterior.samples[draw.sample];
        numbers(&mut text, sample.theta.iter().chain(&sample.z));
        if single {
            let sigma = draw.sigma.map_or_else(String::new, |sigma| sigma.to_string());
            let _ = write!(text, ",{sigma}");
        }
        for group in &with_sigma {
            let _ = write!(text, ",{}", group.sigma_draws[place]);
        }
        let _ = writeln!(text, ",{}", draw.sample);
    }
    text
}

fn header(parameters: &[ParameterSummary]) -> String {
    let named = parameters.iter().map(|summary| {
        let Parameter { name, unit, .. } = &summary.parameter;
        // A unit that a user has written may hold anything.
        format!("{name} [{}]", unit.replace([',', '"', '\n', '\r'], " "))
    });
    let scores = parameters.iter().map(|summary| format!("z_{} [1]", summary.parameter.name));
    named.chain(scores).collect::<Vec<_>>().join(",")
}

fn numbers<'a>(text: &mut String, values: impl Iterator<Item = &'a f64>) {
    for (place, value) in values.enumerate() {
        if place > 0 {
            text.push(',');
        }
        let _ = write!(text, "{value:e}");
    }
}

/// The parameter columns \[SI\] of a `draws.csv`, one draw per row.
///
/// # Errors
///
/// [`InputError`] with line and column for a file that is cut off or not a table of draws.
fn read_parameters(name: &str, text: &str, dimensions: usize) -> Result<Vec<Vec<f64>>, InputError> {
    let mut lines = text.lines().enumerate();
    let width = match lines.next() {
        Some((_, header)) if !header.is_empty() => header.split(',').count(),
        _ => return Err(InputError::new(name, Mistake::Empty).found("an empty file")),
    };
    let mut columns = vec![Vec::new(); dimensions];
    for (line, row) in lines {
        let fields = row_of(name, line, row, width)?;
        for (place, column) in columns.iter_mut().enumerate() {
            column.push(number_at(name, line, &fields, place)?);
        }
    }
    if columns.first().is_none_or(Vec::is_empty) {
        return Err(InputError::new(name, Mistake::Empty)
            .found("a table without draws")
            .help("run the calibration again"));
    }
    Ok(columns)
}

/// The fields of a row that has as many as the header.
fn row_of<'a>(
    name: &str,
    line: usize,
    row: &'a str,
    width: usize,
) -> Result<Vec<&'a str>, InputError> {
    let fields: Vec<&str> = row.split(',').collect();
    if fields.len() == width {
        return Ok(fields);
    }
    Err(InputError::new(name, Mistake::Syntax)
        .at_line(line + 1)
        .found(format_args!("{} columns", fields.len()))
        .expected(width)
        .help("the file is cut off or edited; run the calibration again"))
}

fn number_at(name: &str, line: usize, fields: &[&str], place: usize) -> Result<f64, InputError> {
    let refused = || {
        InputError::new(name, Mistake::WrongType)
            .at_line(line + 1)
            .found(format_args!("\"{}\"", fields.get(place).copied().unwrap_or_default()))
            .expected("a finite number")
    };
    let number = fields.get(place).and_then(|field| field.parse::<f64>().ok());
    number.filter(|number| number.is_finite()).ok_or_else(refused)
}

/// The columns that the corner plot needs, from the text of a `samples.csv`.
///
/// # Errors
///
/// [`InputError`] with line and column for a file that is cut off or not a table of samples.
fn read_sample_columns(
    name: &str,
    text: &str,
    dimensions: usize,
) -> Result<SampleColumns, InputError> {
    let mut lines = text.lines().enumerate();
    let (_, header) = lines.next().ok_or_else(|| {
        InputError::new(name, Mistake::Empty).found("an empty file").expected("a samples.csv")
    })?;
    let width = header.split(',').count();
    let Some(weight_place) = header.split(',').position(|column| column == "weight") else {
        return Err(InputError::new(name, Mistake::MissingColumn)
            .at_line(1)
            .expected("a column weight")
            .help("name a samples.csv written by this program"));
    };
    let mut columns =
        SampleColumns { parameters: vec![Vec::new(); dimensions], weights: Vec::new() };
    for (line, row) in lines {
        let fields = row_of(name, line, row, width)?;
        for (place, column) in columns.parameters.iter_mut().enumerate() {
            column.push(number_at(name, line, &fields, place)?);
        }
        columns.weights.push(number_at(name, line, &fields, weight_place)?);
    }
    Ok(columns)
}

/// Reads the samples beside a `posterior.json`.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_samples(record: &Record, folder: &Path) -> Result<SampleColumns, InputError> {
    let path = folder.join("samples.csv");
    checksums::read_as(&path, |name, text| {
        let samples = read_sample_columns(name, text, record.parameters.len())?;
        complete(name, samples.weights.len(), record.counters.simulations, "samples")?;
        if samples.weights.is_empty() {
            return Err(InputError::new(name, Mistake::Empty)
                .found("a table without samples")
                .expected("the samples of the run")
                .help("run the calibration again"));
        }
        Ok(samples)
    })
}

/// Reads the parameter columns \[SI\] of the draws beside a `posterior.json`, one draw per row.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_draws(record: &Record, folder: &Path) -> Result<Vec<Vec<f64>>, InputError> {
    let path = folder.join("draws.csv");
    checksums::read_as(&path, |name, text| {
        let draws = read_parameters(name, text, record.parameters.len())?;
        complete(name, draws.first().map_or(0, Vec::len), record.plan.sampler.draws, "draws")?;
        Ok(draws)
    })
}

/// Refuses a table that was cut off at the end of a line.
fn complete(name: &str, found: usize, wanted: usize, what: &str) -> Result<(), InputError> {
    if found == wanted {
        return Ok(());
    }
    Err(InputError::new(name, Mistake::Damaged)
        .found(format_args!("{found} {what}"))
        .expected(format_args!("{wanted}, as posterior.json says"))
        .help("the file is cut off or belongs to another run: run the calibration again"))
}
