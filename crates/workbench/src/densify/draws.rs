//! Which posterior draws the bed is run for, and what each says of its contacts.

use dem_core::bed::{Growing, SinteringTable};
use dem_core::{Kinetics, PairSpec, Powder, Sintering, time_to_contact_ratio};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde::Serialize;

use crate::error::{Failure, InputError, Mistake};
use crate::posterior_file::PosteriorFile;
use crate::parameter::ParameterName;

/// The contact ratio by whose time draws are put in order.
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
///
/// # Errors
///
/// [`Failure`] for more draws than there are.
pub(super) fn choose(
    file: &PosteriorFile,
    theta: &[Vec<f64>],
    count: usize,
    seed: u64,
) -> Result<Vec<Draw>, Failure> {
    let rows = theta.first().map_or(0, Vec::len);
    if count > rows {
        return Err(InputError::new("--draws", Mistake::OutOfRange)
            .found(count)
            .expected(format_args!("at most {rows}, as many as draws.csv holds"))
            .into());
    }
    let plan = &file.plan;
    let kinetics = plan.kinetics()?;
    let names = plan.parameter_names()?;
    let powder: Powder = plan.powder();
    let mut order = Vec::with_capacity(rows);
    for row in 0..rows {
        let parameters: Vec<f64> = theta.iter().map(|column| column[row]).collect();
        let phi = value(&names, &parameters, ParameterName::Phi)
            .unwrap_or(plan.experiment.final_contact_ratio);
        let sintering = sintering(&names, &parameters, None);
        let time = PairSpec::new(powder, phi)
            .build()
            .ok()
            .and_then(|pair| time_to_contact_ratio(&pair, kinetics, &sintering, ORDER_BY));
        order.push((time.unwrap_or(f64::INFINITY), Draw { row, parameters }));
    }
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.row.cmp(&b.1.row)));
    let start: f64 = ChaCha8Rng::seed_from_u64(seed).random();
    Ok((0..count)
        .map(|k| {
            let place = (k as f64 + start) * rows as f64 / count as f64;
            order[(place as usize).min(rows - 1)].1.clone()
        })
        .collect())
}

/// A parameter of a draw, if it was calibrated.
#[must_use]
pub(super) fn value(
    names: &[ParameterName],
    parameters: &[f64],
    name: ParameterName,
) -> Option<f64> {
    names.iter().position(|known| *known == name).map(|place| parameters[place])
}

/// The sintering parameters of a draw; those that the kinetics have no use for are the scene's.
fn sintering(
    names: &[ParameterName],
    parameters: &[f64],
    scene: Option<&SinteringTable>,
) -> Sintering {
    let of = |name, unused: Option<f64>| value(names, parameters, name).or(unused).unwrap_or(1.0);
    Sintering {
        c1: of(ParameterName::C1, scene.map(|table| table.c1)),
        tau_s: of(ParameterName::TauS, scene.map(|table| table.tau_s)),
        delta_c: of(ParameterName::DeltaC, scene.map(|table| table.delta_c)),
    }
}

/// How contacts grow by a draw.
#[must_use]
pub(super) fn growing(
    names: &[ParameterName],
    draw: &Draw,
    kinetics: Kinetics,
    calibrated_radius_m: f64,
    scene: &SinteringTable,
) -> Growing {
    let sintering = sintering(names, &draw.parameters, Some(scene));
    Growing { kinetics, sintering, calibrated_radius_m }
}
