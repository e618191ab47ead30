//! What is reported of a plan: the posterior file, tables and figures, from the samples alone. Nothing is simulated.

use std::fmt::Write as _;

use smc_calib::{BandPoint, Posterior};

use super::plan::{ExternalPlan, ObservablePlan};
use super::posterior_file::{self, Kind, ObservableReport, PlanPosterior, SCHEMA_VERSION};
use super::sample_table;
use super::summary;
use crate::calibration::general_advice;
use crate::checksums;
use crate::error::{Failure, RunError};
use crate::pictures::{SampleColumns, convergence_of, corner_of, recursion_of};
use crate::posterior_file::{FILE_NAME, FitError};
use crate::run::{NamedFigures, WriteFile, draw_all, record};
use crate::tables::{self, quoted};
use figures::{Axes, Band, FitFigure, ResidualsFigure, Width};

/// The posterior file of a plan.
pub(crate) fn of(
    plan: &ExternalPlan,
    warnings: &[String],
    posterior: &Posterior,
) -> Result<PlanPosterior, Failure> {
    let mut first = 0;
    let mut observables = Vec::new();
    for (group, (experiment, observable)) in plan.observables().enumerate() {
        let range = first..first + observable.values.len();
        first = range.end;
        let map =
            posterior.map.outputs.get(range.clone()).map(<[f64]>::to_vec).ok_or_else(|| {
                RunError::new(
                    "the posterior has fewer simulated values than there are observations",
                )
            })?;
        let predictive: Vec<BandPoint> = posterior
            .predictive
            .iter()
            .filter(|band| range.contains(&band.index))
            .map(|band| BandPoint { index: band.index - range.start, ..*band })
            .collect();
        // With very many observations the bands are at some of them only.
        let observed: Vec<f64> =
            predictive.iter().map(|band| observable.values[band.index]).collect();
        let mean: Vec<f64> = predictive.iter().map(|band| band.mean).collect();
        let (sigma, residuals) = match posterior.groups.get(group) {
            Some(group) => (group.sigma, group.residuals.clone()),
            None => (posterior.sigma, posterior.residuals.clone()),
        };
        observables.push(ObservableReport {
            experiment: experiment.name.clone(),
            name: observable.name.clone(),
            label: plan.label(experiment, observable),
            sigma,
            map_error: FitError::of(&observable.values, &map),
            mean_error: FitError::of(&observed, &mean),
            map,
            residuals,
            predictive,
        });
    }
    let mut advice = general_advice(warnings, posterior);
    if plan.design.is_some() {
        advice.push(
            "the parameter sets were given: they are weighted as draws from the prior, which is right only if they are \
             that"
                .to_owned(),
        );
    }
    Ok(PlanPosterior {
        kind: Kind::Plan,
        schema_version: SCHEMA_VERSION,
        plan: plan.clone(),
        is_posterior: posterior.is_posterior,
        parameters: posterior.parameters.clone(),
        correlation: posterior.correlation.clone(),
        correlation_si: posterior.correlation_si.clone(),
        log_evidence: posterior.log_evidence,
        ess: posterior.ess,
        khat: posterior.khat,
        map: posterior.map.clone(),
        observables,
        path: posterior.path.clone(),
        stages: posterior.stages.clone(),
        failures: posterior.failures.clone(),
        stop: posterior.stop,
        warnings: posterior.warnings.clone(),
        advice,
        counters: posterior.counters,
    })
}

/// Writes everything of a report.
pub(crate) fn write_all(
    file: &PlanPosterior,
    posterior: &Posterior,
    write: &WriteFile<'_>,
) -> Result<(), RunError> {
    write("table.md", summary::markdown(file).as_bytes())?;
    write("table.csv", summary::csv(file).as_bytes())?;
    write("fit.csv", fit_csv(file).as_bytes())?;
    let read_again = [
        (FILE_NAME, record(file, posterior_file::parse)?),
        ("samples.csv", tables::samples_csv(posterior)),
        ("draws.csv", draws_csv(file, posterior)),
    ];
    checksums::write_all(&read_again, write)?;
    let sets = posterior.samples.iter().map(|sample| sample.theta.as_slice());
    let samples = sample_table::write(&file.plan.name, &file.plan.parameter_names(), sets);
    write("samples-grainlearning.txt", samples.as_bytes())?;
    draw_all(&figures(file, &tables::sample_columns(posterior), false), Width::Column, write)
}

/// Measured and predicted values, row by row.
fn fit_csv(file: &PlanPosterior) -> String {
    let mut text = String::from(
        "observable,control,measured,map,mean,curve90_lower,curve90_upper,noisy90_lower,noisy90_upper\n",
    );
    for (plan, found) in file.observables() {
        for band in &found.predictive {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{}",
                quoted(&found.label),
                plan.control[band.index],
                plan.values[band.index],
                found.map[band.index],
                band.mean,
                band.curve90[0],
                band.curve90[1],
                band.noisy90[0],
                band.noisy90[1],
            );
        }
    }
    text
}

/// Equally weighted posterior draws: parameters in SI, normal scores, and the noise sigma of each observable that has
/// one.
fn draws_csv(file: &PlanPosterior, posterior: &Posterior) -> String {
    if posterior.groups.is_empty() {
        return tables::draws_csv(posterior);
    }
    let mut text = tables::header(&posterior.parameters);
    let with_sigma: Vec<_> =
        posterior.groups.iter().filter(|group| !group.sigma_draws.is_empty()).collect();
    for group in &with_sigma {
        let unit = file
            .observables()
            .find(|(_, found)| found.label == group.name)
            .map_or("", |(plan, _)| plan.unit.as_str());
        let unit = if unit.is_empty() { "1" } else { unit };
        text.push(',');
        text.push_str(&quoted(&format!("sigma_{} [{unit}]", group.name)));
    }
    text.push_str(",sample\n");
    for (place, draw) in posterior.draws.iter().enumerate() {
        let sample = &posterior.samples[draw.sample];
        tables::numbers(&mut text, sample.theta.iter().chain(&sample.z));
        for group in &with_sigma {
            let _ = write!(text, ",{}", group.sigma_draws[place]);
        }
        let _ = writeln!(text, ",{}", draw.sample);
    }
    text
}

/// The figures by name of file: `corner`, `recursion`, `convergence`, and `fit` and `residuals` for every observable
/// with two points or more.
#[must_use]
pub fn figures(file: &PlanPosterior, samples: &SampleColumns, log_control: bool) -> NamedFigures {
    let title = &file.plan.title;
    let mut figures: NamedFigures = vec![(
        "corner".to_owned(),
        Box::new(corner_of(title, &file.parameters, &file.map.theta, samples, &|_| None)),
    )];
    let only = match &file.observables[..] {
        [_] => file.observables().next().map(|(plan, _)| plan),
        _ => None,
    };
    let control: Vec<f64> = match only {
        Some(_) => file.path.iter().map(|point| point.control).collect(),
        None => file.path.iter().map(|point| point.index as f64 + 1.0).collect(),
    };
    let names = only.map(|plan| axes(plan, log_control));
    let (name, unit) = names.as_ref().map_or(("observation", ""), |axes| {
        (axes.control_name.as_str(), axes.control_unit.as_str())
    });
    let recursion = recursion_of(
        title,
        (name, unit, control, log_control && only.is_some()),
        &file.path,
        &file.parameters,
        &|_| None,
    );
    figures.push(("recursion".to_owned(), Box::new(recursion)));
    let convergence = convergence_of(title, &file.stages, file.plan.sampler.ess_target);
    figures.push(("convergence".to_owned(), Box::new(convergence)));
    let several = file.observables.len() > 1;
    for (plan, found) in file.observables() {
        if plan.values.len() < 2 {
            continue;
        }
        let suffix = if several { format!("-{}", found.label) } else { String::new() };
        let title = if several { format!("{title}: {}", found.label) } else { title.clone() };
        let axes = axes(plan, log_control);
        figures.push((format!("fit{suffix}"), Box::new(fit(&title, plan, found, axes.clone()))));
        figures.push((
            format!("residuals{suffix}"),
            Box::new(ResidualsFigure {
                title,
                control: plan.control.clone(),
                residual: found.residuals.values.clone(),
                sigma: found.sigma.map_or(found.map_error.rmse, |sigma| sigma.median),
                axes,
            }),
        ));
    }
    figures
}

fn axes(plan: &ObservablePlan, log_control: bool) -> Axes {
    // `time_s` in seconds is the time: the unit stands behind it anyway.
    let words = |name: &str, unit: &str| {
        let suffix = format!("_{}", unit.to_lowercase());
        name.strip_suffix(&suffix).filter(|rest| !rest.is_empty()).unwrap_or(name).replace('_', " ")
    };
    let from_zero = plan.values.iter().chain(&plan.control).all(|value| *value >= 0.0);
    Axes {
        control_name: plan
            .control_column
            .as_deref()
            .map_or("row".to_owned(), |name| words(name, &plan.control_unit)),
        control_unit: plan.control_unit.clone(),
        value_name: words(&plan.name, &plan.unit),
        value_unit: plan.unit.clone(),
        from_zero,
        log_control,
    }
}

fn fit(title: &str, plan: &ObservablePlan, found: &ObservableReport, axes: Axes) -> FitFigure {
    let bands = &found.predictive;
    let band = |pick: fn(&BandPoint) -> [f64; 2]| Band {
        lower: bands.iter().map(|point| pick(point)[0]).collect(),
        upper: bands.iter().map(|point| pick(point)[1]).collect(),
    };
    FitFigure {
        title: title.to_owned(),
        control: plan.control.clone(),
        value: plan.values.clone(),
        grid: bands.iter().map(|point| plan.control[point.index]).collect(),
        mean: bands.iter().map(|point| point.mean).collect(),
        band50: band(|point| point.curve50),
        band90: band(|point| point.curve90),
        predictive90: band(|point| point.noisy90),
        map: bands.iter().map(|point| found.map[point.index]).collect(),
        axes,
        ..FitFigure::default()
    }
}
