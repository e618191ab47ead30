//! What is looked for: the error against exact references, the honesty of error bars, ranks and coverage of
//! simulation-based calibration, and the evidence of the frozen stage against the pooled one.

use smc_calib::reference::{Reference, all, gaussian};
use smc_calib::sbc::{Band, Study, coverage_score, run};
use smc_calib::{
    DensitySummary, FnSimulator, Noise, Parameter, Prior, PriorSpec, Settings, SimError,
    sample_density,
};

/// What each check found; above one the check fails.
pub(crate) struct Found {
    /// RMS error of means and log evidence over what is allowed.
    pub references: f64,
    /// Spread of z-scores outside 0.75 .. 1.3.
    pub honesty: f64,
    /// Worst rank: ln p over ln 10^-4.
    pub ranks: f64,
    /// Worst coverage z-score over 4.
    pub coverage: f64,
}

impl Found {
    pub(crate) fn caught(&self) -> Vec<&'static str> {
        [
            ("exact references", self.references),
            ("error bars", self.honesty),
            ("ranks", self.ranks),
            ("coverage", self.coverage),
        ]
        .into_iter()
        .filter(|(_, size)| size.is_nan() || *size > 1.0)
        .map(|(name, _)| name)
        .collect()
    }
}

fn references() -> (f64, f64) {
    let targets: Vec<Reference> =
        vec![gaussian(2, 0.8, 0.1)].into_iter().chain(all().into_iter().skip(1).take(3)).collect();
    let (mut worst, mut scores, mut count) = (0f64, 0.0, 0.0);
    for target in &targets {
        let seeds = 10;
        let runs: Vec<DensitySummary> = (0..seeds)
            .filter_map(|seed| {
                let settings = Settings { samples: 2048, seed: 500 + seed, ..Settings::default() };
                sample_density(target, &settings).ok()
            })
            .collect();
        let n = runs.len() as f64;
        if runs.is_empty() {
            return (f64::NAN, f64::NAN);
        }
        let rms = |f: &dyn Fn(&DensitySummary) -> f64| {
            (runs.iter().map(|r| f(r).powi(2)).sum::<f64>() / n).sqrt()
        };
        worst = worst.max(rms(&|r| r.log_evidence.value - target.log_evidence) / 0.03);
        worst = worst.max(rms(&|r| r.log_evidence.pooled_value - target.log_evidence) / 0.03);
        for j in 0..target.mean.len() {
            worst = worst.max(rms(&|r| (r.mean[j] - target.mean[j]) / target.sd[j]) / 0.05);
            worst = worst.max(rms(&|r| r.sd[j] / target.sd[j] - 1.0) / 0.05);
            for r in &runs {
                scores += ((r.mean[j] - target.mean[j]) / r.mean_se[j]).powi(2);
                scores +=
                    ((r.log_evidence.value - target.log_evidence) / r.log_evidence.se).powi(2);
                count += 2.0;
            }
        }
    }
    let spread: f64 = (scores / count).sqrt() / (15f64 / 13.0).sqrt();
    // On a logarithmic scale: 1 at 0.75 and 1.3.
    (worst, spread.ln().abs() / 1.3f64.ln())
}

fn line_study() -> (f64, f64) {
    let times: Vec<f64> = (0..8).map(|i| 0.125 * f64::from(i)).collect();
    let at = times.clone();
    let simulator = FnSimulator::new(2, 8, move |theta: &[f64], out: &mut [f64]| {
        for (o, t) in out.iter_mut().zip(&at) {
            *o = theta[0] + theta[1] * t;
        }
        Ok::<(), SimError>(())
    });
    let normal = |sd| Prior::new(PriorSpec::Normal { mean: 0.0, sd }).unwrap();
    let study = Study {
        simulator: &simulator,
        parameters: vec![
            Parameter::new("a", "1", normal(1.0)),
            Parameter::new("b", "1", normal(2.0)),
        ],
        control: times,
        noise: Noise::Inferred { nu0: 4.0, s0: 0.3 },
        origin: None,
        settings: Settings { samples: 1024, draws: 256, seed: 9000, ..Settings::default() },
        data_sets: 400,
    };
    let Ok(outcomes) = run(&study) else { return (f64::NAN, f64::NAN) };
    let band = Band::new(outcomes.len(), 0.95);
    let mut least = 1f64;
    for q in 0..outcomes[0].ranks.len() {
        let ranks: Vec<f64> = outcomes.iter().map(|o| o.ranks[q]).collect();
        let p = band.p_value(&ranks);
        if std::env::var("SBC_DETAIL").is_ok() {
            let c = smc_calib::sbc::counts(&ranks);
            println!("{q} p {p:.3e}: {:?} of {}", [c[4], c[24], c[49], c[74], c[94]], ranks.len());
        }
        least = least.min(p);
    }
    let mut worst = 0f64;
    for j in 0..3 {
        let hits = |f: &dyn Fn(usize) -> bool| (0..outcomes.len()).filter(|i| f(*i)).count();
        let n = outcomes.len();
        worst = worst.max(coverage_score(hits(&|i| outcomes[i].inside50[j]), n, 0.5).abs());
        worst = worst.max(coverage_score(hits(&|i| outcomes[i].inside95[j]), n, 0.95).abs());
    }
    (least.max(1e-300).ln() / 1e-4f64.ln(), worst / 4.0)
}

/// All checks of the crate as it is compiled.
pub(crate) fn look() -> Found {
    let (references, honesty) = references();
    let (ranks, coverage) = line_study();
    Found { references, honesty, ranks, coverage }
}
