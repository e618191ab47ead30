//! Memory of a calibration, in a process of its own: the highest mark of a process is what all its tests took.
#![allow(missing_docs, clippy::unwrap_used)]

use smc_calib::{
    FnSimulator, Noise, Observations, Parameter, Prior, PriorSpec, Problem, Settings, calibrate,
};

/// A line of `/proc/self/status` \[bytes\]; none where there is no such file.
fn status(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| 1024.0 * kib)
}

/// A curve is 44 numbers, 352 bytes a sample; everything else may take as much again. A million such samples are
/// 0.7 GiB.
#[test]
fn the_curves_of_all_samples_are_held_once() {
    const SAMPLES: usize = 200_000;
    const OBSERVATIONS: usize = 44;
    let time = |i: usize| i as f64 / OBSERVATIONS as f64;
    let curve = |a: f64, b: f64, c: f64, t: f64| a * (1.0 - (-b * t).exp()) + c * t;
    let simulator = FnSimulator::new(3, OBSERVATIONS, |theta: &[f64], out: &mut [f64]| {
        for (i, o) in out.iter_mut().enumerate() {
            *o = curve(theta[0], theta[1], theta[2], time(i));
        }
        Ok(())
    });
    let times: Vec<f64> = (0..OBSERVATIONS).map(time).collect();
    let scatter = |i: usize| 0.02 * (7.0 * i as f64).sin();
    let values = (0..OBSERVATIONS).map(|i| curve(1.0, 3.0, 0.1, time(i)) + scatter(i)).collect();
    let prior = |lower, upper| Prior::new(PriorSpec::LogUniform { lower, upper }).unwrap();
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![
            Parameter::new("a", "1", prior(0.1, 10.0)),
            Parameter::new("b", "1/s", prior(0.1, 30.0)),
            Parameter::new("c", "1/s", prior(0.001, 1.0)),
        ],
        observations: Observations::new(times, values).unwrap(),
        noise: Noise::default(),
    };
    let settings = Settings { samples: SAMPLES, ..Settings::default() };
    let two_threads = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let before = status("VmRSS");
    let posterior = two_threads.install(|| calibrate(&problem, &settings, &mut ()).unwrap());
    assert_eq!(posterior.samples.len(), SAMPLES);
    let (Some(before), Some(peak)) = (before, status("VmHWM")) else {
        eprintln!("not measured here: no /proc/self/status");
        return;
    };
    let per_sample = (peak - before) / SAMPLES as f64;
    eprintln!("{per_sample:.0} bytes a sample");
    assert!((352.0..740.0).contains(&per_sample), "{per_sample:.0} bytes a sample");
}
