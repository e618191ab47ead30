//! The choice of posterior draws that the bed is run for.

use dem_core::{Sintering, time_to_contact_ratio};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde::Serialize;

use crate::error::{InputError, Mistake};
use crate::pair::draws::PairDraws;

/// Contact ratio of the pair whose time puts the draws in order.
const ORDER_BY: f64 = 0.4;

/// A posterior draw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Draw {
    /// Its row in `draws.csv`, from 0.
    pub row: usize,
    /// Its parameters \[SI\], in the order of the posterior.
    pub parameters: Vec<f64>,
}

/// `count` of the equally weighted draws: every n-th, from a random start, of the draws in the order of the sintering time of
/// their pair.
///
/// Systematic sampling along the quantity that decides: each draw is as likely as any other to be taken, and the
/// quantiles of densification times scatter far less than those of draws taken at random.
pub(super) fn choose(
    calibrated: &PairDraws,
    count: usize,
    seed: u64,
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
            (time.unwrap_or(f64::INFINITY), row)
        })
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let start: f64 = ChaCha8Rng::seed_from_u64(seed).random();
    Ok((0..count)
        .map(|k| {
            let place = (k as f64 + start) * rows as f64 / count as f64;
            let row = order[(place as usize).min(rows - 1)].1;
            Draw { row, parameters: calibrated.theta(row) }
        })
        .collect())
}
