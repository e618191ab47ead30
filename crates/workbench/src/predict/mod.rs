//! The sintering time of a pair from a saved posterior, with its interval.
//!
//! Every posterior draw is pushed through the exact curve; nothing is calibrated again. For another radius
//! tau_s moves with it, tau_s(R) = tau_s R/R_cal; C1 and delta_c belong to the material and stay. [`predict_average`] does the
//! same with the draws of several models, weighted by their evidence. With a heat, that of the calibration or another, times are those
//! at which its reduced time gets there.

mod average;
mod drawn;
mod heated;
mod text;
mod wanted;

pub use average::{AveragedModel, predict_average};
pub use drawn::Predicted;
pub use heated::EnoughEnergy;
pub use wanted::Wanted;

use std::collections::BTreeSet;

use dem_core::heat::Heat;
use dem_core::{
    Kinetics, SceneError, Sintering, SolverKind, SolverSettings, contact_ratios,
    heated_contact_ratios, heated_time_to_contact_ratio, time_to_contact_ratio,
};
use serde::Serialize;

use self::drawn::{Drawn, Scatter};
use crate::careful::Careful;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::pair::asked_heat::{heat_of, outside_energies, refused};
use crate::pair::draws::PairDraws;
use crate::pair::heat::{HeatPlan, LawPlan};
use crate::pair::parameter::ParameterName;
use crate::plan::pairs;

/// Fewest samples that an interval of 95 % has an end inside of.
const FEWEST: usize = 40;

/// The time at which a contact ratio is reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinteringTime {
    /// The target a/R.
    pub contact_ratio: f64,
    /// The time \[s\] over the draws that reach it; none where no draw does.
    pub time_s: Option<Predicted>,
    /// Number of draws whose curve ends below the target.
    pub never: usize,
    /// Number of different times among the draws that reach it: draws repeat samples of large weight.
    #[serde(skip)]
    samples: usize,
    /// Number of draws.
    pub draws: usize,
    /// Probability that the target is never reached.
    pub never_probability: f64,
}

impl SinteringTime {
    /// What to say of a time that too few samples reach for an interval.
    fn few(&self) -> Option<String> {
        let Self { contact_ratio, never, samples, draws, .. } = *self;
        let few = never > 0 && (1..FEWEST).contains(&samples);
        let reach = draws - never;
        few.then(|| Careful::FewReach { contact_ratio, reach, samples, draws }.to_string())
    }
}

/// The contact ratio at a given time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAfter {
    /// The time \[s\].
    pub time_s: f64,
    /// a/R at that time.
    pub contact_ratio: Predicted,
    /// A new measurement of it, in an experiment of its own: with the noise of each draw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured: Option<Predicted>,
}

fn is_zero<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Sintering times and contact ratios of a pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Name of the calibration that the draws come from.
    pub name: String,
    /// Its heading.
    #[serde(skip)]
    pub title: String,
    /// Its kinetics; none for an average over several models.
    pub kinetics: Option<Kinetics>,
    /// The models of an average, the most probable first; empty for one posterior.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub averaged: Vec<AveragedModel>,
    /// Number of less probable models that are left out of an average.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_out_models: usize,
    /// Probability of these together.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_out_probability: f64,
    /// Radius of the predicted pair \[m\].
    pub radius_m: f64,
    /// Radius that the posterior was calibrated at \[m\].
    pub calibrated_radius_m: f64,
    /// Final contact ratio phi of the calibration.
    #[serde(skip)]
    pub final_contact_ratio: f64,
    /// Whether the posterior's own diagnostics let it be trusted.
    pub trusted: bool,
    /// Time of first contact in the clock of the table \[s\], where it was calibrated; predicted times count from it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_s: Option<Predicted>,
    /// Sintering times, one per target.
    pub sintering: Vec<SinteringTime>,
    /// Contact ratios, one per time.
    pub after: Vec<ContactAfter>,
    /// Where the pair stops growing, with a heat that ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub freezes: Option<Freezing>,
    /// The energy of a pulse that is enough, where it is asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enough: Option<EnoughEnergy>,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

/// Where a pair stops growing because its heat ends.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freezing {
    /// a/R there.
    pub contact_ratio: Predicted,
    /// Probability that the heat ends; the contact ratio is conditional on it.
    pub probability: f64,
}

/// Predicts the times at which contact ratios are reached and the contact ratios at some times, for a pair of another
/// radius or of the calibrated one. Times count from first contact.
///
/// # Errors
///
/// [`Failure`] for a radius or target that the model cannot take, for noise that is not known, or where nothing is asked
/// for.
pub fn predict(calibrated: &PairDraws, wanted: &Wanted) -> Result<Prediction, Failure> {
    wanted.checked()?;
    let PairDraws { record, pair, .. } = calibrated;
    let kinetics = pair.kinetics;
    let calibrated_radius_m = pair.powder.radius_m;
    let radius_m = wanted.radius_m.unwrap_or(calibrated_radius_m);
    let heat = heat_of(pair, wanted.heat.as_ref(), wanted.pulse_energy)?;
    let drawn = draws(calibrated, radius_m, heat.as_ref())?;
    let (sintering, after) = predicted(&drawn, wanted)?;
    let enough = wanted.enough.map(|asked| {
        let heat = heat.as_ref().filter(|heat| heat.law != LawPlan::Direct);
        // The search begins at the calibrated energy, whatever else is asked for.
        let calibrated_at = pair.heat.as_ref().and_then(HeatPlan::energy);
        let own = heat.and_then(|heat| Some((heat, calibrated_at.or(heat.energy())?)));
        let (heat, energy) = own.ok_or_else(heated::no_law_for_energies)?;
        let value = |row: usize| move |name| calibrated.value(name, row);
        let at = |row: usize, energy: f64| heat.with_energy(energy)?.at(radius_m, value(row)).ok();
        Ok::<_, InputError>(heated::enough(&drawn, asked, energy, at))
    });
    let enough = enough.transpose()?;
    let mut advice = calibrated.advice.clone();
    let energies =
        [heat.as_ref().and_then(HeatPlan::energy), enough.as_ref().and_then(|e| e.energy)];
    let all = || pairs(&record.plan.experiments).map(|(_, pair)| pair);
    let outside = |energy| outside_energies(all(), energy);
    advice.extend(energies.into_iter().flatten().filter_map(outside));
    advice.extend(sintering.iter().filter_map(SinteringTime::few));
    if kinetics.only_approaches_the_merged_pair() {
        let limit = 2f64.cbrt();
        if wanted.targets.iter().any(|target| (target - limit).abs() < 1e-3) {
            advice.push(Careful::NeverReached { kinetics: kinetics.to_string() }.to_string());
        }
    }
    Ok(Prediction {
        name: record.plan.name.clone(),
        title: match &calibrated.experiment {
            Some(experiment) => format!("{}, {experiment}", record.plan.title),
            None => record.plan.title.clone(),
        },
        kinetics: Some(kinetics),
        averaged: Vec::new(),
        left_out_models: 0,
        left_out_probability: 0.0,
        radius_m,
        calibrated_radius_m,
        final_contact_ratio: pair.final_contact_ratio,
        trusted: record.trusted(),
        first_contact_s: Predicted::of(
            (0..calibrated.len())
                .filter_map(|row| Some((calibrated.value(ParameterName::T0, row)?, 1.0))),
        ),
        sintering,
        after,
        freezes: freezing(&drawn)?,
        enough,
        advice,
    })
}

/// The pair of every draw at a radius, with its sintering parameters and its heat there.
fn draws(
    calibrated: &PairDraws,
    radius_m: f64,
    heat: Option<&HeatPlan>,
) -> Result<Vec<Drawn>, InputError> {
    let unused = Sintering { c1: 1.0, tau_s: 1.0, delta_c: 1.0, lambda: 0.0 };
    (0..calibrated.len())
        .map(|row| {
            let scene = calibrated.pair_of(row, radius_m).map_err(carried)?;
            let sintering = calibrated.sintering(row, unused);
            let sigma = calibrated.sigma.as_ref().and_then(|sigma| sigma.get(row).copied());
            let value = |name| calibrated.value(name, row);
            let heat = heat.map(|heat| heat.at(radius_m, value)).transpose();
            Ok(Drawn {
                heat: heat.map_err(|error| refused("--heat", &error))?,
                scene,
                sintering: sintering.at_radius(calibrated.pair.powder.radius_m, radius_m),
                kinetics: calibrated.pair.kinetics,
                weight: 1.0,
                scatter: sigma.map(|sigma| Scatter { sigma, outliers: calibrated.outliers }),
            })
        })
        .collect()
}

/// A radius that the model cannot take.
fn carried(error: SceneError) -> InputError {
    InputError::new("--radius-m", Mistake::OutOfRange).found(error)
}

/// Everything that is wanted, over some draws.
fn predicted(
    drawn: &[Drawn],
    wanted: &Wanted,
) -> Result<(Vec<SinteringTime>, Vec<ContactAfter>), Failure> {
    let total: f64 = drawn.iter().map(|draw| draw.weight).sum();
    let time_to = |target: f64| {
        let times: Vec<(f64, f64)> = drawn
            .iter()
            .filter_map(|Drawn { scene, sintering, kinetics, weight, heat, .. }| {
                let law = (*kinetics, sintering);
                let time_s = match heat {
                    None => time_to_contact_ratio(scene, law.0, law.1, target),
                    Some(heat) => heated_time_to_contact_ratio(scene, law, heat, target),
                };
                Some((time_s?, *weight))
            })
            .collect();
        let reached: f64 = times.iter().map(|(_, weight)| weight).sum();
        let never = drawn.len() - times.len();
        let different: BTreeSet<u64> = times.iter().map(|(time_s, _)| time_s.to_bits()).collect();
        SinteringTime {
            contact_ratio: target,
            never,
            samples: different.len(),
            draws: drawn.len(),
            never_probability: if never == 0 { 0.0 } else { (1.0 - reached / total).max(0.0) },
            time_s: Predicted::of(times),
        }
    };
    let sintering = wanted.targets.iter().map(|target| time_to(*target)).collect();
    Ok((sintering, contact_after(drawn, wanted)?))
}

/// Contact ratios after infinite time of the draws whose heat ends.
fn freezing(drawn: &[Drawn]) -> Result<Option<Freezing>, Failure> {
    let settings = SolverSettings::of(SolverKind::ClosedForm);
    let mut ends = Vec::new();
    for Drawn { scene, sintering, kinetics, weight, heat, .. } in drawn {
        let end = heat.as_ref().map_or(f64::INFINITY, Heat::reduced_time_at_end);
        if end.is_finite() {
            let mut out = [0.0];
            contact_ratios(scene, *kinetics, sintering, &settings, &[end], &mut out)
                .map_err(RunError::new)?;
            ends.push((out[0], *weight));
        }
    }
    let weigh = |weights: &mut dyn Iterator<Item = f64>| weights.sum::<f64>();
    let all = weigh(&mut drawn.iter().map(|draw| draw.weight));
    let frozen = weigh(&mut ends.iter().map(|(_, weight)| *weight));
    let found = Predicted::of(ends);
    Ok(found.map(|contact_ratio| Freezing { contact_ratio, probability: (frozen / all).min(1.0) }))
}

fn contact_after(drawn: &[Drawn], wanted: &Wanted) -> Result<Vec<ContactAfter>, Failure> {
    let settings = SolverSettings::of(SolverKind::ClosedForm);
    let mut times_s = wanted.after_s.clone();
    times_s.sort_by(f64::total_cmp);
    if times_s.is_empty() {
        return Ok(Vec::new());
    }
    let unknown = drawn.iter().any(|draw| draw.scatter.is_none());
    if wanted.with_noise && unknown {
        return Err(InputError::new("--with-noise", Mistake::Conflict)
            .found("noise that is stated row by row, or as a share of the value")
            .expected("a calibration with one noise standard deviation")
            .help("calibrate with --noise inferred, correlated or robust")
            .into());
    }
    let mut columns = vec![Vec::with_capacity(drawn.len()); times_s.len()];
    let mut curve = vec![0.0; times_s.len()];
    for Drawn { scene, sintering, kinetics, weight, heat, .. } in drawn {
        let law = (*kinetics, sintering);
        match heat {
            None => contact_ratios(scene, law.0, law.1, &settings, &times_s, &mut curve),
            Some(heat) => heated_contact_ratios(scene, law, heat, &settings, &times_s, &mut curve),
        }
        .map_err(RunError::new)?;
        for (column, value) in columns.iter_mut().zip(&curve) {
            column.push((*value, *weight));
        }
    }
    let noisy = |column: &[(f64, f64)]| {
        let pairs = column.iter().zip(drawn).enumerate();
        Predicted::of(pairs.map(|(k, ((value, weight), draw))| {
            (value + draw.scatter.map_or(0.0, |scatter| scatter.error(k)), *weight)
        }))
    };
    times_s
        .into_iter()
        .zip(columns)
        .map(|(time_s, column)| {
            let measured = if wanted.with_noise { noisy(&column) } else { None };
            let contact_ratio = Predicted::of(column)
                .ok_or_else(|| RunError::new("the posterior holds no draw to predict from"))?;
            Ok(ContactAfter { time_s, contact_ratio, measured })
        })
        .collect()
}
