//! A constant under correlated errors of known correlation has a posterior by dense linear algebra.

use nalgebra::{DMatrix, DVector};
use smc_calib::{
    DistanceScale, FnSimulator, Noise, NoiseShape, Observations, Parameter, Prior, PriorSpec,
    Problem, Settings, SimError, calibrate,
};
use statrs::function::gamma::ln_gamma;

const NU0: f64 = 4.0;
const S0: f64 = 0.05;

fn data() -> Observations {
    let control: Vec<f64> = (0..10).map(|k| 0.2 * f64::from(k) + 0.01 * f64::from(k * k)).collect();
    let values = (0..10).map(|k| 0.4 + 0.08 * (0.7 * f64::from(k)).sin()).collect();
    Observations::new(control, values).unwrap()
}

/// Log evidence, mean and standard deviation of `mu ~ N(0, 1)`, `y ~ t(mu, K)`, by the trapezoidal rule.
fn exact(data: &Observations, length: f64, white: f64) -> [f64; 3] {
    let (s, m) = (data.control(), data.len() as f64);
    let k = DMatrix::from_fn(s.len(), s.len(), |i, j| {
        let own = if i == j { white } else { 0.0 };
        own + (1.0 - white) * (-(s[i] - s[j]).abs() / length).exp()
    });
    let factor = k.cholesky().unwrap();
    let ln_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let sum0 = NU0 * S0 * S0;
    let ln_density = |mu: f64| {
        let r = DVector::from_iterator(s.len(), data.values().iter().map(|v| v - mu));
        let squares = r.dot(&factor.solve(&r));
        ln_gamma(0.5 * (NU0 + m))
            - ln_gamma(0.5 * NU0)
            - 0.5 * m * (std::f64::consts::PI * sum0).ln()
            - 0.5 * ln_det
            - 0.5 * (NU0 + m) * (squares / sum0).ln_1p()
            - 0.5 * mu * mu
            - 0.5 * (2.0 * std::f64::consts::PI).ln()
    };
    let step = 1e-4;
    let mut sums = [0.0; 3];
    for i in -60_000..60_000 {
        let mu = step * f64::from(i);
        let density = ln_density(mu).exp() * step;
        sums = [sums[0] + density, sums[1] + density * mu, sums[2] + density * mu * mu];
    }
    let mean = sums[1] / sums[0];
    [sums[0].ln(), mean, (sums[2] / sums[0] - mean * mean).sqrt()]
}

#[test]
fn the_posterior_of_a_constant_under_errors_of_known_correlation_is_that_of_linear_algebra() {
    let data = data();
    let constant = FnSimulator::new(1, data.len(), |theta: &[f64], out: &mut [f64]| {
        out.fill(theta[0]);
        Ok::<(), SimError>(())
    });
    // One node: a tenth of the range (the middle of 1 to 100 % in the logarithm), and the share of 0.5^3.
    let range = data.control()[9] - data.control()[0];
    let (length, white) = (0.1 * range, 0.125);
    let problem = Problem {
        simulator: &constant,
        parameters: vec![Parameter::new(
            "mu",
            "1",
            Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 }).unwrap(),
        )],
        observations: data.clone(),
        noise: Noise::Correlated {
            nu0: NU0,
            s0: S0,
            scale: Some(DistanceScale::Linear),
            nodes: Some([1, 1]),
        },
    };
    let [log_evidence, mean, sd] = exact(&data, length, white);
    let found =
        calibrate(&problem, &Settings { samples: 8192, ..Settings::default() }, &mut ()).unwrap();
    let mu = found.parameters[0].in_coordinate;
    assert!((found.log_evidence.value - log_evidence).abs() < 0.01, "{:?}", found.log_evidence);
    assert!((mu.mean - mean).abs() < 0.02 * sd && (mu.sd / sd - 1.0).abs() < 0.02, "{mu:?}");
    for draw in &found.draws {
        let Some(NoiseShape::Correlated { length: l, white_share: w }) = draw.shape else {
            panic!("draws of correlated noise have a shape");
        };
        assert!((l / length - 1.0).abs() < 1e-12 && (w - white).abs() < 1e-12);
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn truths_drawn_with_correlated_errors_have_even_ranks() {
    use smc_calib::sbc::{Band, Study, coverage_score, intervals, quantities, run};
    let control: Vec<f64> = (0..16).map(|k| 0.25 * f64::from(k)).collect();
    let times = control.clone();
    let line = FnSimulator::new(2, 16, move |theta: &[f64], out: &mut [f64]| {
        for (o, t) in out.iter_mut().zip(&times) {
            *o = theta[0] + theta[1] * t;
        }
        Ok::<(), SimError>(())
    });
    let normal = || Prior::new(PriorSpec::Normal { mean: 0.0, sd: 0.5 }).unwrap();
    let noise = Noise::Correlated { nu0: 4.0, s0: 0.3, scale: None, nodes: None };
    let parameters = vec![Parameter::new("a", "1", normal()), Parameter::new("b", "1", normal())];
    let names = quantities(&parameters, &noise);
    let covered = intervals(&parameters, &noise);
    let study = Study {
        simulator: &line,
        parameters,
        control,
        noise,
        origin: None,
        settings: Settings { samples: 1024, draws: 256, seed: 40, ..Settings::default() },
        data_sets: 100,
    };
    let outcomes = run(&study).unwrap();
    let band = Band::new(outcomes.len(), 0.95);
    for (q, name) in names.iter().enumerate() {
        let ranks: Vec<f64> = outcomes.iter().map(|o| o.ranks[q]).collect();
        let p = band.p_value(&ranks);
        eprintln!("{name}: p = {p:.3}");
        assert!(p > 1e-3, "{name}: p = {p}");
    }
    for (j, name) in covered.iter().enumerate() {
        let hits =
            |holds: &dyn Fn(usize) -> bool| (0..outcomes.len()).filter(|k| holds(*k)).count();
        let half = coverage_score(hits(&|k| outcomes[k].inside50[j]), outcomes.len(), 0.5);
        let most = coverage_score(hits(&|k| outcomes[k].inside95[j]), outcomes.len(), 0.95);
        eprintln!("{name}: 50 % off by {half:+.1}, 95 % by {most:+.1} standard errors");
        assert!(half.abs() < 3.9 && most.abs() < 3.9, "{name}: {half} {most}");
    }
}
