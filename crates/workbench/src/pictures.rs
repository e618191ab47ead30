//! The figures of a calibration, made from its files alone: nothing is simulated here.

use smc_calib::{Coordinate, MixtureRecord, Parameter, ParameterSummary, PathPoint, StageRecord};

use crate::posterior_file::PosteriorFile;
use crate::prior_file::ParameterName;
use figures::{
    Axes, Band, ConvergenceFigure, ConvergenceStage, CornerFigure, CornerParameter, Figure,
    FitFigure, Knee, RecursionFigure, RecursionParameter, ResidualsFigure,
};

/// The weighted samples of a run, as `samples.csv` holds them: what the corner plot needs beside
/// `posterior.json`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SampleColumns {
    /// One column per parameter \[SI\].
    pub parameters: Vec<Vec<f64>>,
    /// Normalised weights.
    pub weights: Vec<f64>,
}

/// k-hat above which importance weights are not to be trusted (Vehtari et al. 2024).
pub const KHAT_LIMIT: f64 = 0.7;

/// How many points of the prior's density the corner plot draws.
const PRIOR_POINTS: usize = 161;

/// The figures by file name.
#[must_use]
pub fn all(
    file: &PosteriorFile,
    samples: &SampleColumns,
    log_time: bool,
) -> Vec<(String, Box<dyn Figure + Send + Sync>)> {
    vec![
        ("fit".to_owned(), Box::new(fit(file, log_time))),
        ("corner".to_owned(), Box::new(corner(file, samples))),
        ("recursion".to_owned(), Box::new(recursion(file, log_time))),
        ("convergence".to_owned(), Box::new(convergence(file))),
        ("residuals".to_owned(), Box::new(residuals(file, log_time))),
    ]
}

/// Measurements, posterior bands, MAP, the paper's and Frenkel's curves.
#[must_use]
pub fn fit(file: &PosteriorFile, log_time: bool) -> FitFigure {
    let curves = &file.curves;
    let band = |[lower, upper]: &[Vec<f64>; 2]| Band { lower: lower.clone(), upper: upper.clone() };
    FitFigure {
        title: file.plan.title.clone(),
        control: file.plan.experiment.time_s.clone(),
        value: file.plan.experiment.contact_ratio.clone(),
        grid: curves.time_s.clone(),
        mean: curves.mean.clone(),
        band50: band(&curves.curve50),
        band90: band(&curves.curve90),
        predictive90: curves.noisy90.as_ref().map(band).unwrap_or_default(),
        map: curves.map.clone(),
        paper: curves.paper.clone().unwrap_or_default(),
        frenkel: curves.frenkel.clone().unwrap_or_default(),
        knee: file.knee.as_ref().map(|knee| Knee {
            time_s: knee.time_s.median,
            ratio: knee.contact_ratio.median,
            lower: knee.contact_ratio.eti95[0],
            upper: knee.contact_ratio.eti95[1],
        }),
        paper_knee: file.knee.as_ref().and_then(|knee| knee.contact_ratio.paper),
        axes: Axes { log_control: log_time, ..Axes::default() },
    }
}

/// Marginals and pairs of the parameters.
#[must_use]
pub fn corner(file: &PosteriorFile, samples: &SampleColumns) -> CornerFigure {
    corner_of(&file.plan.title, &file.parameters, &file.map.theta, samples, &|name| {
        let paper = file.paper.as_ref()?;
        paper_place(name).map(|place| paper.si[place])
    })
}

/// Marginals and pairs of any parameters; `paper` gives a value \[SI\] to mark, by name.
pub(crate) fn corner_of(
    title: &str,
    summaries: &[ParameterSummary],
    map: &[f64],
    samples: &SampleColumns,
    paper: &dyn Fn(&str) -> Option<f64>,
) -> CornerFigure {
    let parameters = summaries
        .iter()
        .zip(&samples.parameters)
        .enumerate()
        .map(|(place, (summary, column))| {
            let coordinate = summary.coordinate;
            let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
            let draws: Vec<f64> = column.iter().map(|&value| coordinate.of(value)).collect();
            CornerParameter {
                symbol,
                unit,
                log10: coordinate == Coordinate::Log10,
                prior: prior_density(&summary.parameter, &draws, &samples.weights),
                draws,
                paper: paper(&summary.parameter.name).map(|value| coordinate.of(value)),
                map: Some(coordinate.of(map[place])),
            }
        })
        .collect();
    CornerFigure { title: title.to_owned(), parameters, weights: samples.weights.clone() }
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

/// What each observation taught.
#[must_use]
pub fn recursion(file: &PosteriorFile, log_time: bool) -> RecursionFigure {
    let control = file.path.iter().map(|point| point.control).collect();
    let axis = ("time t", "s", control, log_time);
    recursion_of(&file.plan.title, axis, &file.path, &file.parameters, &|name| {
        let paper = file.paper.as_ref()?;
        paper_place(name).map(|place| paper.si[place])
    })
}

/// What each observation taught of any parameters. The axis is its name, unit, values, and whether it is logarithmic.
pub(crate) fn recursion_of(
    title: &str,
    (control_name, control_unit, control, log_control): (&str, &str, Vec<f64>, bool),
    path: &[PathPoint],
    summaries: &[ParameterSummary],
    paper: &dyn Fn(&str) -> Option<f64>,
) -> RecursionFigure {
    let parameters = summaries
        .iter()
        .enumerate()
        .map(|(place, summary)| {
            let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
            let of = |pick: fn(&smc_calib::PathParameter) -> f64| -> Vec<f64> {
                path.iter().map(|point| pick(&point.parameters[place])).collect()
            };
            RecursionParameter {
                symbol,
                unit,
                log10: summary.coordinate == Coordinate::Log10,
                median: of(|p| p.median),
                interval50: Band { lower: of(|p| p.eti50[0]), upper: of(|p| p.eti50[1]) },
                interval90: Band { lower: of(|p| p.eti90[0]), upper: of(|p| p.eti90[1]) },
                paper: paper(&summary.parameter.name).map(|value| summary.coordinate.of(value)),
            }
        })
        .collect();
    RecursionFigure {
        title: title.to_owned(),
        control_name: control_name.to_owned(),
        control_unit: control_unit.to_owned(),
        control,
        log_control,
        parameters,
        ess: path.iter().map(|point| point.ess).collect(),
    }
}

/// How the sampler got there.
#[must_use]
pub fn convergence(file: &PosteriorFile) -> ConvergenceFigure {
    convergence_of(&file.plan.title, &file.stages, file.plan.sampler.ess_target)
}

/// How any sampler got there.
pub(crate) fn convergence_of(
    title: &str,
    stages: &[StageRecord],
    ess_target: Option<f64>,
) -> ConvergenceFigure {
    let components = |proposal: &MixtureRecord| proposal.components.len() as f64;
    ConvergenceFigure {
        title: title.to_owned(),
        stages: stages
            .iter()
            .map(|stage| ConvergenceStage {
                simulations: stage.total as f64,
                beta: stage.beta,
                ess: stage.ess,
                log_evidence: stage.log_evidence,
                log_evidence_error: stage.log_evidence_se,
                components: components(&stage.proposal),
                k_hat: stage.khat,
            })
            .collect(),
        k_hat_limit: KHAT_LIMIT,
        ess_target,
    }
}

/// What the MAP curve leaves over.
#[must_use]
pub fn residuals(file: &PosteriorFile, log_time: bool) -> ResidualsFigure {
    ResidualsFigure {
        title: file.plan.title.clone(),
        control: file.plan.experiment.time_s.clone(),
        residual: file.residuals.values.clone(),
        sigma: file.sigma.map_or(file.fit.map.rmse, |sigma| sigma.median),
        axes: Axes { log_control: log_time, ..Axes::default() },
    }
}

/// How a parameter is written in a figure: symbol and unit.
fn symbol(name: &str, unit: &str) -> (String, String) {
    match ParameterName::from_name(name) {
        Some(ParameterName::C1) => ("C_{1}".to_owned(), "Pa^{-1} s^{-1}".to_owned()),
        Some(ParameterName::TauS) => ("τ_{s}".to_owned(), "s".to_owned()),
        Some(ParameterName::DeltaC) => ("δ_{c}".to_owned(), "m".to_owned()),
        Some(ParameterName::Phi) => ("φ".to_owned(), String::new()),
        None => (name.to_owned(), unit.to_owned()),
    }
}

/// Place of a parameter in the paper's triple.
fn paper_place(name: &str) -> Option<usize> {
    match ParameterName::from_name(name)? {
        ParameterName::C1 => Some(0),
        ParameterName::TauS => Some(1),
        ParameterName::DeltaC => Some(2),
        ParameterName::Phi => None,
    }
}
