//! The sampler against its promises, over many seeds: error at a budget, honesty of its own error bars, and the
//! unbiased evidence of the frozen stage.

use std::fmt::Write as _;
use std::time::Instant;

use super::calibration::chosen;
use super::cases::{Case, Errors, Run};
use super::report::{self, Header, Table};
use super::spread::{Spreads, over_seeds};
use crate::args::CalibrationArgs;
use workbench::error::Failure;
use workbench::number::significant;
use workbench::output;

const SEEDS: u64 = 1000;
/// Replicates that error bars come from, less one: what a z-score is Student-t distributed with.
const FREEDOM: f64 = 15.0;
/// Standard deviation that honest z-scores may have.
const HONEST: [f64; 2] = [0.9, 1.1];

/// Root mean square errors that are wished for at a budget.
struct Reach {
    samples: usize,
    /// Mean, sd, log evidence.
    errors: [f64; 3],
}

const REACHES: [Reach; 2] = [
    Reach { samples: 4096, errors: [0.013, 0.017, 0.005] },
    Reach { samples: 16_384, errors: [0.003, 0.005, 0.001] },
];

/// Standard deviations of z-scores, and the mean of the evidence over its true value.
#[derive(Debug, Clone, PartialEq)]
struct Honesty {
    /// Smallest and largest over the parameters.
    mean: [f64; 2],
    sd: [f64; 2],
    log_evidence: f64,
    /// Mean over the seeds of the frozen stage's evidence over the exact one, and its standard error.
    frozen: [f64; 2],
}

impl Honesty {
    fn of(case: &Case, runs: &[Run]) -> Self {
        let d = case.exact.mean.len();
        let rms = |score: &dyn Fn(&Run) -> f64| {
            let squares: f64 = runs.iter().map(|run| score(run).powi(2)).sum();
            // A t of nu degrees of freedom has variance nu/(nu - 2).
            (squares / runs.len() as f64 * (FREEDOM - 2.0) / FREEDOM).sqrt()
        };
        let over = |score: &dyn Fn(&Run, usize) -> f64| {
            let all: Vec<f64> = (0..d).map(|j| rms(&|run| score(run, j))).collect();
            [
                all.iter().copied().fold(f64::INFINITY, f64::min),
                all.iter().copied().fold(0.0, f64::max),
            ]
        };
        let exact = &case.exact;
        let ratios: Vec<f64> =
            runs.iter().map(|run| (run.frozen_log_evidence - exact.log_evidence).exp()).collect();
        let n = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / n;
        let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self {
            mean: over(&|run, j| (run.estimate.mean[j] - exact.mean[j]) / run.mean_se[j]),
            sd: over(&|run, j| (run.estimate.sd[j] - exact.sd[j]) / run.sd_se[j]),
            log_evidence: rms(&|run| {
                let found = run.estimate.log_evidence.unwrap_or(f64::NAN);
                (found - exact.log_evidence) / run.log_evidence_se
            }),
            frozen: [mean, (variance / n).sqrt()],
        }
    }

    /// What is not as promised.
    fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        let named =
            [("mean", self.mean), ("sd", self.sd), ("log evidence", [self.log_evidence; 2])];
        for (what, [low, high]) in named {
            if low.is_nan() || high.is_nan() || low < HONEST[0] || high > HONEST[1] {
                failures.push(format!(
                    "z-scores of the {what} have sd {} to {}",
                    significant(low, 3),
                    significant(high, 3)
                ));
            }
        }
        let [mean, se] = self.frozen;
        if mean.is_nan() || (mean - 1.0).abs() > 3.0 * se {
            failures.push(format!(
                "the frozen evidence is {} of the true one, {} standard errors off",
                significant(mean, 5),
                significant((mean - 1.0) / se, 3)
            ));
        }
        failures
    }
}

pub(super) fn run(args: &CalibrationArgs) -> Result<(), Failure> {
    report::folder(&args.out)?;
    let seeds = args.seeds.unwrap_or(SEEDS);
    let header = Header::now("studies calibration --full");
    let start = Instant::now();
    let mut table = Table::new(&[
        "problem",
        "simulations",
        "seeds",
        "rms error of mean",
        "reach",
        "of sd",
        "reach",
        "of log evidence",
        "reach",
        "sd of z: means",
        "sds",
        "log evidence",
        "frozen Z/exact Z",
        "standard error",
        "reached",
    ]);
    let mut text = String::new();
    for case in chosen(args.only.as_deref())? {
        for reach in &REACHES {
            eprintln!("{}, {} simulations", case.title, reach.samples);
            let runs = over_seeds(seeds, &|seed| case.run(reach.samples, seed))?;
            let errors: Vec<Errors> =
                runs.iter().map(|run| Errors::of(&case.exact, &run.estimate)).collect();
            let rms = Spreads::new(&errors).of.map(|s| s.map_or(f64::NAN, |s| s.rms));
            let honesty = Honesty::of(&case, &runs);
            let mut failures = honesty.failures();
            for ((what, found), wished) in
                ["mean", "sd", "log evidence"].into_iter().zip(rms).zip(reach.errors)
            {
                if found.is_nan() || found > wished {
                    failures.push(format!(
                        "error of the {what} {}, {} times the wish",
                        significant(found, 2),
                        significant(found / wished, 2)
                    ));
                }
            }
            let range = |[low, high]: [f64; 2]| {
                format!("{} to {}", significant(low, 3), significant(high, 3))
            };
            let mut row = vec![case.name.clone(), reach.samples.to_string(), seeds.to_string()];
            for (found, wished) in rms.into_iter().zip(reach.errors) {
                row.extend([significant(found, 3), wished.to_string()]);
            }
            row.extend([
                range(honesty.mean),
                range(honesty.sd),
                significant(honesty.log_evidence, 3),
                format!("{:.5}", honesty.frozen[0]),
                significant(honesty.frozen[1], 2),
                if failures.is_empty() { "yes" } else { "no" }.to_owned(),
            ]);
            table.push(row);
            if !failures.is_empty() {
                let _ = writeln!(
                    text,
                    "- {}, {} simulations: {}.",
                    case.title,
                    reach.samples,
                    failures.join("; ")
                );
            }
        }
    }
    if text.is_empty() {
        text = "Everything is reached.\n".to_owned();
    }
    output::write_file(&args.out.join("sampler.csv"), table.csv(&header).as_bytes())?;
    let page = format!(
        "# The sampler against its promises\n\n{}- run time: {}\n\n{TEXT}\n{}\n## Missed\n\n{text}",
        header.lines("- "),
        report::seconds(start.elapsed().as_secs_f64()),
        table.markdown(),
    );
    output::write_file(&args.out.join("sampler.md"), page.as_bytes())?;
    Ok(())
}

const TEXT: &str = "\
Root mean square errors over the seeds, of the worst parameter, in units of the exact posterior. As many perfect
independent draws as simulations would give 0.0078 and 0.55 % at 16 384, 0.016 and 1.1 % at 4096.

z-score: error over the standard error that the run itself reports. Its root mean square, divided by
sqrt(15/13) for the 16 replicates the standard error comes from, is 1 where error bars are honest (0.9 to 1.1 is asked for); smallest
and largest over the parameters. The evidence of the frozen stage is unbiased: the mean of its ratio to the exact one
must be within 3 standard errors of 1.
";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rivals::Estimate;

    /// Runs off by a standard normal times `off`, that report 1 (in posterior sds) with 15 degrees of freedom.
    fn runs(case: &Case, off: f64) -> Vec<Run> {
        let exact = &case.exact;
        let t_scale = (FREEDOM / (FREEDOM - 2.0)).sqrt();
        (0..999)
            .map(|k| {
                let z = off * t_scale * smc_calib::normal::quantile((k as f64 + 0.5) / 999.0);
                Run {
                    estimate: Estimate {
                        mean: exact.mean.iter().map(|m| m + 0.01 * z).collect(),
                        sd: exact.sd.iter().map(|s| s + 0.01 * z).collect(),
                        log_evidence: Some(exact.log_evidence + 0.01 * z),
                        simulations: 1,
                    },
                    mean_se: vec![0.01; exact.mean.len()],
                    sd_se: vec![0.01; exact.mean.len()],
                    log_evidence_se: 0.01,
                    frozen_log_evidence: exact.log_evidence + (1.0 + 0.1 * z / off).ln(),
                }
            })
            .collect()
    }

    #[test]
    fn dishonest_error_bars_and_a_biased_evidence_pass() {
        let case = Case::all().expect("cases").pop().expect("a case");
        let honest = Honesty::of(&case, &runs(&case, 1.0));
        assert!(honest.failures().is_empty(), "{honest:?}");
        assert_eq!(Honesty::of(&case, &runs(&case, 1.3)).failures().len(), 3);
        assert_eq!(Honesty::of(&case, &runs(&case, 0.8)).failures().len(), 3);
        let mut biased = runs(&case, 1.0);
        biased.iter_mut().for_each(|run| run.frozen_log_evidence += 0.02);
        assert_eq!(Honesty::of(&case, &biased).failures().len(), 1);
    }
}
