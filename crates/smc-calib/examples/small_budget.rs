//! Error of small budgets against exact answers: the default sampler, the small-budget one without the surrogate
//! and with it. `small_budget [SEEDS [SIMULATIONS,.. [PROBLEM [SAMPLER,..]]]]`
#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

use rayon::prelude::*;
use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::reference::{self, Reference};
use smc_calib::{
    Noise, Observations, Parameter, Prior, PriorSpec, Problem, Settings, SimError, Simulator,
    calibrate, sample_density,
};
use std::f64::consts::PI;

/// Neck growth of two particles in closed form: zipping to the knee, then stretching, then the end.
struct Neck {
    radius: f64,
    gamma: f64,
    young: f64,
    phi2: f64,
    times: Vec<f64>,
}

impl Simulator for Neck {
    fn parameters(&self) -> usize {
        3
    }
    fn observables(&self) -> usize {
        self.times.len()
    }
    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (c1, tau, dc) = (theta[0], theta[1], theta[2]);
        let r = self.radius;
        let a0 = (9.0 * PI * (2.0 * self.gamma) / (2.0 * self.young) / (2.0 * r)).cbrt();
        let x0 = (a0 * a0).max(1e-3);
        let b = 63.0 * PI.powi(3) / 16.0 * (dc / r).powi(2) * 2.0 * c1 * self.gamma / r;
        let ave = (63.0 * PI.powi(3)).powf(0.2) * (dc / (8.0 * r)).powf(0.4);
        let knee = (ave * ave).clamp(x0, self.phi2);
        let t_knee = (knee.powf(3.5) - x0.powf(3.5)) / b;
        for (o, t) in out.iter_mut().zip(&self.times) {
            let x = if *t <= t_knee {
                (x0.powf(3.5) + b * t).powf(2.0 / 7.0)
            } else {
                knee + (t - t_knee) / tau
            };
            *o = x.min(self.phi2).sqrt();
        }
        Ok(())
    }
}

enum Case {
    Density(Reference),
    Curve(Problem<'static>, Vec<f64>, Vec<f64>, f64),
}

/// Errors of the means (posterior sds), relative errors of the sds, error of the log evidence, and standard errors.
struct Errors {
    mean: Vec<f64>,
    sd: Vec<f64>,
    ln_z: f64,
    mean_se: Vec<f64>,
    khat: f64,
    ess: f64,
}

impl Case {
    fn run(&self, settings: &Settings) -> Option<Errors> {
        match self {
            Self::Density(r) => {
                let s = sample_density(r, settings).ok()?;
                let at = 0..r.mean.len();
                Some(Errors {
                    mean: at.clone().map(|j| (s.mean[j] - r.mean[j]) / r.sd[j]).collect(),
                    sd: at.clone().map(|j| s.sd[j] / r.sd[j] - 1.0).collect(),
                    ln_z: s.log_evidence.value - r.log_evidence,
                    mean_se: at.map(|j| s.mean_se[j] / r.sd[j]).collect(),
                    khat: s.khat,
                    ess: s.ess,
                })
            }
            Self::Curve(problem, mean, sd, ln_z) => {
                let p = calibrate(problem, settings, &mut ()).ok()?;
                let x = |j: usize| p.parameters[j].in_coordinate;
                let at = 0..mean.len();
                Some(Errors {
                    mean: at.clone().map(|j| (x(j).mean - mean[j]) / sd[j]).collect(),
                    sd: at.clone().map(|j| x(j).sd / sd[j] - 1.0).collect(),
                    ln_z: p.log_evidence.value - ln_z,
                    mean_se: at.map(|j| x(j).mean_se / sd[j]).collect(),
                    khat: p.khat,
                    ess: p.ess.importance,
                })
            }
        }
    }
}

fn cases() -> Vec<(String, Case)> {
    let mut all: Vec<(String, Case)> = [1, 2, 3, 4]
        .map(|d| (format!("Gaussian, {d} D"), Case::Density(reference::gaussian(d, 0.8, 0.1))))
        .into();
    for r in [
        reference::banana(),
        reference::bounded_ridge(),
        reference::two_modes(),
        reference::heavy_tail(),
    ] {
        all.push((r.name.to_owned(), Case::Density(r)));
    }
    type Range = (f64, f64);
    type Material = (&'static str, &'static str, f64, f64, f64, f64, Range, Range);
    let materials: [Material; 3] = [
        (
            "neck growth, PS",
            include_str!("../../../experiments/ps-r30.csv"),
            30.5e-6,
            1.6e9,
            0.035,
            1.08,
            (1e-6, 1e-1),
            (1e-2, 1.0),
        ),
        (
            "neck growth, PA12",
            include_str!("../../../experiments/pa12-r32.csv"),
            31.5e-6,
            1.65e9,
            0.0407,
            2f64.cbrt(),
            (1e-8, 1e-2),
            (0.5, 50.0),
        ),
        (
            "neck growth, PEEK",
            include_str!("../../../experiments/peek-450pf-r25.csv"),
            25e-6,
            2e9,
            0.041,
            2f64.cbrt(),
            (1e-9, 1e-3),
            (3.0, 300.0),
        ),
    ];
    for (name, text, radius, young, gamma, phi, c1, tau) in materials {
        let rows: Vec<(f64, f64)> = text
            .lines()
            .filter(|l| !l.starts_with('#') && !l.starts_with("time"))
            .map(|l| {
                let (a, b) = l.split_once(',').unwrap();
                (a.trim().parse().unwrap(), b.trim().parse().unwrap())
            })
            .collect();
        let times: Vec<f64> = rows.iter().map(|r| r.0).collect();
        let neck: &'static Neck = Box::leak(Box::new(Neck {
            radius,
            gamma,
            young,
            phi2: phi * phi,
            times: times.clone(),
        }));
        let prior = |(lower, upper)| Prior::new(PriorSpec::LogUniform { lower, upper }).unwrap();
        let problem = Problem {
            simulator: neck,
            parameters: vec![
                Parameter::new("C1", "1/(Pa s)", prior(c1)),
                Parameter::new("tau_s", "s", prior(tau)),
                Parameter::new("delta_c", "m", prior((1e-8, 3e-6))),
            ],
            observations: Observations::new(times, rows.iter().map(|r| r.1).collect()).unwrap(),
            noise: Noise::default(),
        };
        let q =
            quadrature(&problem, &QuadratureSettings { tolerance: 1e-2, max_points: 100 }).unwrap();
        all.push((name.to_owned(), Case::Curve(problem, q.mean, q.sd, q.log_evidence)));
    }
    all
}

/// Root mean square, errors above 10 counting as 10.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.map(|v| if v.abs() < 10.0 { v } else { 10.0 }).collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let seeds: u64 = args.get(1).map_or(50, |s| s.parse().unwrap());
    let budgets: Vec<usize> = args
        .get(2)
        .map_or(vec![50, 100, 300], |s| s.split(',').map(|n| n.parse().unwrap()).collect());
    let only = args.get(3).cloned().unwrap_or_default();
    let modes = args.get(4).cloned().unwrap_or_else(|| "0,1,2".to_owned());
    println!(
        "| problem | simulations | sampler | mean [posterior sd] | sd, relative | ln Z | spread of z | ESS | k-hat |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, case) in cases() {
        if !name.contains(&only) {
            continue;
        }
        for samples in &budgets {
            for (mode, label) in
                ["default", "small stages", "small stages, surrogate"].iter().enumerate()
            {
                if !modes.contains(&mode.to_string()) {
                    continue;
                }
                let base = match mode {
                    0 => Settings { samples: *samples, map_simulations: 0, ..Settings::default() },
                    1 => Settings { surrogate: false, ..Settings::for_budget(*samples) },
                    _ => Settings::for_budget(*samples),
                };
                let runs: Vec<Errors> = (1..=seeds)
                    .into_par_iter()
                    .filter_map(|seed| case.run(&Settings { seed, ..base.clone() }))
                    .collect();
                let lost = seeds as usize - runs.len();
                if runs.is_empty() {
                    continue;
                }
                let d = runs[0].mean.len();
                let worst = |pick: &dyn Fn(&Errors) -> &Vec<f64>| {
                    (0..d).map(|j| rms(runs.iter().map(|r| pick(r)[j]))).fold(0.0, f64::max)
                };
                let z = rms(runs.iter().map(|r| r.mean[0] / r.mean_se[0]));
                println!(
                    "| {name} | {samples} | {label} | {:.2} | {:.2} | {:.2} | {z:.1} | {:.0} | {:.2} |{}",
                    worst(&|r| &r.mean),
                    worst(&|r| &r.sd),
                    rms(runs.iter().map(|r| r.ln_z)),
                    median(runs.iter().map(|r| r.ess).collect()),
                    median(runs.iter().map(|r| r.khat).collect()),
                    if lost > 0 {
                        format!(" {lost} runs without an answer")
                    } else {
                        String::new()
                    }
                );
            }
        }
    }
}
