//! Error of the sampler against quadrature over seeds, on the measured neck-growth curves.
#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used)]

use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::{
    Noise, Observations, Parameter, Prior, PriorSpec, Problem, Settings, SimError, Simulator,
};
use std::f64::consts::PI;
use std::time::Instant;

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

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let folder = &args[1];
    let seeds: u64 = args[2].parse().unwrap();
    let sizes: Vec<usize> = args[3].split(',').map(|s| s.parse().unwrap()).collect();
    let only = args.get(4).cloned().unwrap_or_default();
    for (name, file, r, e, g, phi, c1, tau) in [
        ("ps", "ps-r30.csv", 30.5e-6, 1.6e9, 0.035, 1.08, (1e-6, 1e-1), (1e-2, 1.0)),
        ("pa12", "pa12-r32.csv", 31.5e-6, 1.65e9, 0.0407, 2f64.cbrt(), (1e-8, 1e-2), (0.5, 50.0)),
        ("peek", "peek-450pf-r25.csv", 25e-6, 2e9, 0.041, 2f64.cbrt(), (1e-9, 1e-3), (3.0, 300.0)),
    ] {
        if !only.is_empty() && !only.contains(name) {
            continue;
        }
        let text = std::fs::read_to_string(format!("{folder}/{file}")).unwrap();
        let rows: Vec<(f64, f64)> = text
            .lines()
            .filter(|l| !l.starts_with('#') && !l.starts_with("time"))
            .map(|l| {
                let (a, b) = l.split_once(',').unwrap();
                (a.trim().parse().unwrap(), b.trim().parse().unwrap())
            })
            .collect();
        let times: Vec<f64> = rows.iter().map(|r| r.0).collect();
        let neck = Neck { radius: r, gamma: g, young: e, phi2: phi * phi, times: times.clone() };
        let prior = |(lower, upper)| Prior::new(PriorSpec::LogUniform { lower, upper }).unwrap();
        let problem = Problem {
            simulator: &neck,
            parameters: vec![
                Parameter::new("C1", "1/(Pa s)", prior(c1)),
                Parameter::new("tau_s", "s", prior(tau)),
                Parameter::new("delta_c", "m", prior((1e-8, 3e-6))),
            ],
            observations: Observations::new(times, rows.iter().map(|r| r.1).collect()).unwrap(),
            noise: Noise::default(),
        };
        let start = Instant::now();
        let exact =
            quadrature(&problem, &QuadratureSettings { tolerance: 1e-3, max_points: 200 }).unwrap();
        println!(
            "{name}: quadrature {:.2?} mean {:?} sd {:?} lnZ {} err {:.1e} evals {}",
            start.elapsed(),
            exact.mean,
            exact.sd,
            exact.log_evidence,
            exact.error,
            exact.evaluations
        );
        for &samples in &sizes {
            let (mut dm, mut ds) = (vec![0.0; 3], vec![0.0; 3]);
            let (mut dz, mut kh, mut ess, mut time) = (0.0, 0f64, 0.0, 0.0);
            let (mut worst, mut zz, mut ze, mut zs) = (0f64, 0.0, 0.0, 0.0);
            let mut comps: Vec<usize> = vec![];
            let mut em = 0;
            let first: u64 = std::env::var("FIRST").map_or(1, |v| v.parse().unwrap());
            for seed in first..first + seeds {
                let settings: Settings = Settings { samples, seed, ..tuned() };
                let start = Instant::now();
                let s = smc_calib::calibrate(&problem, &settings, &mut ()).unwrap();
                time += start.elapsed().as_secs_f64();
                for j in 0..3 {
                    let q = s.parameters[j].in_coordinate;
                    let e = (q.mean - exact.mean[j]) / exact.sd[j];
                    dm[j] += e * e;
                    worst = worst.max(e.abs());
                    ds[j] += (q.sd / exact.sd[j] - 1.0).powi(2);
                    zz += ((q.mean - exact.mean[j]) / q.mean_se).powi(2) / 3.0;
                    zs += ((q.sd - exact.sd[j]) / q.sd_se).powi(2) / 3.0;
                }
                dz += (s.log_evidence.value - exact.log_evidence).powi(2);
                ze += ((s.log_evidence.value - exact.log_evidence) / s.log_evidence.se).powi(2);
                if std::env::var("MAP").is_ok() {
                    let x: Vec<f64> = s.map.theta.iter().map(|t| t.log10()).collect();
                    println!("  map {x:?} {} {}", s.map.log_likelihood, s.map.simulations);
                }
                kh = kh.max(s.khat);
                ess += s.ess.importance;
                comps = s.stages.iter().map(|s| s.proposal.components.len()).collect();
                em = s.counters.em_iterations;
            }
            let n = seeds as f64;
            let rms = |v: &[f64]| v.iter().map(|v| (v / n).sqrt()).fold(0.0, f64::max);
            println!(
                "{name} {samples:6}: mean {:.4} (worst {worst:.3}) sd {:.2} % lnZ {:.4} khat {kh:.2} ess {:.0} time {:.1} ms  z: {:.2} {:.2} {:.2} em {em} K {comps:?}",
                rms(&dm),
                100.0 * rms(&ds),
                (dz / n).sqrt(),
                ess / n,
                1e3 * time / n,
                (zz / n / 1.154).sqrt(),
                (zs / n / 1.154).sqrt(),
                (ze / n / 1.154).sqrt()
            );
        }
    }
}

/// The defaults, with what the environment overrides.
fn tuned() -> Settings {
    let mut s = Settings::default();
    let get = |k: &str| std::env::var(k).ok().and_then(|v| v.parse::<f64>().ok());
    if let Some(v) = get("ITER") {
        s.iterations = v as usize;
    }
    if let Some(v) = get("FINAL") {
        s.final_share = v;
    }
    if let Some(v) = get("TEMPER") {
        s.tempering_share = v;
    }
    if let Some(v) = get("K") {
        s.max_components = v as usize;
    }
    if let Some(v) = get("WIDEN") {
        s.widening = v;
    }
    if let Some(v) = get("DEF") {
        s.defensive_share = v;
    }
    if let Some(v) = get("NU") {
        s.degrees_of_freedom = v;
    }
    if let Some(v) = get("PATCH") {
        s.patches = v as usize;
    }
    if let Some(v) = get("REP") {
        s.replicates = v as usize;
    }
    s
}
