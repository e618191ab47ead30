//! Two modes are said in words where there are two, and only there.

use crate::support::{line, line_problem, prior};
use smc_calib::reference::{self, Reference};
use smc_calib::{
    Concern, FixedSigma, FnSimulator, Noise, Observations, Parameter, PriorSpec, Problem, Settings,
    SimError, Target, calibrate, sample_density,
};

/// The modes that a calibration of a reference problem speaks of.
fn modes(reference: &Reference, samples: usize, seed: u64) -> Option<Concern> {
    let d = reference.mean.len();
    // One value y with likelihood exp(-y^2/2): that of the problem but for a factor.
    let simulator = FnSimulator::new(d, 1, |z: &[f64], out: &mut [f64]| {
        let ln = reference.ln_likelihood(z, &mut []).expect("a number");
        if ln == f64::NEG_INFINITY {
            return Err(SimError::recoverable("beyond the bound"));
        }
        out[0] = (2.0 * (30.0 - ln)).sqrt();
        Ok(())
    });
    let normal = || prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 });
    let names = ["x", "y", "z"];
    let problem = Problem {
        simulator: &simulator,
        parameters: (0..d).map(|j| Parameter::new(names[j], "1", normal())).collect(),
        observations: Observations::new(vec![0.0], vec![0.0]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(1.0) },
    };
    let settings = Settings { samples, seed, map_simulations: 0, ..Settings::default() };
    let p = calibrate(&problem, &settings, &mut ()).unwrap();
    p.trust().concerns.into_iter().find(|c| matches!(c, Concern::TwoModes { .. }))
}

#[test]
fn two_modes_are_named_with_their_shares_and_places() {
    for (samples, seed) in (1..=4).flat_map(|seed| [(2048, seed), (8192, seed)]) {
        match modes(&reference::two_modes(), samples, seed) {
            Some(Concern::TwoModes { centres, shares, .. }) => {
                assert!((shares[0] - 0.6).abs() < 0.05, "{shares:?}");
                assert!((centres[0] - 1.0).abs() < 0.05, "{centres:?}");
            }
            other => panic!("{samples} samples, seed {seed}: {other:?}"),
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn bent_cut_and_heavy_posteriors_have_one_mode() {
    use reference::{banana, bounded_ridge, gaussian, heavy_tail};
    for reference in [banana(), bounded_ridge(), heavy_tail(), gaussian(3, 0.8, 0.1)] {
        for (samples, seed) in (1..=6).flat_map(|seed| [(512, seed), (2048, seed), (8192, seed)]) {
            let said = modes(&reference, samples, seed);
            assert_eq!(said, None, "{}, {samples} samples, seed {seed}", reference.name);
        }
    }
    let simulator = line();
    for seed in 1..=6 {
        let settings = Settings { samples: 2048, seed, ..Settings::default() };
        let p = calibrate(&line_problem(&simulator, Noise::default()), &settings, &mut ()).unwrap();
        let concerns = p.trust().concerns;
        assert!(!concerns.iter().any(|c| matches!(c, Concern::TwoModes { .. })), "{concerns:?}");
    }
}

#[test]
fn two_parallel_ridges_that_no_single_parameter_tells_apart_are_two_modes() {
    // x + y is 0.5 or -0.5, x - y is anything.
    let simulator = FnSimulator::new(2, 1, |z: &[f64], out: &mut [f64]| {
        out[0] = (z[0] + z[1]).abs() - 0.5;
        Ok::<(), SimError>(())
    });
    let normal = || prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 });
    let problem = Problem {
        simulator: &simulator,
        parameters: ["x", "y"].map(|name| Parameter::new(name, "1", normal())).to_vec(),
        observations: Observations::new(vec![0.0], vec![0.0]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.05) },
    };
    let settings = Settings { samples: 4096, map_simulations: 0, ..Settings::default() };
    let concerns = calibrate(&problem, &settings, &mut ()).unwrap().trust().concerns;
    assert!(concerns.iter().any(|c| matches!(c, Concern::TwoModes { .. })), "{concerns:?}");
}

/// Normals of one sd and some shares; the evidence is 1.
struct Narrow {
    centres: Vec<Vec<f64>>,
    shares: Vec<f64>,
    sd: f64,
}

impl Target for Narrow {
    fn dimension(&self) -> usize {
        self.centres[0].len()
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        // The normalisation of prior and posterior are alike.
        let parts = self.centres.iter().zip(&self.shares).map(|(centre, share)| {
            let squares: f64 =
                z.iter().zip(centre).map(|(z, c)| ((z - c) / self.sd).powi(2) - z * z).sum();
            share.ln() - z.len() as f64 * self.sd.ln() - 0.5 * squares
        });
        let parts: Vec<f64> = parts.collect();
        let top = parts.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(top + parts.iter().map(|part| (part - top).exp()).sum::<f64>().ln())
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn no_mode_is_lost_that_a_part_of_the_budget_can_find() {
    let apart = |at: f64, sd: f64| Narrow {
        centres: vec![vec![-at; 2], vec![at; 2]],
        shares: vec![0.3, 0.7],
        sd,
    };
    let four = |sd: f64| {
        let [a, b] = [[-0.7, -0.7, 0.0, 0.0], [0.0, 0.0, -0.7, 0.7]];
        let opposite = |of: [f64; 4]| of.map(|x| -x).to_vec();
        let centres = vec![a.to_vec(), opposite(a), b.to_vec(), opposite(b)];
        Narrow { centres, shares: vec![0.25; 4], sd }
    };
    // Eight sds apart, forty apart, and four in four dimensions.
    let cases = [
        (apart(0.57, 0.2), Settings::for_budget(512)),
        (apart(0.28, 0.1), Settings::for_budget(512)),
        (apart(0.7, 0.05), Settings::for_budget(512)),
        (four(0.05), Settings::default()),
    ];
    for (case, settings) in cases {
        for seed in 1..=2 {
            let p = sample_density(&case, &Settings { seed, ..settings.clone() }).unwrap();
            // Without the smallest mode ln Z would be -0.29 or less.
            let error = p.log_evidence.value;
            assert!(error.abs() < 0.12, "sd {}, seed {seed}: {error}", case.sd);
        }
    }
}
