//! The next pair of a population: the pair itself, its curves, and the sampled populations as a table.

use std::fmt::Write as _;

use dem_core::Powder;
use rayon::prelude::*;
use smc_calib::population::PopulationPosterior;
use smc_calib::{Coordinate, Simulator as _, Weighted};

use super::member::Run;
use crate::error::{Failure, RunError};
use crate::input::data_table::quoted;
use crate::pair::model::NeckGrowth;
use crate::plan::PairPlan;
use crate::record::NextPair;
use crate::report::read_sigma;

/// Next pairs that the curves are drawn from.
const DRAWS: usize = 1024;
/// Times of the curves.
const TIMES: usize = 121;

/// The next pair, at the radius of the population; none where a run is not of one pair.
pub(super) fn pair(runs: &[Run], radius_m: f64) -> Option<PairPlan> {
    let pairs: Vec<&PairPlan> = runs.iter().map(Run::pair).collect::<Option<_>>()?;
    let first = pairs.first()?;
    Some(PairPlan {
        experiment: "the next pair".to_owned(),
        powder: Powder { radius_m, ..first.powder },
        tau_s_radius_m: None,
        ..(*first).clone()
    })
}

/// The next pair with its curves, and the measurements of all pairs.
pub(super) fn next_pair(
    pair: &PairPlan,
    found: &PopulationPosterior,
    runs: &[Run],
) -> Result<NextPair, Failure> {
    let measured = || runs.iter().flat_map(|run| run.record.plan.observables());
    let control: Vec<f64> = measured().flat_map(|(_, one)| one.control.iter().copied()).collect();
    let values = measured().flat_map(|(_, one)| one.values.iter().copied()).collect();
    let last = control.iter().copied().fold(0.0, f64::max);
    let time_s: Vec<f64> = (0..TIMES).map(|k| last * k as f64 / (TIMES - 1) as f64).collect();
    let parameters: Vec<_> =
        found.next.parameters.iter().map(|summary| summary.parameter.clone()).collect();
    let model = NeckGrowth::new(pair, &parameters, time_s.clone())?;
    let draws = &found.next.draws;
    let kept = draws.len().min(DRAWS);
    let curves: Vec<Vec<f64>> = (0..kept)
        .into_par_iter()
        .filter_map(|k| {
            let draw = &draws[k * draws.len() / kept];
            let mut curve = vec![0.0; TIMES];
            model.simulate(found.next.theta(draw), &mut curve).ok().map(|()| curve)
        })
        .collect();
    if curves.is_empty() {
        return Err(RunError::new("no curve of a next pair could be computed").into());
    }
    let at = |time: usize| Weighted::equal(curves.iter().map(|curve| curve[time]).collect());
    let columns: Vec<Weighted> = (0..TIMES).into_par_iter().map(at).collect();
    let band = |share: f64| {
        let ends: Vec<[f64; 2]> = columns.iter().map(|column| column.interval(share)).collect();
        [0, 1].map(|end| ends.iter().map(|ends| ends[end]).collect())
    };
    Ok(NextPair {
        pair: pair.clone(),
        control,
        values,
        mean: columns.iter().map(|column| column.moments().0).collect(),
        curve50: band(0.5),
        curve90: band(0.9),
        time_s,
    })
}

/// Gives every draw of the next pair a noise standard deviation: that of a draw of one of the pairs, each pair in its turn. Nothing
/// where the noise of a pair is not one number for all of its rows.
pub(super) fn add_noise(found: &mut PopulationPosterior, runs: &[Run]) -> Result<(), Failure> {
    let mut sigmas = Vec::new();
    for run in runs {
        let known = run.record.pair().is_ok_and(|pair| pair.found.sigma.is_some());
        let own = if known { read_sigma(&run.record, &run.folder)? } else { None };
        let Some(own) = own.filter(|own| !own.is_empty()) else { return Ok(()) };
        sigmas.push(own);
    }
    for (k, draw) in found.next.draws.iter_mut().enumerate() {
        let own = &sigmas[k % sigmas.len()];
        // Draws of a run may stand in the order of a parameter: far apart, all of them have their turn.
        draw.sigma = own.get(k.wrapping_mul(7919) % own.len()).copied();
    }
    Ok(())
}

/// The population of each draw: mean and spread of each parameter in its coordinate, and the correlations.
pub(super) fn populations_csv(
    parameters: &[(String, String, Coordinate)],
    found: &PopulationPosterior,
) -> String {
    let of = |what: &str| {
        let title = |(name, _, coordinate): &(String, String, Coordinate)| match coordinate {
            Coordinate::Log10 => quoted(&format!("{what} log10 {name}")),
            Coordinate::Linear => quoted(&format!("{what} {name}")),
        };
        parameters.iter().map(title).collect::<Vec<_>>()
    };
    let mut titles = [of("mean"), of("spread")].concat();
    for (i, (name, ..)) in parameters.iter().enumerate() {
        titles.extend(
            parameters[..i]
                .iter()
                .map(|(other, ..)| quoted(&format!("correlation {other} {name}"))),
        );
    }
    let mut text = titles.join(",");
    text.push('\n');
    for one in &found.draws {
        let numbers = one.mean.iter().chain(&one.spread).chain(&one.correlation);
        let numbers: Vec<String> = numbers.map(ToString::to_string).collect();
        let _ = writeln!(text, "{}", numbers.join(","));
    }
    text
}
