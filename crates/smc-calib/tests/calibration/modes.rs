//! Two modes are said in words where there are two, and only there.

use crate::support::{line, line_problem, prior};
use smc_calib::reference::{self, Reference};
use smc_calib::{
    Concern, FixedSigma, FnSimulator, Noise, Observations, Parameter, PriorSpec, Problem, Settings,
    SimError, Target as _, calibrate,
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
