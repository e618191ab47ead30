//! Failed simulations: whether failing depends on the parameters, where, and what that means for the posterior.

use crate::gaussian_process::{Covariance, Data, GaussianProcess};
use crate::joint::JointProblem;
use crate::neighbours::Neighbours;
use crate::pool::Pool;
use crate::posterior::{Evidence, Failing, FailingPlace};
use crate::problem::Parameter;
use crate::sampler::Sampler;
use crate::stream::{Purpose, stream};
use rand::RngExt;
use rayon::prelude::*;

/// Neighbours of a sample that are looked at.
const NEIGHBOURS: usize = 5;
/// Most samples that the test looks at, evenly among all.
const MOST_TESTED: usize = 8192;
/// Bins along the parameter that tells failed samples from finished ones.
const BINS: usize = 20;
/// Random orders of the failures that the observed one is compared with.
const ORDERS: usize = 999;
/// Most samples that the likelihood of the failed ones is predicted from: those of the highest.
const MOST_KNOWN: usize = 150;
/// How far below the highest log likelihood one is as good as none.
const DEPTH: f64 = 40.0;

/// Examines the failures of a run; none where nothing failed, or there is no evidence. `raw` are the importance weights, 0 where a simulation
/// failed, over `exp(ln_scale)`.
///
/// # Formula
///
/// Test: T = number of failed among the 5 nearest neighbours of all failed samples, in normal scores. Under failures that
/// do not depend on the parameters all orders of the failures within a stage are alike: p = (1 + number of 999 random
/// orders with at least T)/1000.
///
/// Mass: a Gaussian process through the log likelihoods of the finished samples predicts those of the failed ones; these
/// get the importance weight that they would have, and the mass is their share of all weights.
pub(crate) fn failing(
    sampler: &Sampler<'_>,
    problem: &JointProblem<'_>,
    (raw, ln_scale): (&[f64], f64),
    evidence: Option<&Evidence>,
) -> Option<Failing> {
    let (pool, evidence) = (&sampler.pool, evidence?);
    let failed: Vec<bool> = pool.ln_l.iter().map(|l| !l.is_finite()).collect();
    let (count, n) = (pool.failed_from(0), pool.len());
    if count == 0 || count == n {
        return None;
    }
    let share = count as f64 / n as f64;
    let p_value = p_value(pool, &failed, sampler.settings.seed);
    let share_se = (share / ((1.0 - share) * n as f64)).sqrt();
    Some(Failing {
        failed: count,
        simulations: n,
        p_value,
        mass: mass(pool, &failed, raw, ln_scale),
        place: place(pool, &failed, &problem.parameters, raw),
        log_evidence_if_random: evidence.value - (-share).ln_1p(),
        log_evidence_if_random_se: evidence.se.hypot(share_se),
    })
}

/// Chance that failures as much together as these come about where failing does not depend on the parameters.
fn p_value(pool: &Pool, failed: &[bool], seed: u64) -> f64 {
    let tested: Vec<usize> =
        (0..pool.len()).step_by(pool.len().div_ceil(MOST_TESTED).max(1)).collect();
    let failed: Vec<bool> = tested.iter().map(|&i| failed[i]).collect();
    let points: Vec<f64> = tested.iter().flat_map(|&i| pool.point(i)).copied().collect();
    let tree = Neighbours::new(&points, pool.d);
    let neighbours: Vec<Vec<usize>> = points
        .par_chunks_exact(pool.d)
        .enumerate()
        .map(|(i, point)| {
            // One more: the point itself is among them, unless as many others lie where it does.
            let mut near = Vec::with_capacity(NEIGHBOURS + 1);
            tree.nearest(point, NEIGHBOURS + 1, f64::INFINITY, &mut near);
            let others = near.into_iter().map(|(_, j)| j as usize).filter(|&j| j != i);
            others.take(NEIGHBOURS).collect()
        })
        .collect();
    let together = |failed: &[bool]| -> usize {
        let of_failed = neighbours.iter().zip(failed).filter(|(_, failed)| **failed);
        of_failed.map(|(near, _)| near.iter().filter(|&&j| failed[j]).count()).sum()
    };
    let observed = together(&failed);
    let mut rng = stream(seed, Purpose::Failures, 0, 0);
    let mut order = failed.clone();
    let mut stages: Vec<Vec<usize>> = Vec::new();
    for (i, &sample) in tested.iter().enumerate() {
        let stage = pool.stage[sample] as usize;
        if stages.len() <= stage {
            stages.resize(stage + 1, Vec::new());
        }
        stages[stage].push(i);
    }
    let as_many = (0..ORDERS)
        .filter(|_| {
            for members in &stages {
                for last in (1..members.len()).rev() {
                    let other = rng.random_range(0..=last);
                    order.swap(members[last], members[other]);
                }
            }
            together(&order) >= observed
        })
        .count();
    (1 + as_many) as f64 / (1 + ORDERS) as f64
}

/// Share of the posterior that the failed samples would have, by predicted likelihoods.
fn mass(pool: &Pool, failed: &[bool], raw: &[f64], ln_scale: f64) -> f64 {
    let mut known: Vec<usize> = (0..pool.len()).filter(|&i| !failed[i]).collect();
    known.sort_by(|&a, &b| pool.ln_l[b].total_cmp(&pool.ln_l[a]).then(a.cmp(&b)));
    let top = known.first().map_or(f64::NEG_INFINITY, |&i| pool.ln_l[i]);
    known.truncate(MOST_KNOWN);
    let values: Vec<f64> = known.iter().map(|&i| (pool.ln_l[i] - top).max(-DEPTH)).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let spread = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
    let mut weights = vec![0.0; pool.len()];
    known.iter().for_each(|&i| weights[i] = 1.0);
    let process = GaussianProcess::new(Data {
        d: pool.d,
        z: &pool.z,
        weights: &weights,
        chosen: &known,
        values: &values,
        nuggets: &vec![1e-3; known.len()],
        offsets: vec![mean],
        units: vec![spread.sqrt().max(1e-9)],
        covariance: Covariance::Search,
    });
    let base = pool.ln_base();
    let of_failed = |i: usize| {
        let mut predicted = [mean];
        if let Some(process) = &process {
            process.predict(pool.point(i), &mut predicted);
        }
        (base[i] + top + predicted[0].min(0.0) - ln_scale).exp()
    };
    let unknown: f64 = (0..pool.len()).filter(|&i| failed[i]).map(of_failed).sum();
    unknown / (unknown + raw.iter().sum::<f64>())
}

/// The parameter that tells failed samples from finished ones best, and where it has failed ones.
fn place(
    pool: &Pool,
    failed: &[bool],
    parameters: &[Parameter],
    raw: &[f64],
) -> Option<FailingPlace> {
    let d = pool.d;
    let of = |j: usize| {
        let mut values: Vec<(f64, bool)> =
            failed.iter().enumerate().map(|(i, failed)| (pool.z[i * d + j], *failed)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // The rank sum: chance that a failed sample lies above a finished one.
        let (mut below, mut sum) = (0.0, 0.0);
        for (_, failed) in &values {
            if *failed {
                sum += below;
            } else {
                below += 1.0;
            }
        }
        let count = values.len() as f64 - below;
        let away = (sum / (below * count) - 0.5).abs();
        let own: Vec<f64> = values.iter().filter(|(_, failed)| *failed).map(|(z, _)| *z).collect();
        (away, own)
    };
    let (j, (_, own)) =
        (0..d).map(|j| (j, of(j))).max_by(|a, b| a.1.0.total_cmp(&b.1.0).then(b.0.cmp(&a.0)))?;
    let at = |share: f64| {
        let place = (share * (own.len() - 1) as f64).round() as usize;
        parameters[j].prior.from_z(own[place])
    };
    let Bins { edges, finished, failed, posterior } = bins(pool, failed, (j, &parameters[j]), raw);
    let (parameter, lower, upper) = (parameters[j].name.clone(), at(0.05), at(0.95));
    Some(FailingPlace { parameter, lower, upper, edges, finished, failed, posterior })
}

/// Bins over the simulations along one parameter.
struct Bins {
    edges: Vec<f64>,
    finished: Vec<usize>,
    failed: Vec<usize>,
    posterior: Vec<f64>,
}

fn bins(pool: &Pool, failed: &[bool], (j, parameter): (usize, &Parameter), raw: &[f64]) -> Bins {
    let prior = &parameter.prior;
    let column = pool.z.iter().skip(j).step_by(pool.d);
    let places: Vec<f64> = column.map(|z| prior.to_coordinate(prior.from_z(*z))).collect();
    let low = places.iter().copied().fold(f64::INFINITY, f64::min);
    let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let width = (high - low) / BINS as f64;
    let edge = |k: usize| prior.coordinate().theta(low + width * k as f64);
    let mut bins = Bins {
        edges: (0..=BINS).map(edge).collect(),
        finished: vec![0; BINS],
        failed: vec![0; BINS],
        posterior: vec![0.0; BINS],
    };
    let total: f64 = raw.iter().sum();
    for ((place, failed), weight) in places.iter().zip(failed).zip(raw) {
        let k = (((place - low) / width) as usize).min(BINS - 1);
        if *failed {
            bins.failed[k] += 1;
        } else {
            bins.finished[k] += 1;
        }
        bins.posterior[k] += weight / total;
    }
    bins
}

#[cfg(test)]
mod tests {
    use crate::{
        Concern, FixedSigma, FnSimulator, Noise, Observations, Parameter, Posterior, Prior,
        PriorSpec, Problem, Settings, SimError, Verdict, calibrate,
    };

    /// One parameter, uniform on 0 to 4, measured once as 2 +- 0.2: the posterior is that normal, the evidence 1/4.
    fn of(fails: impl Fn(f64) -> bool + Sync, samples: usize, seed: u64) -> Posterior {
        let simulator = FnSimulator::new(1, 1, move |theta: &[f64], out: &mut [f64]| {
            if fails(theta[0]) {
                return Err(SimError::recoverable("no convergence"));
            }
            out[0] = theta[0];
            Ok(())
        });
        let observations = Observations::new(vec![0.0], vec![2.0]).expect("observations");
        let prior = Prior::new(PriorSpec::Uniform { lower: 0.0, upper: 4.0 }).expect("a prior");
        let problem = Problem {
            simulator: &simulator,
            parameters: vec![Parameter::new("b", "1", prior)],
            observations,
            noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.2) },
        };
        let settings = Settings { samples, seed, max_failed_share: 1.0, ..Settings::default() };
        calibrate(&problem, &settings, &mut ()).expect("a posterior")
    }

    /// A number between 0 and 1 that follows from the bits of x and looks random.
    fn scattered(x: f64) -> f64 {
        let mut z = x.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn failures_inside_the_posterior_are_recognised_with_the_mass_that_they_cut_off() {
        // Below 1.9, which is 0.5 sd below the mean: Phi(-0.5) = 0.3085 of the posterior.
        for (samples, seed) in [(1024, 1), (1024, 2), (4096, 3)] {
            let posterior = of(|b| b < 1.9, samples, seed);
            let failing = posterior.failing.as_ref().expect("some failed");
            assert!(failing.depends() && failing.matters(), "{failing:?}");
            assert!((failing.mass - 0.3085).abs() < 0.06, "{failing:?}");
            let place = failing.place.as_ref().expect("a place");
            let counts = |of: &[usize]| of.iter().sum::<usize>();
            assert_eq!(counts(&place.failed), failing.failed);
            assert_eq!(counts(&place.finished), samples - failing.failed);
            assert!((place.posterior.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{place:?}");
            // No posterior is left where all fail.
            let dead = place.edges[1..].iter().filter(|edge| **edge < 1.9).count();
            assert!(dead > 3 && place.finished[..dead].iter().all(|n| *n == 0), "{place:?}");
            assert!(place.posterior[..dead].iter().all(|share| *share == 0.0), "{place:?}");
            assert!(place.parameter == "b" && place.lower >= 0.0 && place.upper < 1.9, "{place:?}");
            let trust = posterior.trust();
            assert_eq!(trust.verdict, Verdict::Untrusted);
            let cut = |c: &Concern| matches!(c, Concern::FailuresInPosterior { .. });
            assert!(trust.concerns.iter().any(cut), "{:?}", trust.concerns);
        }
    }

    #[test]
    fn failures_far_from_the_posterior_do_not_spoil_it() {
        let posterior = of(|b| b < 1.0, 2048, 1);
        let failing = posterior.failing.as_ref().expect("some failed");
        assert!(failing.depends() && !failing.matters(), "{failing:?}");
        assert!(failing.mass < 0.001, "5 sds away: {failing:?}");
        assert_eq!(posterior.trust().verdict, Verdict::Converged);
    }

    #[test]
    fn failures_at_random_leave_the_result_and_their_share_corrects_the_evidence() {
        // ln Z = -ln 4; with three runs in ten counted as likelihood zero it is ln 0.7 lower.
        let mut objections = 0;
        for seed in 1..=5 {
            let posterior = of(|b| scattered(b) < 0.3, 2048, seed);
            let failing = posterior.failing.as_ref().expect("some failed");
            objections += usize::from(failing.depends());
            assert!((failing.mass - 0.3).abs() < 0.06, "{failing:?}");
            let truth = -(4.0_f64).ln();
            let error = failing.log_evidence_if_random - truth;
            assert!(error.abs() < 4.0 * failing.log_evidence_if_random_se, "{failing:?}");
            let low = posterior.log_evidence.value - truth;
            assert!((low - 0.7_f64.ln()).abs() < 0.1, "{low}");
        }
        assert!(objections <= 1, "by chance one run in a hundred objects: {objections}");
        assert!(of(|_| false, 512, 1).failing.is_none());
    }
}
