//! Error of the sampler over seeds, and honesty of its error bars: three measured neck-growth curves against
//! quadrature and three reference problems.
//!
//! `cargo run --release -p smc-calib --example accuracy -- experiments 100 4096,16384 [problem,problem]`
#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

use rayon::prelude::*;
use smc_calib::quadrature::{QuadratureSettings, integrate};
use smc_calib::reference::{self, Reference};
use smc_calib::{
    DensitySummary, Likelihood, Noise, Observations, Prior, PriorSpec, Settings, SimError, Target,
    sample_density_in,
};
use std::f64::consts::PI;
use std::time::Instant;

struct Neck {
    radius: f64,
    gamma: f64,
    young: f64,
    phi2: f64,
    times: Vec<f64>,
    priors: Vec<Prior>,
    likelihood: Likelihood,
}

impl Target for Neck {
    fn dimension(&self) -> usize {
        3
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let theta: Vec<f64> = self.priors.iter().zip(z).map(|(p, z)| p.from_z(*z)).collect();
        let (c1, tau, dc) = (theta[0], theta[1], theta[2]);
        let r = self.radius;
        let a0 = (9.0 * PI * (2.0 * self.gamma) / (2.0 * self.young) / (2.0 * r)).cbrt();
        let x0 = (a0 * a0).max(1e-3);
        let b = 63.0 * PI.powi(3) / 16.0 * (dc / r).powi(2) * 2.0 * c1 * self.gamma / r;
        let ave = (63.0 * PI.powi(3)).powf(0.2) * (dc / (8.0 * r)).powf(0.4);
        let knee = (ave * ave).clamp(x0, self.phi2);
        let t_knee = (knee.powf(3.5) - x0.powf(3.5)) / b;
        let curve: Vec<f64> = self
            .times
            .iter()
            .map(|t| {
                let x = if *t <= t_knee {
                    (x0.powf(3.5) + b * t).powf(2.0 / 7.0)
                } else {
                    knee + (t - t_knee) / tau
                };
                x.min(self.phi2).sqrt()
            })
            .collect();
        Ok(self.likelihood.ln_joint(&curve))
    }
}

struct Case {
    name: String,
    target: Box<dyn Target>,
    coordinate: Box<dyn Fn(usize, f64) -> f64 + Sync>,
    mean: Vec<f64>,
    sd: Vec<f64>,
    ln_z: f64,
}

impl Case {
    fn reference(name: &str, reference: Reference) -> Self {
        Self {
            name: name.into(),
            mean: reference.mean.clone(),
            sd: reference.sd.clone(),
            ln_z: reference.log_evidence,
            coordinate: Box::new(|_, z| z),
            target: Box::new(reference),
        }
    }

    /// Radius, Young's modulus, surface energy and phi, and the ranges of C1 and tau.
    fn neck(name: &str, text: &str, material: [f64; 4], ranges: [(f64, f64); 2]) -> Self {
        let [radius, young, gamma, phi] = material;
        let [c1, tau] = ranges;
        let rows: Vec<(f64, f64)> = text
            .lines()
            .filter(|l| !l.starts_with('#') && !l.starts_with("time"))
            .map(|l| {
                let (a, b) = l.split_once(',').unwrap();
                (a.trim().parse().unwrap(), b.trim().parse().unwrap())
            })
            .collect();
        let times: Vec<f64> = rows.iter().map(|r| r.0).collect();
        let values = rows.iter().map(|r| r.1).collect();
        let observations = Observations::new(times.clone(), values).unwrap();
        let priors: Vec<Prior> = [c1, tau, (1e-8, 3e-6)]
            .into_iter()
            .map(|(lower, upper)| Prior::new(PriorSpec::LogUniform { lower, upper }).unwrap())
            .collect();
        let neck = Neck {
            radius,
            gamma,
            young,
            phi2: phi * phi,
            times,
            priors: priors.clone(),
            likelihood: Likelihood::new(&Noise::default(), &observations).unwrap(),
        };
        let coordinate = move |j: usize, z: f64| priors[j].to_coordinate(priors[j].from_z(z));
        let settings = QuadratureSettings { tolerance: 2e-4, max_points: 200 };
        let exact = integrate(&neck, &coordinate, &settings).unwrap();
        Self {
            name: name.into(),
            target: Box::new(neck),
            coordinate: Box::new(coordinate),
            mean: exact.mean,
            sd: exact.sd,
            ln_z: exact.log_evidence,
        }
    }
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let seeds: u64 = args[2].parse().unwrap();
    let sizes: Vec<usize> = args[3].split(',').map(|s| s.parse().unwrap()).collect();
    let only = args.get(4).cloned().unwrap_or_default();
    let asked = |name: &str| only.is_empty() || only.split(',').any(|o| o == name);
    let mut cases = Vec::new();
    for (name, file, r, e, g, phi, c1, tau) in [
        ("ps", "ps-r30.csv", 30.5e-6, 1.6e9, 0.035, 1.08, (1e-6, 1e-1), (1e-2, 1.0)),
        ("pa12", "pa12-r32.csv", 31.5e-6, 1.65e9, 0.0407, 2f64.cbrt(), (1e-8, 1e-2), (0.5, 50.0)),
        ("peek", "peek-450pf-r25.csv", 25e-6, 2e9, 0.041, 2f64.cbrt(), (1e-9, 1e-3), (3.0, 300.0)),
    ] {
        if asked(name) {
            let text = std::fs::read_to_string(format!("{}/{file}", args[1])).unwrap();
            cases.push(Case::neck(name, &text, [r, e, g, phi], [c1, tau]));
        }
    }
    for (name, reference) in [
        ("banana", reference::banana()),
        ("two", reference::two_modes()),
        ("heavy", reference::heavy_tail()),
        ("gauss", reference::gaussian(3, 0.8, 0.1)),
    ] {
        if asked(name) {
            cases.push(Case::reference(name, reference));
        }
    }
    for samples in sizes {
        cases.iter().for_each(|case| report(case, samples, seeds));
    }
}

fn report(case: &Case, samples: usize, seeds: u64) {
    let d = case.mean.len();
    let start = Instant::now();
    let runs: Vec<DensitySummary> = (1..=seeds)
        .into_par_iter()
        .map(|seed| {
            let settings = Settings { samples, seed, ..tuned() };
            sample_density_in(&*case.target, &*case.coordinate, &settings).unwrap()
        })
        .collect();
    let n = seeds as f64;
    let ms = 1e3 * start.elapsed().as_secs_f64() / n;
    let rms = |f: &dyn Fn(&DensitySummary) -> f64| {
        (runs.iter().map(|r| f(r).powi(2)).sum::<f64>() / n).sqrt()
    };
    let each = |f: &dyn Fn(&DensitySummary, usize) -> f64| -> (f64, f64) {
        let all: Vec<f64> = (0..d).map(|j| rms(&|r| f(r, j))).collect();
        (all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(0.0, f64::max))
    };
    // 16 sub-nets: t with 15 degrees of freedom.
    let t = (13f64 / 15.0).sqrt();
    let z_mean = each(&|r, j| t * (r.mean[j] - case.mean[j]) / r.mean_se[j]);
    let z_sd = each(&|r, j| t * (r.sd[j] - case.sd[j]) / r.sd_se[j]);
    let bias = runs.iter().map(|r| r.log_evidence.value - case.ln_z).sum::<f64>() / n;
    println!(
        "{:6} {samples:6}: mean {:.5} sd {:.3} % lnZ {:.5} (bias {bias:+.5}) frozen {:.5} pooled {:.5} | z: {:.2} {:.2}, {:.2} {:.2}, {:.2} | k-hat {:.2} ess {:.0} {ms:.1} ms",
        case.name,
        each(&|r, j| (r.mean[j] - case.mean[j]) / case.sd[j]).1,
        100.0 * each(&|r, j| r.sd[j] / case.sd[j] - 1.0).1,
        rms(&|r| r.log_evidence.value - case.ln_z),
        rms(&|r| r.log_evidence.frozen_value - case.ln_z),
        rms(&|r| r.log_evidence.pooled_value - case.ln_z),
        z_mean.0,
        z_mean.1,
        z_sd.0,
        z_sd.1,
        t * rms(&|r| (r.log_evidence.value - case.ln_z) / r.log_evidence.se),
        runs.iter().map(|r| r.khat).fold(0.0, f64::max),
        runs.iter().map(|r| r.ess).sum::<f64>() / n,
    );
}

/// The defaults, with what the environment overrides.
fn tuned() -> Settings {
    let mut s = Settings::default();
    let get = |k: &str| std::env::var(k).ok().and_then(|v| v.parse::<f64>().ok());
    for (name, setting) in [
        ("FINAL", &mut s.final_share),
        ("TEMPER", &mut s.tempering_share),
        ("WIDEN", &mut s.widening),
        ("DEF", &mut s.defensive_share),
        ("NU", &mut s.degrees_of_freedom),
    ] {
        *setting = get(name).unwrap_or(*setting);
    }
    for (name, setting) in [
        ("ITER", &mut s.iterations),
        ("K", &mut s.max_components),
        ("PATCH", &mut s.patches),
        ("REP", &mut s.replicates),
    ] {
        *setting = get(name).map_or(*setting, |v| v as usize);
    }
    s
}
