//! One or two observations on wide priors: right results are trusted though k-hat is high, wrong ones are not.

use crate::support::prior;
use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::trust::limits::{KHAT_LIMIT, TAIL_SHARE};
use smc_calib::{
    Concern, FnSimulator, Noise, Observations, Parameter, Posterior, PriorSpec, Problem, Settings,
    SimError, calibrate,
};

/// A curve, its priors, and the parameters that its observations are made with.
struct Case {
    curve: fn(&[f64], f64) -> f64,
    priors: Vec<PriorSpec>,
    truth: Vec<f64>,
    times: Vec<f64>,
}

impl Case {
    /// The result, and the largest error of a mean (in sds) or an sd (relative).
    fn solve(&self, samples: usize, seed: u64) -> (Posterior, f64) {
        let simulator =
            FnSimulator::new(self.priors.len(), self.times.len(), |p: &[f64], out: &mut [f64]| {
                out.iter_mut().zip(&self.times).for_each(|(o, t)| *o = (self.curve)(p, *t));
                Ok::<(), SimError>(())
            });
        let noise = |i: usize| 0.01 * (2.4 * i as f64).sin();
        let value = |(i, t): (usize, &f64)| (self.curve)(&self.truth, *t) + noise(i);
        let values = self.times.iter().enumerate().map(value).collect();
        let parameter =
            |(spec, name): (&PriorSpec, &str)| Parameter::new(name, "1", prior(spec.clone()));
        let problem = Problem {
            simulator: &simulator,
            parameters: self.priors.iter().zip(["a", "b"]).map(parameter).collect(),
            observations: Observations::new(self.times.clone(), values).unwrap(),
            noise: Noise::default(),
        };
        let settings = Settings { samples, seed, map_simulations: 0, ..Settings::default() };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        let exact = quadrature(&problem, &QuadratureSettings::default()).unwrap();
        assert!(exact.error < 3e-3, "{exact:?}");
        let errors = p.parameters.iter().enumerate().map(|(j, x)| {
            let (x, mean, sd) = (x.in_coordinate, exact.mean[j], exact.sd[j]);
            ((x.mean - mean).abs() / sd).max((x.sd / sd - 1.0).abs())
        });
        let error = errors.fold(0.0, f64::max);
        (p, error)
    }
}

fn is_called_heavy(p: &Posterior) -> bool {
    p.trust().concerns.iter().any(|c| matches!(c, Concern::HighKhat { .. }))
}

#[test]
fn a_high_khat_of_a_tail_of_hardly_any_mass_does_not_make_a_right_result_untrusted() {
    let root = Case {
        curve: |p, t| (t / p[0]).sqrt().min(1.26),
        priors: vec![PriorSpec::Uniform { lower: 1e-2, upper: 1e2 }],
        truth: vec![2.0],
        times: vec![0.3, 1.5],
    };
    let mut high = 0;
    for seed in 1..=3 {
        let (p, error) = root.solve(16_384, seed);
        let share = p.trust().tail_share;
        assert!(error < 0.02 && share < TAIL_SHARE, "seed {seed}: {error} {share}");
        assert!(p.trust().converged() && !is_called_heavy(&p), "{:?}", p.trust());
        high += u32::from(p.khat >= KHAT_LIMIT);
    }
    assert!(high > 0, "no seed has a high k-hat: the test says nothing");
}

#[test]
fn a_high_khat_of_a_tail_that_decides_is_called_heavy() {
    let power = Case {
        curve: |p, t| (t / p[0]).powf(p[1]).min(1.26),
        priors: vec![
            PriorSpec::Uniform { lower: 1e-2, upper: 1e2 },
            PriorSpec::Uniform { lower: 0.05, upper: 1.0 },
        ],
        truth: vec![2.0, 0.4],
        times: vec![0.8],
    };
    for seed in 1..=3 {
        let (p, error) = power.solve(512, seed);
        assert!(error > 0.05 && p.khat >= KHAT_LIMIT, "seed {seed}: {error} {}", p.khat);
        assert!(is_called_heavy(&p) && !p.trust().converged(), "{:?}", p.trust());
    }
}
