//! The tables of a run: the posterior as a paper prints it, and every sample and draw.

use std::fmt::Write as _;

use smc_calib::{Coordinate, Parameter, ParameterSummary, Posterior};

use crate::error::{InputError, Mistake};
use crate::number::{significant, with_error};
use crate::pictures::SampleColumns;
use crate::posterior_file::PosteriorFile;
use crate::summary::{self, INFORMED_BITS};

/// Text as a CSV field.
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// One line of the posterior table.
struct Row {
    parameter: String,
    unit: String,
    form: &'static str,
    map: f64,
    median: f64,
    lower95: f64,
    upper95: f64,
    /// Mean and standard deviation in the coordinate the prior is flat or normal in.
    mean_sd: Option<(f64, f64, Coordinate)>,
    bits: Option<f64>,
    paper: Option<f64>,
    percentile: Option<f64>,
}

fn rows(file: &PosteriorFile) -> Vec<Row> {
    let mut rows = Vec::new();
    for (place, summary) in file.parameters.iter().enumerate() {
        let paper = file
            .paper
            .as_ref()
            .and_then(|paper| Some((paper.percentile_si.get(place).copied()??, paper)));
        let moments = &summary.in_coordinate;
        rows.push(Row {
            parameter: summary.parameter.name.clone(),
            unit: summary.parameter.unit.clone(),
            form: "SI",
            map: summary.map,
            median: summary.in_si.median,
            lower95: summary.in_si.eti95.lower,
            upper95: summary.in_si.eti95.upper,
            mean_sd: Some((moments.mean, moments.sd, summary.coordinate)),
            bits: Some(summary.information_gain_bits),
            paper: paper.and_then(|(_, paper)| si_of(paper, &summary.parameter.name)),
            percentile: paper.map(|(percentile, _)| percentile),
        });
    }
    if let Some(product) = &file.product {
        rows.push(Row {
            parameter: product.name.clone(),
            unit: product.unit.clone(),
            form: "SI",
            map: product.map,
            median: product.median,
            lower95: product.eti95[0],
            upper95: product.eti95[1],
            mean_sd: Some((product.mean_log10, product.sd_log10, Coordinate::Log10)),
            bits: Some(product.information_gain_bits),
            paper: product.paper,
            percentile: product.paper_percentile,
        });
    }
    for printed in &file.printed {
        rows.push(Row {
            parameter: printed.name.clone(),
            unit: printed.unit.clone(),
            form: "as printed in Table 3",
            map: printed.map,
            median: printed.median,
            lower95: printed.eti95[0],
            upper95: printed.eti95[1],
            mean_sd: Some((printed.mean_log10, printed.sd_log10, Coordinate::Log10)),
            bits: None,
            paper: printed.paper,
            percentile: printed.paper_percentile,
        });
    }
    if let Some(sigma) = &file.sigma {
        rows.push(Row {
            parameter: "sigma".to_owned(),
            unit: "1".to_owned(),
            form: "noise of a/R",
            map: f64::NAN,
            median: sigma.median,
            lower95: sigma.eti95[0],
            upper95: sigma.eti95[1],
            mean_sd: Some((sigma.mean, sigma.sd, Coordinate::Linear)),
            bits: None,
            paper: None,
            percentile: None,
        });
    }
    rows
}

fn si_of(paper: &crate::posterior_file::PaperComparison, name: &str) -> Option<f64> {
    let place = ["c1", "tau_s", "delta_c"].iter().position(|known| *known == name)?;
    Some(paper.si[place])
}

fn coordinate_name(coordinate: Coordinate) -> &'static str {
    match coordinate {
        Coordinate::Log10 => "log10",
        Coordinate::Linear => "linear",
    }
}

/// The posterior as a Markdown table.
#[must_use]
pub fn markdown(file: &PosteriorFile) -> String {
    let mut text = String::new();
    let plan = &file.plan;
    let _ = writeln!(text, "# {}\n", plan.title);
    if !file.is_posterior {
        let _ = writeln!(
            text,
            "**Not a posterior**: the noise was tuned to a wished-for effective sample size, and the proposals were not \
             corrected for.\n"
        );
    }
    let _ = writeln!(
        text,
        "Kinetics {}, {} observations ({}), R = {} µm, {} simulations, seed {}.\n",
        plan.kinetics,
        plan.experiment.time_s.len(),
        plan.experiment.name,
        significant(1e6 * plan.experiment.radius_m, 3),
        file.counters.simulations,
        plan.sampler.seed
    );
    text.push_str("| parameter | unit | form | MAP | median | 95 % interval | mean ± sd | information [bits] | paper | paper's percentile |\n");
    text.push_str("|---|---|---|---|---|---|---|---|---|---|\n");
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "–".to_owned());
    for row in rows(file) {
        let mean_sd = row.mean_sd.map(|(mean, sd, coordinate)| {
            // A standard deviation that does not exist is stored as the largest number there is.
            let values = if sd < f64::MAX {
                format!("{} ± {}", with_error(mean, sd, 2), significant(sd, 2))
            } else {
                format!("{} (no finite sd)", significant(mean, 3))
            };
            match coordinate {
                Coordinate::Log10 => format!("{values} (log10)"),
                Coordinate::Linear => values,
            }
        });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} … {} | {} | {} | {} | {} |",
            row.parameter,
            row.unit,
            row.form,
            or_dash(row.map.is_finite().then(|| significant(row.map, 3))),
            significant(row.median, 3),
            significant(row.lower95, 3),
            significant(row.upper95, 3),
            or_dash(mean_sd),
            or_dash(row.bits.map(|bits| {
                let not = if bits < INFORMED_BITS { " (not informed)" } else { "" };
                format!("{bits:.2}{not}")
            })),
            or_dash(row.paper.map(|paper| significant(paper, 3))),
            or_dash(row.percentile.map(|percentile| format!("{percentile:.1} %"))),
        );
    }
    let evidence = summary::diagnosis(file).evidence().replace("+-", "±");
    let _ = writeln!(
        text,
        "\n{evidence}; effective sample size {:.0}; k-hat {:.2}.",
        file.ess.importance, file.khat
    );
    for line in &file.advice {
        let _ = writeln!(text, "\n> {line}");
    }
    text
}

/// The posterior table as CSV, in full precision.
#[must_use]
pub fn csv(file: &PosteriorFile) -> String {
    let mut text = String::from(
        "parameter,unit,form,map,median,eti95_lower,eti95_upper,mean,sd,mean_sd_coordinate,information_gain_bits,paper,paper_percentile\n",
    );
    let or_empty = |value: Option<f64>| {
        value.filter(|value| value.is_finite()).map_or_else(String::new, |value| value.to_string())
    };
    for row in rows(file) {
        let (mean, sd, coordinate) = match row.mean_sd {
            Some((mean, sd, coordinate)) => (Some(mean), Some(sd), coordinate_name(coordinate)),
            None => (None, None, ""),
        };
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{coordinate},{},{},{}",
            row.parameter,
            row.unit,
            row.form,
            or_empty(Some(row.map)),
            row.median,
            row.lower95,
            row.upper95,
            or_empty(mean),
            or_empty(sd),
            or_empty(row.bits),
            or_empty(row.paper),
            or_empty(row.percentile),
        );
    }
    text
}

/// Every simulated sample with its weight: parameters in SI, normal scores, log likelihood (empty where the
/// simulation failed), weight, stage and sub-net.
#[must_use]
pub fn samples_csv(posterior: &Posterior) -> String {
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

/// Equally weighted posterior draws: parameters in SI, normal scores, and the noise sigma where it is inferred.
#[must_use]
pub fn draws_csv(posterior: &Posterior) -> String {
    let mut text = header(&posterior.parameters);
    text.push_str(",sigma [1],sample\n");
    text.reserve(posterior.draws.len() * 150);
    for draw in &posterior.draws {
        let sample = &posterior.samples[draw.sample];
        numbers(&mut text, sample.theta.iter().chain(&sample.z));
        let sigma = draw.sigma.map_or_else(String::new, |sigma| sigma.to_string());
        let _ = writeln!(text, ",{sigma},{}", draw.sample);
    }
    text
}

pub(crate) fn header(parameters: &[ParameterSummary]) -> String {
    let named = parameters.iter().map(|summary| {
        let Parameter { name, unit, .. } = &summary.parameter;
        // A unit that a user has written may hold anything.
        format!("{name} [{}]", unit.replace([',', '"', '\n', '\r'], " "))
    });
    let scores = parameters.iter().map(|summary| format!("z_{} [1]", summary.parameter.name));
    named.chain(scores).collect::<Vec<_>>().join(",")
}

pub(crate) fn numbers<'a>(text: &mut String, values: impl Iterator<Item = &'a f64>) {
    for (place, value) in values.enumerate() {
        if place > 0 {
            text.push(',');
        }
        let _ = write!(text, "{value:e}");
    }
}

/// The columns that the corner plot needs, straight from a posterior.
#[must_use]
pub fn sample_columns(posterior: &Posterior) -> SampleColumns {
    let dimensions = posterior.parameters.len();
    SampleColumns {
        parameters: (0..dimensions)
            .map(|d| posterior.samples.iter().map(|sample| sample.theta[d]).collect())
            .collect(),
        weights: posterior.samples.iter().map(|sample| sample.weight).collect(),
    }
}

/// The parameter columns \[SI\] of a `draws.csv`, one draw per row.
///
/// # Errors
///
/// [`InputError`] with line and column for a file that is cut off or not a table of draws.
pub fn read_parameters(
    name: &str,
    text: &str,
    dimensions: usize,
) -> Result<Vec<Vec<f64>>, InputError> {
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
pub fn read_sample_columns(
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
