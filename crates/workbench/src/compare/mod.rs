//! `calibrate compare`: which kinetics the data of a material support, and how strongly.
//!
//! Every kinetics is calibrated on the same data with the same noise and, for each parameter it has, the same
//! prior. Their evidences, errors and leave-one-out predictive densities are put side by side ([`report`]),
//! judged ([`verdict`]) and rendered ([`render`]).

mod refit;
pub mod render;
pub mod report;
pub mod verdict;

use std::io::Write as _;

use dem_core::Kinetics;
use smc_calib::{Parameter, Prior, PriorSpec, Problem, leave_one_out};

use crate::args::{CompareArgs, RunArgs};
use crate::calibration::Calibration;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::material::Material;
use crate::model::NeckGrowth;
use crate::output::RunFolder;
use crate::plan::Planned;
use crate::prior_file::ParameterName;
use crate::run::{NamedFigures, announce, draw_all, pool, pretty};
use figures::{CompareFigure, NamedCurve, Role, Width};
use report::{Comparison, Entry, Report};

/// The record of a comparison.
pub const RECORD: &str = "compare.json";

/// Range of the final contact ratio where it is calibrated: from no flattening at all to a little beyond full
/// coalescence, the same for every material and kinetics.
pub const PHI_RANGE: [f64; 2] = [1.0, 1.35];

/// Compares the kinetics.
///
/// # Errors
///
/// [`Failure`] with the reason; nothing has been written then.
pub fn run(args: &CompareArgs) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, RECORD)?;
    let plans: Vec<Vec<Planned>> = subjects(args)
        .iter()
        .map(|subject| Kinetics::ALL.iter().map(|k| planned(subject, *k, args.phi)).collect())
        .collect::<Result<_, _>>()?;
    let pool = pool(args.threads)?;
    let mut comparisons = Vec::new();
    let mut pictures = NamedFigures::new();
    for plans in &plans {
        let (comparison, mut figure) = pool.install(|| compare(plans))?;
        figure.axes.log_control = args.log_time;
        if !args.quiet && !args.json {
            write!(std::io::stdout().lock(), "{}", render::terminal(&comparison))?;
        }
        pictures.push((format!("compare-{}", comparison.name), Box::new(figure)));
        comparisons.push(comparison);
    }
    let report = Report::new(args, comparisons);
    let staging = folder.stage()?;
    let write = |name: &str, bytes: &[u8]| staging.write(&args.out, name, bytes);
    write(RECORD, pretty(&report)?.as_bytes())?;
    write("compare.md", render::markdown(&report).as_bytes())?;
    write("compare.csv", render::csv(&report).as_bytes())?;
    pool.install(|| draw_all(&pictures, Width::Column, &write))?;
    let published = staging.publish()?;
    announce(&published, &args.out, args.quiet);
    if args.json {
        write!(std::io::stdout().lock(), "{}", pretty(&report)?)?;
    } else if !args.quiet {
        writeln!(
            std::io::stdout().lock(),
            "files: {}/ (compare.md, compare.csv, compare.json, compare-*.png, .svg)",
            args.out.display()
        )?;
    }
    Ok(())
}

/// What is compared on: one experiment, or every built-in material.
fn subjects(args: &CompareArgs) -> Vec<RunArgs> {
    let of = |material: Option<Material>| RunArgs {
        material,
        experiment: args.experiment.clone(),
        prior: args.prior.clone(),
        samples: args.samples,
        seed: args.seed,
        ..RunArgs::default()
    };
    match (args.material, &args.experiment) {
        (None, None) => Material::ALL.map(|material| of(Some(material))).into(),
        (material, _) => vec![of(material)],
    }
}

fn planned(subject: &RunArgs, kinetics: Kinetics, with_phi: bool) -> Result<Planned, Failure> {
    let mut planned = Planned::from_args(&RunArgs { kinetics, ..subject.clone() })?;
    let name = ParameterName::Phi;
    let given = planned.plan.parameters.iter().any(|parameter| parameter.name == name.name());
    if with_phi && !given {
        let [lower, upper] = PHI_RANGE;
        let prior = Prior::new(PriorSpec::Uniform { lower, upper })
            .map_err(|error| InputError::new("--phi", Mistake::OutOfRange).found(error))?;
        planned.plan.parameters.push(Parameter::new(name.name(), name.unit(), prior));
    }
    Ok(planned)
}

/// Calibrates each plan and puts the results side by side, with the figure of their MAP curves.
///
/// # Errors
///
/// As [`Calibration::run`].
pub fn compare(plans: &[Planned]) -> Result<(Comparison, CompareFigure), Failure> {
    let mut entries = Vec::new();
    let mut figure = CompareFigure::default();
    let mut densities = Vec::new();
    for (place, planned) in plans.iter().enumerate() {
        let plan = &planned.plan;
        let Calibration { file, posterior } = Calibration::run(planned, &mut (), &|| true)?;
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
        figure.control.clone_from(&plan.experiment.time_s);
        figure.value.clone_from(&plan.experiment.contact_ratio);
        figure.grid.clone_from(&file.curves.time_s);
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
    report::rank(&mut entries, &densities);
    let plan = plans
        .first()
        .map(|planned| &planned.plan)
        .ok_or_else(|| RunError::new("there is nothing to compare"))?;
    Ok((Comparison::new(plan, entries), figure))
}
