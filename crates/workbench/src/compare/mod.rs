//! Which kinetics the data of a material support, and how strongly.
//!
//! Every kinetics is calibrated on the same data with the same noise and, for each parameter it has, the same
//! prior. Their evidences, errors and leave-one-out predictive densities are put side by side ([`Comparison`]),
//! judged and rendered ([`render`]).

mod comparison;
mod refit;
pub mod render;
mod strength;
mod verdict;

use dem_core::Kinetics;
use smc_calib::{Parameter, Prior, PriorSpec, Problem, leave_one_out};

use crate::calibration::Calibration;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::material::Material;
use crate::output::{Published, RunFolder, pretty};
use crate::pair::model::NeckGrowth;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairOptions, Planned};
use crate::report::{NamedFigures, draw_all};
use crate::watch::Watch;
use comparison::{PHI_RANGE, SCHEMA_VERSION};
use figures::{CompareFigure, NamedCurve, Role, Width};

pub use comparison::{Comparison, Entry, Report, ReportPlan};

/// The record of a comparison.
pub const RECORD: &str = "compare.json";

/// The kinetics of every material or experiment, compared.
pub struct Compared {
    /// Contents of `compare.json`.
    pub report: Report,
    figures: NamedFigures,
}

impl Compared {
    /// Compares the kinetics on one experiment, or on every built-in material where `options` name none. The kinetics of
    /// the options are not used; with `phi` the final contact ratio is calibrated too, and with `log_time` the figures
    /// have a logarithmic time axis.
    pub fn new(
        options: &PairOptions,
        phi: bool,
        log_time: bool,
        watch: &dyn Watch,
    ) -> Result<Self, Failure> {
        let subjects = match (options.material, &options.experiment) {
            (None, None) => Material::ALL.map(Some).to_vec(),
            (material, _) => vec![material],
        };
        // All plans are made before the first one runs.
        let plans: Vec<Vec<Planned>> = subjects
            .into_iter()
            .map(|material| {
                let subject = PairOptions { material, ..options.clone() };
                Kinetics::ALL.into_iter().map(|kinetics| planned(&subject, phi, kinetics)).collect()
            })
            .collect::<Result<_, _>>()?;
        let experiments =
            plans.iter().filter_map(|plans| plans.first()).map(|planned| planned.plan.clone());
        let mut report = Report {
            schema_version: SCHEMA_VERSION,
            plan: ReportPlan {
                samples: options.samples,
                seed: options.seed,
                phi,
                experiments: experiments.collect(),
            },
            comparisons: Vec::new(),
        };
        let mut figures = NamedFigures::new();
        for plans in &plans {
            let (comparison, mut figure) = side_by_side(plans, watch)?;
            figure.axes.log_control = log_time;
            figures.push((format!("compare-{}", comparison.name), Box::new(figure)));
            report.comparisons.push(comparison);
        }
        Ok(Self { report, figures })
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
        draw_all(&self.figures, Width::Column, &write)?;
        Ok(staging.publish()?)
    }
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

/// Calibrates each plan and puts the results side by side, with the figure of their MAP curves.
fn side_by_side(
    plans: &[Planned],
    watch: &dyn Watch,
) -> Result<(Comparison, CompareFigure), Failure> {
    let mut entries = Vec::new();
    let mut figure = CompareFigure::default();
    let mut densities = Vec::new();
    for (place, planned) in plans.iter().enumerate() {
        let plan = &planned.plan;
        let Calibration { record, posterior } = Calibration::run(planned, watch)?;
        let model = NeckGrowth::of(plan)?;
        let pair = record.pair()?;
        let problem = Problem {
            simulator: &model,
            parameters: plan.parameters.clone(),
            observations: pair.measured.observations()?,
            noise: pair.measured.noise.clone(),
        };
        let mut left_out = leave_one_out(&problem, &posterior)
            .map_err(RunError::new)?
            .ok_or_else(|| RunError::new("there is no posterior to leave observations out of"))?;
        let refitted = refit::where_unreliable(plan, &model, &posterior, &mut left_out)?;
        figure.title.clone_from(&plan.title);
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
        densities.push(left_out.points.iter().map(|point| point.ln_density).collect::<Vec<_>>());
        entries.push(Entry::new(&record, left_out, refitted)?);
    }
    comparison::rank(&mut entries, &densities);
    let plan = plans
        .first()
        .map(|planned| &planned.plan)
        .ok_or_else(|| RunError::new("there is nothing to compare"))?;
    let mut comparison = Comparison::new(plan, entries)?;
    comparison.verdict = verdict::in_words(&comparison);
    comparison.warnings = verdict::warnings(&comparison);
    Ok((comparison, figure))
}
