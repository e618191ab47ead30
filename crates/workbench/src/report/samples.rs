//! `samples.csv` and `draws.csv`: every sample and draw of a run, written and read again.

use std::fmt::Write as _;
use std::path::Path;

use campaign::Format;
use smc_calib::{
    Concern, NoiseDraw, NoiseShape, Parameter, ParameterSummary, Posterior, Prior, Sample,
    ShapeSummary,
};

use super::noise::{length_unit, or_one};
use crate::error::{InputError, Mistake};
use crate::input::data_table::{DataTable, quoted};
use crate::output::checksums;
use crate::plan::ObservablePlan;
use crate::record::{ObservableRecord, Record};

/// File of the equally weighted draws.
pub(crate) const DRAWS: &str = "draws.csv";

/// Column of `draws.csv` with the number of the sample, from 0.
const SAMPLE: &str = "sample";

/// What the columns of moved parameters begin with, the last ones of `samples.csv`.
const MOVED: &str = "moved_";

/// Largest normal score that is written: at the end of a prior it is infinite.
const FARTHEST: f64 = 9.0;

/// The weighted samples of a run: what figures need beside the record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleColumns {
    /// One column per parameter \[SI\], as simulated.
    pub parameters: Vec<Vec<f64>>,
    /// Same, where samples were moved to ([`Sample::moved`](smc_calib::Sample)); no columns where none was.
    pub moved: Vec<Vec<f64>>,
    /// Normalised weights.
    pub weights: Vec<f64>,
}

impl SampleColumns {
    /// The columns of a posterior.
    pub fn of(posterior: &Posterior) -> Self {
        let samples = &posterior.samples;
        let columns = |of: fn(&Sample) -> &[f64], count: usize| {
            (0..count).map(|d| samples.iter().map(|sample| of(sample)[d]).collect()).collect()
        };
        let parameters = posterior.parameters.len();
        Self {
            parameters: columns(|sample| &sample.theta, parameters),
            moved: columns(|sample| &sample.moved, posterior.moved.map_or(0, |_| parameters)),
            weights: samples.iter().map(|sample| sample.weight).collect(),
        }
    }

    /// A column per parameter of what the summaries are of: as [`Sample::estimated`](smc_calib::Sample::estimated).
    pub fn estimated(&self) -> &[Vec<f64>] {
        if self.moved.is_empty() { &self.parameters } else { &self.moved }
    }
}

/// The equally weighted draws of a run, with the noise of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DrawColumns {
    /// One column per parameter \[SI\].
    pub parameters: Vec<Vec<f64>>,
    /// Noise of each observable in every draw; empty where it is stated row by row.
    pub noise: Vec<Vec<NoiseDraw>>,
    /// Place of the sample of each draw among all samples, from 0.
    pub samples: Vec<usize>,
}

impl DrawColumns {
    /// The draws of a posterior with so many observables.
    pub fn of(posterior: &Posterior, observables: usize) -> Self {
        let draws = &posterior.draws;
        let column = |d: usize| draws.iter().map(|draw| posterior.theta(draw)[d]).collect();
        let of_group = |g: usize| match posterior.groups.get(g) {
            Some(group) => (0..draws.len()).map_while(|k| group.noise_draw(k)).collect(),
            None => draws.iter().map_while(|draw| draw.noise()).collect(),
        };
        Self {
            parameters: (0..posterior.parameters.len()).map(column).collect(),
            noise: (0..observables).map(of_group).collect(),
            samples: draws.iter().map(|draw| draw.sample).collect(),
        }
    }

    /// Reads the draws beside a `posterior.json`.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a file that is missing or cut off.
    pub fn read(record: &Record, folder: &Path) -> Result<Self, InputError> {
        checksums::read_as(&folder.join(DRAWS), |name, text| {
            let found: Vec<&ObservableRecord> =
                record.observables().map(|(_, found)| found).collect();
            let known = |titles: &Vec<String>, found: &ObservableRecord| {
                if found.sigma.is_some() { titles.clone() } else { Vec::new() }
            };
            let titles = noise_titles(record);
            let wanted: Vec<Vec<String>> =
                titles.iter().zip(&found).map(|(titles, found)| known(titles, found)).collect();
            let parameters = record.parameters.len();
            let mut last: Vec<&str> = wanted.iter().flatten().map(String::as_str).collect();
            last.push(SAMPLE);
            let mut columns = columns(name, text, parameters, &last)?;
            let samples = columns.pop().unwrap_or_default();
            complete(name, samples.len(), record.plan.sampler.draws, "draws")?;
            let mut rest = columns.split_off(parameters).into_iter();
            let noise = wanted.iter().zip(&found).map(|(titles, found)| {
                let own: Vec<Vec<f64>> = rest.by_ref().take(titles.len()).collect();
                noise_of(&own, found.noise_shape.as_ref())
            });
            let noise = noise.collect();
            let samples = places(name, &samples, record.counters.simulations)?;
            Ok(Self { parameters: columns, noise, samples })
        })
    }
}

/// The noise of every draw, from its columns: sigma, and what else it has.
fn noise_of(columns: &[Vec<f64>], shape: Option<&ShapeSummary>) -> Vec<NoiseDraw> {
    let shape_of = |row: usize| match (shape?, columns) {
        (ShapeSummary::Correlated { .. }, [_, length, white]) => {
            Some(NoiseShape::Correlated { length: length[row], white_share: white[row] })
        }
        (ShapeSummary::Robust { outlier_share, outlier_width, .. }, _) => {
            let (outlier_share, outlier_width) = (*outlier_share, *outlier_width);
            Some(NoiseShape::Robust { outlier_share, outlier_width })
        }
        _ => None,
    };
    let sigmas = columns.first().into_iter().flatten().enumerate();
    sigmas.map(|(row, sigma)| NoiseDraw { sigma: *sigma, shape: shape_of(row) }).collect()
}

/// Numbers of samples, which must be among so many.
fn places(name: &str, numbers: &[f64], simulations: usize) -> Result<Vec<usize>, InputError> {
    let place = |number: &f64| {
        let there = number.fract() == 0.0 && (0.0..simulations as f64).contains(number);
        there.then_some(*number as usize).ok_or_else(|| {
            InputError::new(name, Mistake::Damaged)
                .in_column(SAMPLE)
                .found(number)
                .expected(format_args!("a whole number below {simulations}"))
                .help("the file was edited: run the calibration again")
        })
    };
    numbers.iter().map(place).collect()
}

/// Every simulated sample with its weight: parameters in SI, normal scores, log likelihood (empty where the
/// simulation failed), weight, stage and sub-net; where samples were moved the parameters that they were moved to.
pub(super) fn samples_csv(posterior: &Posterior) -> String {
    let mut text = header(&posterior.parameters);
    text.push_str(",log_likelihood,weight,stage,replicate");
    if posterior.moved.is_some() {
        let moved = posterior.parameters.iter().map(|one| format!(",{MOVED}{}", titled(one)));
        text.extend(moved);
    }
    text.push('\n');
    text.reserve(posterior.samples.len() * 150);
    for sample in &posterior.samples {
        numbers(&mut text, sample.theta.iter().chain(&sample.z));
        let log_likelihood = sample.log_likelihood.map_or_else(String::new, |l| l.to_string());
        let _ = write!(
            text,
            ",{log_likelihood},{:e},{},{}",
            sample.weight, sample.stage, sample.replicate
        );
        for value in &sample.moved {
            let _ = write!(text, ",{value:e}");
        }
        text.push('\n');
    }
    text
}

/// Equally weighted posterior draws: parameters in SI as the summaries have them, normal scores, and the noise sigma of each observable that has
/// one.
pub(super) fn draws_csv(record: &Record, posterior: &Posterior) -> String {
    let mut text = header(&posterior.parameters);
    let with_sigma: Vec<_> =
        posterior.groups.iter().filter(|group| !group.sigma_draws.is_empty()).collect();
    // One observable has the noise of the draw itself.
    let of_next = record.population.is_some();
    let sigma_of_next = of_next && posterior.draws.iter().all(|draw| draw.sigma.is_some());
    let single = posterior.groups.is_empty() && (!of_next || sigma_of_next);
    if sigma_of_next {
        text.push_str(",sigma [1]");
    }
    for (titles, (_, found)) in noise_titles(record).iter().zip(record.observables()) {
        if single || with_sigma.iter().any(|group| group.name == found.label) {
            titles.iter().for_each(|title| {
                text.push(',');
                text.push_str(&quoted(title));
            });
        }
    }
    let _ = writeln!(text, ",{SAMPLE}");
    text.reserve(posterior.draws.len() * 150);
    for (place, draw) in posterior.draws.iter().enumerate() {
        let (theta, sample) = (posterior.theta(draw), &posterior.samples[draw.sample]);
        let priors = posterior.parameters.iter().map(|one| &one.parameter.prior);
        let score = |(theta, prior): (&f64, &Prior)| prior.to_z(*theta).clamp(-FARTHEST, FARTHEST);
        let own: Vec<f64> = theta.iter().zip(priors).map(score).collect();
        let scores = if theta == sample.theta { &sample.z } else { &own };
        numbers(&mut text, theta.iter().chain(scores));
        if single {
            let sigma = draw.sigma.map_or_else(String::new, |sigma| sigma.to_string());
            let _ = write!(text, ",{sigma}");
            shape_values(&mut text, draw.shape);
        }
        for group in &with_sigma {
            let _ = write!(text, ",{}", group.sigma_draws[place]);
            shape_values(&mut text, group.shape_draws.get(place).copied());
        }
        let _ = writeln!(text, ",{}", draw.sample);
    }
    text
}

/// The columns of the noise of each observable: sigma, and what else its model has.
fn noise_titles(record: &Record) -> Vec<Vec<String>> {
    let single = record.observables().count() == 1;
    let titles = |(plan, found): (&ObservablePlan, &ObservableRecord)| {
        let label = if single { String::new() } else { format!("_{}", found.label) };
        // That of one observable has been called so from the first version on, whatever its unit.
        let unit = if single { "1" } else { or_one(&plan.unit) };
        let shape = shape_columns(found.noise_shape.as_ref(), plan);
        let all = [("sigma", unit)].into_iter().chain(shape);
        all.map(|(column, unit)| format!("{column}{label} [{unit}]")).collect()
    };
    record.observables().map(titles).collect()
}

/// Columns of what the noise has beside sigma, with their units: a correlation length is in the logarithm of the control
/// variable, or in its unit.
fn shape_columns<'a>(
    shape: Option<&ShapeSummary>,
    observable: &'a ObservablePlan,
) -> Vec<(&'static str, &'a str)> {
    let Some(ShapeSummary::Correlated { scale, .. }) = shape else { return Vec::new() };
    vec![("correlation_length", length_unit(*scale, observable)), ("white_share", "1")]
}

fn shape_values(text: &mut String, shape: Option<NoiseShape>) {
    if let Some(NoiseShape::Correlated { length, white_share }) = shape {
        let _ = write!(text, ",{length},{white_share}");
    }
}

fn header(parameters: &[ParameterSummary]) -> String {
    let named = parameters.iter().map(titled);
    let scores = parameters.iter().map(|summary| format!("z_{} [1]", summary.parameter.name));
    named.chain(scores).collect::<Vec<_>>().join(",")
}

fn titled(summary: &ParameterSummary) -> String {
    let Parameter { name, unit, .. } = &summary.parameter;
    // A unit that a user has written may hold anything.
    format!("{name} [{}]", unit.replace([',', '"', '\n', '\r'], " "))
}

fn numbers<'a>(text: &mut String, values: impl Iterator<Item = &'a f64>) {
    for (place, value) in values.enumerate() {
        if place > 0 {
            text.push(',');
        }
        let _ = write!(text, "{value:e}");
    }
}

/// Reads the samples beside a `posterior.json`.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_samples(record: &Record, folder: &Path) -> Result<SampleColumns, InputError> {
    checksums::read_as(&folder.join("samples.csv"), |name, text| {
        let samples = parse_samples(name, text, record.parameters.len())?;
        complete(name, samples.weights.len(), record.counters.simulations, "samples")?;
        let moved = |concern: &Concern| matches!(concern, Concern::SamplesMoved { .. });
        if samples.moved.is_empty() && record.trust.concerns.iter().any(moved) {
            return Err(InputError::new(name, Mistake::Damaged)
                .found("no columns of moved parameters")
                .expected("one for each parameter, as posterior.json has samples-moved")
                .help("the file is cut off or edited: run the calibration again"));
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
    checksums::read_as(&folder.join(DRAWS), |name, text| {
        let draws = parse_draws(name, text, record.parameters.len())?;
        complete(name, draws.first().map_or(0, Vec::len), record.plan.sampler.draws, "draws")?;
        Ok(draws)
    })
}

/// Reads the noise standard deviation of the draws of a run with one observable; none where they have none.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_sigma(record: &Record, folder: &Path) -> Result<Option<Vec<f64>>, InputError> {
    const COLUMN: &str = "sigma [1]";
    checksums::read_as(&folder.join(DRAWS), |name, text| {
        let there =
            text.lines().next().is_some_and(|head| head.split(',').any(|one| one == COLUMN));
        if !there {
            return Ok(None);
        }
        Ok(columns(name, text, record.parameters.len(), &[COLUMN])?.pop())
    })
}

/// Reads the text of a `samples.csv` of so many parameters; `name` is what errors call it.
///
/// # Errors
///
/// [`InputError`] with line and column for a file that is cut off or not a table of samples.
pub fn parse_samples(
    name: &str,
    text: &str,
    parameters: usize,
) -> Result<SampleColumns, InputError> {
    let [mut parameters, moved] = read_columns(name, text, parameters, &["weight"])?;
    let weights = parameters.pop().unwrap_or_default();
    Ok(SampleColumns { parameters, moved, weights })
}

/// Reads the columns of the parameters from the text of a `draws.csv`; `name` is what errors call it.
///
/// # Errors
///
/// [`InputError`] with line and column for a file that is cut off or not a table of draws.
pub fn parse_draws(name: &str, text: &str, parameters: usize) -> Result<Vec<Vec<f64>>, InputError> {
    columns(name, text, parameters, &[])
}

/// The columns of the parameters, which come first, and more by their names.
fn columns(
    name: &str,
    text: &str,
    parameters: usize,
    last: &[&str],
) -> Result<Vec<Vec<f64>>, InputError> {
    let [found, _] = read_columns(name, text, parameters, last)?;
    Ok(found)
}

/// Same, and those of moved parameters, which come last where there are any.
fn read_columns(
    name: &str,
    text: &str,
    parameters: usize,
    last: &[&str],
) -> Result<[Vec<Vec<f64>>; 2], InputError> {
    let read = || {
        let table = DataTable::of_format(name, text, Format::Csv)?;
        if table.columns().len() < parameters {
            return Err(InputError::new(name, Mistake::MissingColumn)
                .at_line(table.names_line())
                .found(format_args!("{} columns", table.columns().len()))
                .expected(format_args!("one for each of {parameters} parameters")));
        }
        let last: Vec<usize> =
            last.iter().map(|column| table.place(column)).collect::<Result<_, _>>()?;
        let (first, end) = table.columns().split_at(table.columns().len() - parameters);
        let is_moved = |(own, moved): (&String, &String)| moved.strip_prefix(MOVED) == Some(own);
        let there = parameters > 0 && first.len() >= parameters;
        let there = there && first.iter().zip(end).all(is_moved);
        let wanted = parameters + last.len();
        let moved = first.len()..first.len() + if there { parameters } else { 0 };
        let places: Vec<usize> = (0..parameters).chain(last).chain(moved).collect();
        let mut columns = table.columns_at(&places)?;
        let moved = columns.split_off(wanted);
        Ok([columns, moved])
    };
    read().map_err(|error| InputError {
        help: vec!["the file is cut off or edited; run the calibration again".to_owned()],
        ..error
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

#[cfg(test)]
mod tests {
    use smc_calib::{FixedSigma, Noise, Weighted};

    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    const SAMPLES: &str =
        "x [N;m],z_x [1],log_likelihood,weight\n1e0,0.5,,0.25\n2e0,-1,-3.5,0.75\n";

    #[test]
    fn the_parameters_come_first_and_the_weight_by_its_name() {
        let samples = parse_samples("samples.csv", SAMPLES, 1).expect("samples");
        assert_eq!(samples.estimated(), samples.parameters);
        assert_eq!((samples.parameters, samples.weights), (vec![vec![1.0, 2.0]], vec![0.25, 0.75]));
        assert_eq!(parse_draws(DRAWS, SAMPLES, 2).expect("draws")[1], [0.5, -1.0]);
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn samples_and_draws_of_few_simulations_read_back_as_they_were_moved() {
        // The first of some seeds whose weights cannot have the moments that are known.
        let run = |seed: u64| {
            let material = Some(Material::Pa12);
            let options = PairOptions { material, samples: 32, seed, ..PairOptions::default() };
            Calibration::run(&options.plan().expect("a plan"), &Unwatched::default()).expect("runs")
        };
        let moved = |found: &Calibration| !SampleColumns::of(&found.posterior).moved.is_empty();
        let Calibration { record, posterior } =
            (1..=20).map(run).find(moved).expect("a run with moved samples");
        let all = SampleColumns::of(&posterior);
        assert_eq!(parse_samples("samples.csv", &samples_csv(&posterior), 3), Ok(all.clone()));
        let folder = tempfile::tempdir().expect("a folder");
        let text = samples_csv(&posterior).replace(",moved_tau_s", ",tau_s");
        std::fs::write(folder.path().join("samples.csv"), text).expect("written");
        let error = read_samples(&record, folder.path()).expect_err("a column is lost");
        assert_eq!(error.mistake, Mistake::Damaged, "{error}");
        let drawn = parse_draws(DRAWS, &draws_csv(&record, &posterior), 3).expect("draws");
        for ((column, drawn), own) in all.estimated().iter().zip(&drawn).zip(&record.parameters) {
            let of = |theta: &f64| own.coordinate.of(*theta);
            let moved = column.iter().map(of).zip(all.weights.iter().copied());
            let [mean, sd] = [own.in_coordinate.mean, own.in_coordinate.sd];
            let (of_samples, _) = Weighted::new(moved).moments();
            assert!((of_samples - mean).abs() < 1e-9 * sd, "{of_samples} {mean}");
            let (of_draws, _) = Weighted::equal(drawn.iter().map(of).collect()).moments();
            assert!((of_draws - mean).abs() < 0.05 * sd, "{of_draws} {mean} {sd}");
        }
    }

    #[test]
    fn draws_with_their_noise_read_back_to_the_same_bits() {
        let correlated = Noise::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes: Some([4, 4]) };
        let fixed = Noise::Fixed { sigma: FixedSigma::Relative(0.05) };
        for noise in [Noise::default(), correlated, Noise::robust(), fixed] {
            let material = Some(Material::Ps);
            let options = PairOptions { material, samples: 8192, noise, ..PairOptions::default() };
            let mut planned = options.plan().expect("a plan");
            planned.plan.sampler.draws = 100;
            let found = Calibration::run(&planned, &Unwatched::default()).expect("a posterior");
            let folder = tempfile::tempdir().expect("a folder");
            let file = folder.path().join(DRAWS);
            let text = draws_csv(&found.record, &found.posterior);
            std::fs::write(&file, &text).expect("written");
            let read = DrawColumns::read(&found.record, folder.path()).expect("draws");
            assert_eq!(read, DrawColumns::of(&found.posterior, 1));
            let last = found.posterior.draws.last().expect("a draw").sample;
            let edited = text.trim_end().trim_end_matches(&last.to_string());
            std::fs::write(&file, format!("{edited}1e9\n")).expect("written");
            let error = DrawColumns::read(&found.record, folder.path()).expect_err("no sample");
            assert_eq!(error.mistake, Mistake::Damaged, "{error}");
        }
    }

    #[test]
    fn a_table_that_is_cut_off_or_edited_is_refused_with_its_line_and_a_remedy() {
        for (text, mistake, line) in [
            (String::new(), Mistake::Empty, None),
            (SAMPLES.lines().take(1).collect(), Mistake::Empty, Some(1)),
            (SAMPLES[..SAMPLES.len() - 7].to_owned(), Mistake::Syntax, Some(3)),
            (SAMPLES.replace("2e0", "nan"), Mistake::NotFinite, Some(3)),
            (SAMPLES.replace("2e0", "2e"), Mistake::WrongType, Some(3)),
            (SAMPLES.replace("weight", "wait"), Mistake::MissingColumn, Some(1)),
        ] {
            let error = parse_samples("samples.csv", &text, 1).expect_err(&text);
            assert_eq!((error.mistake, error.line), (mistake, line), "{text}: {error}");
            assert!(error.to_string().contains("run the calibration again"), "{error}");
        }
        let few = parse_draws(DRAWS, SAMPLES, 5).expect_err("too few columns");
        assert_eq!((few.mistake, few.line), (Mistake::MissingColumn, Some(1)));
    }
}
