//! Which kinetics the data of a material support, and how strongly, under which noise.
//!
//! Every kinetics is calibrated on the same data under each of the same noise models and, for each parameter it has, with
//! the same prior. Their evidences, errors and leave-one-out predictive densities are put side by side ([`Comparison`]),
//! judged and rendered ([`render`]). [`explanations`] ranks finished runs of the same measurements, or a plan beside itself with less
//! shared between its radii.

mod comparison;
pub mod explanations;
mod kept;
mod noises;
mod page;
mod refit;
pub mod render;
mod strength;
mod verdict;

use dem_core::Kinetics;
use smc_calib::{Noise, Parameter, Prior, PriorSpec, Problem, leave_one_out};

use crate::calibration::Calibration;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::material::Material;
use crate::output::inputs::Inputs;
use crate::output::page::FILE_NAME;
use crate::output::{Published, RunFolder, pretty};
use crate::pair::model::NeckGrowth;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairOptions, Planned};
use crate::record::Record;
use crate::report::{NamedFigures, TimeScale, draw_all};
use crate::watch::{Watch, Within};
use comparison::{PHI_RANGE, SCHEMA_VERSION};
use figures::{CompareFigure, NamedCurve, Role, Width};

pub(crate) use comparison::weights;
pub use comparison::{Comparison, Entry, NoiseEvidence, Report, ReportPlan};
pub(crate) use kept::read_models;
pub use kept::{KeptModel, KeptModels};
pub use noises::default_noises;

/// The record of a comparison.
pub const RECORD: &str = crate::output::kinds::COMPARISON;

/// The kinetics of every material or experiment, compared.
pub struct Compared {
    /// Contents of `compare.json`.
    pub report: Report,
    /// Draws of the models that matter, one file per experiment.
    pub kept: Vec<KeptModels>,
    figures: NamedFigures,
    inputs: Option<Inputs>,
}

/// The plans of one experiment under one noise model, one per kinetics.
struct Column {
    noise: String,
    plans: Vec<Planned>,
}

impl Compared {
    /// Compares the kinetics under each of `noises` on one experiment, or on every built-in material where `options` name
    /// none. Kinetics and noise of the options are not used; with `phi` the final contact ratio is calibrated too, and with
    /// `scale` is that of the time axes of the figures.
    pub fn new(
        options: &PairOptions,
        noises: &[Noise],
        phi: bool,
        scale: TimeScale,
        watch: &dyn Watch,
    ) -> Result<Self, Failure> {
        let subjects = match (options.material, &options.experiment) {
            (None, None) => Material::ALL.map(Some).to_vec(),
            (material, _) => vec![material],
        };
        let noises = noises::named(noises)?;
        // All plans are made before the first one runs.
        let tables: Vec<Vec<Column>> = subjects
            .into_iter()
            .map(|material| {
                let subject = PairOptions { material, ..options.clone() };
                columns(&subject, &noises, phi)
            })
            .collect::<Result<_, _>>()?;
        let first = || tables.iter().filter_map(|table| table.first()?.plans.first());
        let inputs = Inputs::together(first().map(|planned| planned.inputs.as_ref()));
        let experiments = first().map(|planned| planned.plan.clone());
        let mut report = Report {
            schema_version: SCHEMA_VERSION,
            plan: ReportPlan {
                samples: options.samples,
                seed: options.seed,
                phi,
                noises: noises.iter().map(|(name, _)| name.clone()).collect(),
                experiments: experiments.collect(),
            },
            comparisons: Vec::new(),
        };
        let pieces = tables.iter().flatten().map(|column| column.plans.len()).sum::<usize>();
        watch.begin(pieces as u64, 0, "calibrations");
        let mut figures = NamedFigures::new();
        let mut kept = Vec::new();
        for table in &tables {
            let (comparison, models, mut figure) = side_by_side(table, watch)?;
            figure.axes.log_control = scale.is_log(&figure.control, &figure.value);
            figures.push((format!("compare-{}", comparison.name), Box::new(figure)));
            kept.push(models);
            report.comparisons.push(comparison);
        }
        watch.end();
        Ok(Self { report, kept, figures, inputs })
    }

    /// Writes the folder of the comparison.
    ///
    /// # Errors
    ///
    /// [`Failure::Run`] for a file that cannot be written; nothing has been published then.
    pub fn publish(&self, folder: &RunFolder) -> Result<Published, Failure> {
        let staging = folder.stage()?;
        let write = |name: &str, bytes: &[u8]| staging.write(folder.path(), name, bytes);
        write(RECORD, pretty(&self.report)?.as_bytes())?;
        write("compare.md", render::markdown(&self.report).as_bytes())?;
        write("compare.csv", render::csv(&self.report).as_bytes())?;
        let sums = kept::write(&self.kept, &write)?;
        let drawn = draw_all(&self.figures, Width::Column, &write)?;
        self.inputs.as_ref().map_or(Ok(()), |inputs| inputs.write(&write))?;
        let page = page::page(&self.report, &drawn, self.inputs.as_ref(), &sums);
        write(FILE_NAME, page.html()?.as_bytes())?;
        Ok(staging.publish()?)
    }
}

/// The plans of one experiment, noise by noise.
fn columns(
    subject: &PairOptions,
    noises: &[(String, Noise)],
    phi: bool,
) -> Result<Vec<Column>, InputError> {
    let column = |(name, noise): &(String, Noise)| {
        let subject = PairOptions { noise: noise.clone(), ..subject.clone() };
        let plans = Kinetics::ALL.into_iter().map(|kinetics| planned(&subject, phi, kinetics));
        Ok(Column { noise: name.clone(), plans: plans.collect::<Result<_, _>>()? })
    };
    noises.iter().map(column).collect()
}

/// Warnings on the measurements and the priors, whatever the kinetics and the noise.
fn of_input(table: &[Column]) -> Vec<String> {
    let plans = || table.iter().flat_map(|column| &column.plans);
    let first = plans().next().map_or(&[][..], |planned| &planned.warnings[..]);
    let of_all = |line: &&String| plans().all(|planned| planned.warnings.contains(line));
    first.iter().filter(of_all).cloned().collect()
}

/// The plan of one kinetics.
fn planned(subject: &PairOptions, phi: bool, kinetics: Kinetics) -> Result<Planned, InputError> {
    let mut planned = PairOptions { kinetics, ..subject.clone() }.plan()?;
    let name = ParameterName::Phi;
    let given = planned.plan.parameters.iter().any(|parameter| parameter.name == name.name());
    if phi && !given {
        let [lower, upper] = PHI_RANGE;
        let prior = Prior::new(PriorSpec::Uniform { lower, upper })
            .map_err(|error| InputError::new("--phi", Mistake::OutOfRange).found(error))?;
        planned.plan.parameters.push(Parameter::new(name.name(), name.unit(), prior));
    }
    Ok(planned)
}

/// Calibrates each plan and puts the results side by side, with the draws of the models that matter and the figure of the
/// MAP curves under the noise that the data prefer.
fn side_by_side(
    table: &[Column],
    watch: &dyn Watch,
) -> Result<(Comparison, KeptModels, CompareFigure), Failure> {
    let mut entries = Vec::new();
    let mut figures = Vec::new();
    let mut models = Vec::new();
    let mut noises = Vec::new();
    for Column { noise, plans } in table {
        let mut column = Vec::new();
        let mut figure = CompareFigure::default();
        let mut densities = Vec::new();
        for (place, planned) in plans.iter().enumerate() {
            let (name, kinetics) = (&planned.plan.name, planned.plan.pair()?.0.kinetics.name());
            let within = Within::new(watch, format!("{name}, {kinetics}, {noise} errors"));
            let cell = calibrated(planned, noise, &within)?;
            watch.advance();
            add_curve(&mut figure, &cell.calibration.record, place)?;
            let points = &cell.entry.leave_one_out.points;
            densities.push(points.iter().map(|point| point.ln_density).collect::<Vec<_>>());
            models.push(KeptModel::of(&cell.calibration, noise)?);
            if place == 0 {
                let measured = cell.calibration.record.pair()?.measured;
                noises.push((noise.clone(), measured.noise.clone()));
            }
            column.push(cell.entry);
        }
        comparison::rank(&mut column, &densities);
        entries.append(&mut column);
        figures.push(figure);
    }
    let plan = table
        .first()
        .and_then(|column| column.plans.first())
        .map(|planned| &planned.plan)
        .ok_or_else(|| RunError::new("there is nothing to compare"))?;
    let mut comparison = Comparison::new(plan, noises, entries)?;
    comparison.verdict = verdict::in_words(&comparison);
    comparison.warnings = verdict::warnings(&comparison);
    comparison.warnings.extend(of_input(table));
    let probabilities = comparison.entries.iter().map(|entry| entry.probability);
    let kept = KeptModels::new((&comparison.name, &comparison.title), probabilities, models);
    let preferred = comparison.best().map_or("", |best| best.noise.as_str());
    let place = comparison.noises.iter().position(|noise| noise.name == preferred).unwrap_or(0);
    let mut figure = figures.swap_remove(place);
    figure.title = format!("{}, {preferred} errors", plan.title);
    Ok((comparison, kept, figure))
}

/// One cell of the table.
struct Cell {
    entry: Entry,
    calibration: Calibration,
}

fn calibrated(planned: &Planned, noise: &str, watch: &dyn Watch) -> Result<Cell, Failure> {
    let plan = &planned.plan;
    let calibration = Calibration::run(planned, watch)?;
    let model = NeckGrowth::of(plan)?;
    let pair = calibration.record.pair()?;
    let problem = Problem {
        simulator: &model,
        parameters: plan.parameters.clone(),
        observations: pair.measured.observations()?,
        noise: pair.measured.noise.clone(),
    };
    let mut left_out = leave_one_out(&problem, &calibration.posterior)
        .map_err(RunError::new)?
        .ok_or_else(|| RunError::new("there is no posterior to leave observations out of"))?;
    let refitted =
        refit::where_unreliable(plan, &model, &calibration.posterior, &mut left_out, watch)?;
    let entry = Entry::new(&calibration.record, noise, left_out, refitted)?;
    Ok(Cell { entry, calibration })
}

/// Adds the MAP curve of a calibration to the figure of its noise.
fn add_curve(figure: &mut CompareFigure, record: &Record, place: usize) -> Result<(), Failure> {
    let pair = record.pair()?;
    figure.control.clone_from(&pair.measured.control);
    figure.value.clone_from(&pair.measured.values);
    figure.grid.clone_from(&pair.neck_growth.curves.time_s);
    figure.curves.push(NamedCurve {
        name: pair.plan.kinetics.name().to_owned(),
        // Frenkel's curve looks the same in every figure.
        role: match pair.plan.kinetics {
            Kinetics::Frenkel => Role::Frenkel,
            _ => Role::Series(place),
        },
        curve: pair.neck_growth.curves.map.clone(),
        at_data: pair.found.map.clone(),
    });
    Ok(())
}
