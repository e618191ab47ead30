//! The choice of posterior draws that the bed is run for.

use dem_core::heat::Heat;
use dem_core::{Sintering, time_to_contact_ratio};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde::Serialize;

use super::heat::BedHeat;
use crate::error::{InputError, Mistake};
use crate::pair::draws::PairDraws;
use crate::pair::parameter::ParameterName;

/// Contact ratio of the pair whose time puts the draws in order.
const ORDER_BY: f64 = 0.4;

/// A posterior draw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Draw {
    /// Its row in `draws.csv`, from 0.
    pub row: usize,
    /// Its parameters \[SI\], in the order of the posterior.
    pub parameters: Vec<f64>,
    /// The heat of its bed; none at the temperature of the calibration.
    #[serde(skip)]
    pub heat: Option<Heat>,
}

/// The places of the parameters that the curve of the pair depends on: of a posterior of several experiments not those of the others.
pub(super) fn used(calibrated: &PairDraws) -> Vec<usize> {
    let pair = &calibrated.pair;
    let named = |name: &str| {
        let of = |parameter: &&ParameterName| pair.calibrated(**parameter) == name;
        ParameterName::ALL.iter().find(of).is_some_and(|parameter| pair.takes(*parameter))
    };
    let parameters = &calibrated.record.plan.parameters;
    (0..parameters.len()).filter(|&place| named(&parameters[place].name)).collect()
}

/// `count` of the equally weighted draws: every n-th, from a random start, of the draws in the order of the sintering time of
/// their pair.
///
/// Under a heat that time is taken over the reduced time that the draw has by the end of the scene: how far it gets.
///
/// Systematic sampling along the quantity that decides: each draw is as likely as any other to be taken, and the
/// quantiles of densification times scatter far less than those of draws taken at random.
pub(super) fn choose(
    calibrated: &PairDraws,
    used: &[usize],
    heat: Option<&BedHeat>,
    (count, seed): (usize, u64),
) -> Result<Vec<Draw>, InputError> {
    let rows = calibrated.len();
    if count > rows {
        return Err(InputError::new("--draws", Mistake::OutOfRange)
            .found(count)
            .expected(format_args!("at most {rows}, as many as draws.csv holds")));
    }
    let unused = Sintering { c1: 1.0, tau_s: 1.0, delta_c: 1.0, lambda: 0.0 };
    let mut order: Vec<(f64, usize)> = (0..rows)
        .map(|row| {
            let sintering = calibrated.sintering(row, unused);
            let time =
                calibrated.pair_of(row, calibrated.pair.powder.radius_m).ok().and_then(|pair| {
                    time_to_contact_ratio(&pair, calibrated.pair.kinetics, &sintering, ORDER_BY)
                });
            let time = time.unwrap_or(f64::INFINITY);
            let Some(heat) = heat else { return Ok((time, row)) };
            Ok((time / heat.growth_s(&heat.of(calibrated, row)?), row))
        })
        .collect::<Result<_, InputError>>()?;
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let start: f64 = ChaCha8Rng::seed_from_u64(seed).random();
    (0..count)
        .map(|k| {
            let place = (k as f64 + start) * rows as f64 / count as f64;
            let row = order[(place as usize).min(rows - 1)].1;
            let theta = calibrated.theta(row);
            let parameters = used.iter().filter_map(|&place| theta.get(place).copied()).collect();
            let heat = heat.map(|heat| heat.of(calibrated, row)).transpose()?;
            Ok(Draw { row, parameters, heat })
        })
        .collect()
}
