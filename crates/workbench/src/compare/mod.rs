//! Which kinetics the data of a material support, and how strongly.
//!
//! Every kinetics is calibrated on the same data with the same noise and, for each parameter it has, the same
//! prior. Their evidences, errors and leave-one-out predictive densities are put side by side ([`comparison`]),
//! judged ([`verdict`]) and rendered ([`render`]).

pub mod comparison;
mod refit;
pub mod render;
pub mod strength;
mod verdict;

use std::path::PathBuf;

use dem_core::Kinetics;
use smc_calib::{Parameter, Prior, PriorSpec, Problem, leave_one_out};

use crate::args::RunArgs;
use crate::calibration::Calibration;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::material::Material;
use crate::model::NeckGrowth;
use crate::output::{Published, RunFolder};
use crate::plan::Planned;
use crate::prior_file::ParameterName;
use crate::run::{NamedFigures, draw_all, pretty};
use crate::watch::Watch;
use comparison::{Comparison, Entry, PHI_RANGE, Report, ReportPlan, SCHEMA_VERSION};
use figures::{CompareFigure, NamedCurve, Role, Width};

/// The record of a comparison.
pub const RECORD: &str = "compare.json";

/// What to compare.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompareOptions {
    /// Built-in material; all of them where there is no experiment either.
    pub material: Option<Material>,
    /// Own measurements.
    pub experiment: Option<PathBuf>,
    /// Own priors.
    pub prior: Option<PathBuf>,
    /// Whether the final contact ratio is calibrated too.
    pub phi: bool,
    /// Simulations per calibration.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// Whether figures have a logarithmic time axis.
    pub log_time: bool,
}

/// The kinetics of every material or experiment, compared.
pub struct Compared {
    /// What `compare.json` holds.
    pub report: Report,
    figures: NamedFigures,
}

impl Compared {
    /// Makes the plans, calibrates each and compares the kinetics of each experiment.
    ///
    /// # Errors
    ///
    /// As [`Calibration::run`].
    pub fn new(options: &CompareOptions, watch: &dyn Watch) -> Result<Self, Failure> {
        let subjects = match (options.material, &options.experiment) {
            (None, None) => Material::ALL.map(Some).to_vec(),
            (material, _) => vec![material],
        };
        // All plans are made before the first one runs.
        let plans: Vec<Vec<Planned>> = subjects
            .into_iter()
            .map(|of| Kinetics::ALL.into_iter().map(|k| planned(options, of, k)).collect())
            .collect::<Result<_, _>>()?;
        let experiments =
            plans.iter().filter_map(|plans| plans.first()).map(|planned| planned.plan.clone());
        let CompareOptions { samples, seed, phi, .. } = *options;
        let mut report = Report {
            schema_version: SCHEMA_VERSION,
            plan: ReportPlan { samples, seed, phi, experiments: experiments.collect() },
            comparisons: Vec::new(),
        };
        let mut figures = NamedFigures::new();
        for plans in &plans {
            let (comparison, mut figure) = side_by_side(plans, watch)?;
            figure.log_time = options.log_time;
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
fn planned(
    options: &CompareOptions,
    material: Option<Material>,
    kinetics: Kinetics,
) -> Result<Planned, Failure> {
    let mut planned = Planned::from_args(&RunArgs {
        material,
        experiment: options.experiment.clone(),
        prior: options.prior.clone(),
        samples: options.samples,
        seed: options.seed,
        kinetics,
        ..RunArgs::default()
    })?;
    let name = ParameterName::Phi;
    let given = planned.plan.parameters.iter().any(|parameter| parameter.name == name.name());
    if options.phi && !given {
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
        let Calibration { file, posterior } =
            Calibration::run(planned, &mut (), &|| !watch.stop().asked())?;
        let model = NeckGrowth::of(plan)?;
        let problem = Problem {
            simulator: &model,
            parameters: plan.parameters.clone(),
            observations: plan.observations()?,
            noise: plan.noise.clone(),
        };
        let mut left_out = leave_one_out(&problem, &posterior)
            .map_err(RunError::new)?
            .ok_or_else(|| RunError::new("there is no posterior to leave observations out of"))?;
        let refitted = refit::where_unreliable(planned, &model, &posterior, &mut left_out)?;
        figure.title.clone_from(&plan.title);
        figure.time_s.clone_from(&plan.experiment.time_s);
        figure.contact_ratio.clone_from(&plan.experiment.contact_ratio);
        figure.grid_s.clone_from(&file.curves.time_s);
        figure.curves.push(NamedCurve {
            name: plan.kinetics.clone(),
            // Frenkel's curve looks the same in every figure.
            role: match plan.kinetics()? {
                Kinetics::Frenkel => Role::Frenkel,
                _ => Role::Series(place),
            },
            curve: file.curves.map.clone(),
            at_data: file.map.outputs.clone(),
        });
        densities.push(left_out.points.iter().map(|point| point.ln_density).collect::<Vec<_>>());
        entries.push(Entry::new(&file, left_out, refitted));
    }
    comparison::rank(&mut entries, &densities);
    let plan = plans
        .first()
        .map(|planned| &planned.plan)
        .ok_or_else(|| RunError::new("there is nothing to compare"))?;
    let mut comparison = Comparison::new(plan, entries);
    comparison.verdict = verdict::in_words(&comparison);
    comparison.warnings = verdict::warnings(&comparison);
    Ok((comparison, figure))
}
