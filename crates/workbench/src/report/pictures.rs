//! The figures of a run, made from its record and samples alone: nothing is simulated here.

use figures::{
    Axes, Band, ConvergenceFigure, ConvergenceStage, CornerFigure, CornerParameter, FailuresFigure,
    FitFigure, Knee, RecursionFigure, RecursionParameter, ResidualsFigure, TogetherCurve,
    TogetherFigure,
};
use smc_calib::{BandPoint, Coordinate, Moments, Parameter, PathParameter};

use super::drawing::{NamedFigures, band};
use super::notation::{TimeScale, symbol};
use super::points::PointColumns;
use super::population;
use super::summary::{neck_growth, paper_place};
use crate::plan::ObservablePlan;
use crate::record::{NeckGrowthRecord, ObservableRecord, Record};

/// Most parameters that a corner plot, and a figure of the recursion, has room for.
const MOST_IN_CORNER: usize = 5;
const MOST_IN_RECURSION: usize = 8;
/// Most experiments that one figure tells apart.
const MOST_TOGETHER: usize = 8;
/// Number of points at which the corner plot draws a prior's density.
const PRIOR_POINTS: usize = 161;

/// The figures by name of file: `corner`, `recursion`, `convergence`, `failures` where simulations failed, `fit-together` of several pairs, and for every
/// observable with two points or more `fit` and `residuals`, with its label behind where there are several.
pub fn pictures(record: &Record, points: &PointColumns, scale: TimeScale) -> NamedFigures {
    if let Some(population) = &record.population {
        let mut figures: NamedFigures = vec![
            ("corner".to_owned(), Box::new(corner(record, points))),
            ("convergence".to_owned(), Box::new(convergence(record))),
        ];
        figures.extend(population::figures(record, population, points, scale));
        return figures;
    }
    let mut figures: NamedFigures = vec![
        ("corner".to_owned(), Box::new(corner(record, points))),
        ("recursion".to_owned(), Box::new(recursion(record, scale))),
        ("convergence".to_owned(), Box::new(convergence(record))),
    ];
    if let Some(failures) = failures(record) {
        figures.push(("failures".to_owned(), Box::new(failures)));
    }
    if let Some(together) = together(record, scale) {
        figures.push(("fit-together".to_owned(), Box::new(together)));
    }
    let several = record.plan.observables().count() > 1;
    let found = record.experiments.iter().flat_map(|experiment| {
        let neck = experiment.neck_growth.as_ref();
        experiment.observables.iter().map(move |observable| (observable, neck))
    });
    for ((_, plan), (found, neck)) in record.plan.observables().zip(found) {
        if plan.values.len() < 2 {
            continue;
        }
        let (mut title, mut suffix) = (record.plan.title.clone(), String::new());
        if several {
            // Where there is no room for all of it the end of the plan's title is cut.
            title = format!("{}: {title}", found.label);
            suffix = format!("-{}", found.label);
        }
        let residuals = ResidualsFigure {
            title: title.clone(),
            control: plan.control.clone(),
            residual: found.residuals.values.clone(),
            sigma: found.sigma.map_or(found.map_error.rmse, |sigma| sigma.median),
            axes: axes(plan, scale),
        };
        let fit = match neck {
            Some(neck) => fit_of_pair(title, plan, neck, scale),
            None => fit_at_data(title, plan, found, scale),
        };
        figures.push((format!("fit{suffix}"), Box::new(fit)));
        figures.push((format!("residuals{suffix}"), Box::new(residuals)));
    }
    figures
}

/// All pairs of a run with several, each with its 90 % band; none where there are more than can be told apart.
fn together(record: &Record, scale: TimeScale) -> Option<TogetherFigure> {
    let pairs = record.experiments.iter().zip(&record.plan.experiments);
    let pairs = pairs.filter_map(|(found, plan)| {
        Some((found, plan.observables.first()?, found.neck_growth.as_ref()?))
    });
    let mut log_control = false;
    let curves: Vec<TogetherCurve> = pairs
        .map(|(found, plan, neck)| {
            log_control |= scale.is_log(&plan.control, &plan.values);
            let curves = &neck.curves;
            let [lower, upper] = curves.noisy90.as_ref().unwrap_or(&curves.curve90).clone();
            TogetherCurve {
                name: found.name.clone(),
                control: plan.control.clone(),
                value: plan.values.clone(),
                grid: curves.time_s.clone(),
                mean: curves.mean.clone(),
                band90: Band { lower, upper },
            }
        })
        .collect();
    let axes = Axes { log_control, ..Axes::default() };
    let title = record.plan.title.clone();
    (2..=MOST_TOGETHER).contains(&curves.len()).then_some(TogetherFigure { title, curves, axes })
}

/// Places of the parameters that a figure has room for, in their order: all, or those that the data say most of.
fn shown(record: &Record, most: usize) -> Vec<usize> {
    let gain = |place: &usize| record.parameters[*place].information_gain_bits;
    let mut places: Vec<usize> = (0..record.parameters.len()).collect();
    if places.len() > most {
        places.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        places.truncate(most);
        places.sort_unstable();
    }
    places
}

/// Names of the parameters that the corner plot has no room for: those that the data say least of.
pub(super) fn not_in_corner(record: &Record) -> Vec<&str> {
    let shown = shown(record, MOST_IN_CORNER);
    let named = record.parameters.iter().map(|summary| summary.parameter.name.as_str());
    named.enumerate().filter(|(place, _)| !shown.contains(place)).map(|(_, name)| name).collect()
}

/// Where simulations failed; none where none did.
fn failures(record: &Record) -> Option<FailuresFigure> {
    let place = record.failing.as_ref()?.place.as_ref()?;
    let summary = record.parameters.iter().find(|p| p.parameter.name == place.parameter)?;
    let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
    let counts = |of: &[usize]| of.iter().map(|count| *count as f64).collect();
    Some(FailuresFigure {
        title: record.plan.title.clone(),
        symbol,
        unit,
        log10: summary.coordinate == Coordinate::Log10,
        edges: place.edges.iter().map(|edge| summary.coordinate.of(*edge)).collect(),
        finished: counts(&place.finished),
        failed: counts(&place.failed),
        posterior: place.posterior.clone(),
    })
}

/// The fit of a run with one pair; none for other runs.
pub fn fit(record: &Record, scale: TimeScale) -> Option<FitFigure> {
    let pair = record.pair().ok()?;
    Some(fit_of_pair(record.plan.title.clone(), pair.measured, pair.neck_growth, scale))
}

/// Measurements, posterior bands, MAP, the paper's and Frenkel's curves on a fine grid.
fn fit_of_pair(
    title: String,
    plan: &ObservablePlan,
    neck: &NeckGrowthRecord,
    scale: TimeScale,
) -> FitFigure {
    let curves = &neck.curves;
    FitFigure {
        title,
        control: plan.control.clone(),
        value: plan.values.clone(),
        grid: curves.time_s.clone(),
        mean: curves.mean.clone(),
        band50: band(&curves.curve50),
        band90: band(&curves.curve90),
        predictive90: curves.noisy90.as_ref().map(band).unwrap_or_default(),
        map: curves.map.clone(),
        paper: curves.paper.clone().unwrap_or_default(),
        frenkel: curves.frenkel.clone().unwrap_or_default(),
        knee: neck.knee.as_ref().map(|knee| Knee {
            time_s: knee.time_s.median,
            ratio: knee.contact_ratio.median,
            lower: knee.contact_ratio.eti95[0],
            upper: knee.contact_ratio.eti95[1],
        }),
        paper_knee: neck.knee.as_ref().and_then(|knee| knee.contact_ratio.paper),
        axes: axes(plan, scale),
    }
}

/// Measurements, posterior bands and MAP at the observations.
fn fit_at_data(
    title: String,
    plan: &ObservablePlan,
    found: &ObservableRecord,
    scale: TimeScale,
) -> FitFigure {
    let bands = &found.predictive;
    let band = |pick: fn(&BandPoint) -> [f64; 2]| Band {
        lower: bands.iter().map(|point| pick(point)[0]).collect(),
        upper: bands.iter().map(|point| pick(point)[1]).collect(),
    };
    FitFigure {
        title,
        control: plan.control.clone(),
        value: plan.values.clone(),
        grid: bands.iter().map(|point| plan.control[point.index]).collect(),
        mean: bands.iter().map(|point| point.mean).collect(),
        band50: band(|point| point.curve50),
        band90: band(|point| point.curve90),
        predictive90: band(|point| point.noisy90),
        map: bands.iter().map(|point| found.map[point.index]).collect(),
        axes: axes(plan, scale),
        ..FitFigure::default()
    }
}

/// Names and units of the axes of an observable.
fn axes(plan: &ObservablePlan, scale: TimeScale) -> Axes {
    let log_control = scale.is_log(&plan.control, &plan.values);
    if plan.result.is_none() {
        return Axes { log_control, ..Axes::default() };
    }
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

/// Marginals and pairs of the parameters, of what the summaries are of.
fn corner(record: &Record, points: &PointColumns) -> CornerFigure {
    let parameters = shown(record, MOST_IN_CORNER)
        .into_iter()
        .filter_map(|place| Some((place, &record.parameters[place], points.parameters.get(place)?)))
        .map(|(place, summary, column)| {
            let coordinate = summary.coordinate;
            let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
            let draws: Vec<f64> = column.iter().map(|&value| coordinate.of(value)).collect();
            let Moments { median, eti50, eti95, .. } = summary.in_coordinate;
            CornerParameter {
                quantiles: Some([eti95.lower, eti50.lower, median, eti50.upper, eti95.upper]),
                symbol,
                unit,
                log10: coordinate == Coordinate::Log10,
                prior: prior_density(&summary.parameter, &draws, &points.weights),
                draws,
                paper: paper(record, &summary.parameter.name).map(|value| coordinate.of(value)),
                map: Some(coordinate.of(record.map.theta[place])),
            }
        })
        .collect();
    CornerFigure { title: record.plan.title.clone(), parameters, weights: points.weights.clone() }
}

/// The paper's value \[SI\] of a parameter, where it has one.
fn paper(record: &Record, name: &str) -> Option<f64> {
    let paper = neck_growth(record)?.paper.as_ref()?;
    paper_place(name).map(|place| paper.si[place])
}

/// The prior's density over (and a little beyond) the samples that carry weight.
fn prior_density(parameter: &Parameter, draws: &[f64], weights: &[f64]) -> Vec<(f64, f64)> {
    let heaviest = weights.iter().copied().fold(0.0, f64::max);
    let carried = draws
        .iter()
        .zip(weights)
        .filter(|(draw, weight)| draw.is_finite() && **weight > 1e-4 * heaviest)
        .map(|(draw, _)| *draw);
    let (lower, upper) =
        carried.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), draw| (l.min(draw), u.max(draw)));
    if lower >= upper {
        return Vec::new();
    }
    let coordinate = parameter.prior.coordinate();
    let margin = 0.5 * (upper - lower);
    let (lower, upper) = (lower - margin, upper + margin);
    let (first, last) = parameter.prior.support();
    let ends = [first, last].map(|end| coordinate.of(end));
    // A density that jumps at the end of its support is drawn as a jump.
    let lower = if ends[0].is_finite() { lower.max(ends[0]) } else { lower };
    let upper = if ends[1].is_finite() { upper.min(ends[1]) } else { upper };
    let mut points: Vec<(f64, f64)> = (0..PRIOR_POINTS)
        .map(|k| lower + (upper - lower) * k as f64 / (PRIOR_POINTS - 1) as f64)
        .map(|x| (x, parameter.prior.ln_density_in_coordinate(coordinate.theta(x)).exp()))
        .filter(|(_, density)| density.is_finite())
        .collect();
    if lower == ends[0] {
        points.insert(0, (lower, 0.0));
    }
    if upper == ends[1] {
        points.push((upper, 0.0));
    }
    points
}

/// Knowledge of the parameters after each observation. With several observables the observations are numbered.
fn recursion(record: &Record, scale: TimeScale) -> RecursionFigure {
    let path = &record.path;
    let mut observables = record.plan.observables().map(|(_, observable)| observable);
    let only = observables.next().filter(|_| observables.next().is_none());
    let (control_name, control_unit, control, log_control) = match only {
        Some(plan) => {
            let axes = axes(plan, scale);
            let control = path.iter().map(|point| point.control).collect();
            (axes.control_name, axes.control_unit, control, axes.log_control)
        }
        None => {
            let number = path.iter().map(|point| point.index as f64 + 1.0).collect();
            ("observation".to_owned(), String::new(), number, false)
        }
    };
    let parameters = shown(record, MOST_IN_RECURSION)
        .into_iter()
        .map(|place| (place, &record.parameters[place]))
        .map(|(place, summary)| {
            let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
            let of = |pick: fn(&PathParameter) -> f64| -> Vec<f64> {
                path.iter().map(|point| pick(&point.parameters[place])).collect()
            };
            RecursionParameter {
                symbol,
                unit,
                log10: summary.coordinate == Coordinate::Log10,
                median: of(|p| p.median),
                interval50: Band { lower: of(|p| p.eti50[0]), upper: of(|p| p.eti50[1]) },
                interval90: Band { lower: of(|p| p.eti90[0]), upper: of(|p| p.eti90[1]) },
                paper: paper(record, &summary.parameter.name)
                    .map(|value| summary.coordinate.of(value)),
            }
        })
        .collect();
    RecursionFigure {
        title: record.plan.title.clone(),
        control_name,
        control_unit,
        control,
        log_control,
        parameters,
        ess: path.iter().map(|point| point.ess).collect(),
    }
}

/// How the sampler got there.
fn convergence(record: &Record) -> ConvergenceFigure {
    ConvergenceFigure {
        title: record.plan.title.clone(),
        stages: record
            .stages
            .iter()
            .map(|stage| ConvergenceStage {
                simulations: stage.total as f64,
                beta: stage.beta,
                ess: stage.ess,
                log_evidence: stage.log_evidence,
                log_evidence_error: stage.log_evidence_se,
                components: stage.proposal.components.len() as f64,
                k_hat: stage.khat,
            })
            .collect(),
        k_hat_limit: record.trust.khat_limit,
        k_hat_of_result: Some(record.khat),
        ess_target: record.plan.sampler.ess_target,
    }
}

#[cfg(test)]
mod tests {
    use figures::{Width, broken_rules};

    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    #[test]
    fn the_figures_of_real_runs_keep_the_rules_of_figures() {
        for material in Material::ALL {
            let options =
                PairOptions { material: Some(material), samples: 8192, ..PairOptions::default() };
            let planned = options.plan().expect("a plan");
            let found = Calibration::run(&planned, &Unwatched::default()).expect("a run");
            let points = PointColumns::of(&found.posterior);
            for scale in [TimeScale::ByData, TimeScale::Linear, TimeScale::Log] {
                for (name, figure) in pictures(&found.record, &points, scale) {
                    for width in [Width::Column, Width::Full] {
                        let broken = broken_rules(figure.as_ref(), width).expect("drawn");
                        assert!(broken.is_empty(), "{material:?}, {name}, {scale:?}: {broken:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn only_polystyrene_grows_so_early_that_its_axis_of_time_is_logarithmic() {
        for material in Material::ALL {
            let plan = PairOptions { material: Some(material), ..PairOptions::default() };
            let plan = plan.plan().expect("a plan").plan;
            let (_, measured) = plan.pair().expect("a pair");
            let early = TimeScale::ByData.is_log(&measured.control, &measured.values);
            assert_eq!(early, material == Material::Ps, "{material:?}");
        }
    }
}
