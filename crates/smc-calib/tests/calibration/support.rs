use smc_calib::{
    FnSimulator, Noise, Observations, Parameter, Prior, PriorSpec, Problem, SimError, Simulator,
};

pub(crate) fn prior(spec: PriorSpec) -> Prior {
    Prior::new(spec).unwrap()
}

/// A straight line `a + b t` over 12 times in [0, 1.1], made with a = 0.3, b = 1.2 and a fixed wiggle.
pub(crate) fn line_data() -> Observations {
    let times: Vec<f64> = (0..12).map(|i| 0.1 * f64::from(i)).collect();
    let values = times
        .iter()
        .enumerate()
        .map(|(i, t)| 0.3 + 1.2 * t + 0.05 * (2.4 * i as f64).sin())
        .collect();
    Observations::new(times, values).unwrap()
}

pub(crate) fn line() -> impl Simulator {
    FnSimulator::new(2, 12, |theta: &[f64], out: &mut [f64]| {
        for (i, o) in out.iter_mut().enumerate() {
            *o = theta[0] + theta[1] * 0.1 * i as f64;
        }
        Ok::<(), SimError>(())
    })
}

pub(crate) fn line_problem(simulator: &dyn Simulator, noise: Noise) -> Problem<'_> {
    Problem {
        simulator,
        parameters: vec![
            Parameter::new("a", "1", prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 })),
            Parameter::new("b", "1/s", prior(PriorSpec::Normal { mean: 0.0, sd: 2.0 })),
        ],
        observations: line_data(),
        noise,
    }
}
