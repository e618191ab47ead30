//! Error of small budgets against exact answers: the default sampler, many small stages, and the same placed by a
//! surrogate.

use std::fmt::Write as _;
use std::path::Path;

use smc_calib::{Settings, reference};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use crate::args::SmallBudgetArgs;
use crate::cases::{Case, Errors, Exact, Run};
use crate::quantile::{capped_rms, median};
use crate::report::{Report, Table};
use crate::seeds::over_seeds;

/// A sampler's name, and its settings for a number of simulations.
type Sampler = (&'static str, fn(usize) -> Settings);

const SAMPLERS: [Sampler; 3] = [
    ("default", |samples| Settings { samples, map_simulations: 0, ..Settings::default() }),
    ("small stages", |samples| Settings { surrogate: false, ..Settings::for_budget(samples) }),
    ("small stages, surrogate", Settings::for_budget),
];

/// Columns of [`cells`].
pub(crate) const COLUMNS: [&str; 11] = [
    "mean [posterior sd]",
    "sd, relative",
    "ln Z",
    "ends of 95 % [posterior sd]",
    "spread of z",
    "spread of z, ln Z",
    "spread of z, ends",
    "ESS",
    "k-hat",
    "off, not said",
    "right, called unsolved",
];

const TEXT: &str = "\
Errors (root mean square over the seeds, each error counted as 10 at most) against exact answers, at equal numbers of simulations: the default
sampler, many small stages without a surrogate, and the same placed by the surrogate (`Settings::for_budget`). Mean and sd are those of the worst
parameter, in posterior standard deviations and relative; \"spread of z\" is that of the first mean's error over its stated standard error, and of
ln Z's, over all runs but calibrations that are not to be trusted, which do not know their standard errors. Of calibrations, ends of 95 % intervals have the error of the worst one, and one spread of z over all of them; the runs are counted with a mean off by more than one sd
that do not say that they are not to be trusted, or that their budget was too small, and those right within one sd that do. ESS and k-hat are medians. The neck-growth problems are the measured curves under the closed-form three-stage law, default noise, priors over four to six decades.
The figures depend on seeds only, not on the machine or its load.

The surrogate is a Gaussian process through the outputs (or the log likelihoods, where there are no outputs). It says where to simulate; weights are
those of the true likelihood. Processes and local quadratics, with the shares that leave the least of them where they are left out, take noise out of the
estimates as a control variate; what the process through all samples says of the integrals is taken with the share that its own error gives it.
";

pub(crate) fn run(args: &SmallBudgetArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "small-budget")?;
    let mut table = Table::new(&[&["problem", "simulations", "sampler"], &COLUMNS[..]].concat());
    let mut lost = String::new();
    for (name, case) in problems(&args.only)? {
        for &samples in &args.samples {
            for (sampler, settings) in SAMPLERS {
                eprintln!("{name}, {samples} simulations, {sampler}");
                let found = over_seeds(args.seeds, &|seed| {
                    Ok(case.sampled(&Settings { seed, ..settings(samples) }).ok())
                })?;
                let runs: Vec<Run> = found.into_iter().flatten().collect();
                if runs.len() < args.seeds as usize {
                    let missing = args.seeds as usize - runs.len();
                    let _ = writeln!(
                        lost,
                        "- {name}, {samples} simulations, {sampler}: {missing} runs without an answer"
                    );
                }
                if !runs.is_empty() {
                    let what = [name.clone(), samples.to_string(), sampler.to_owned()];
                    table.push([what.as_slice(), &cells(&case.exact, &runs)].concat());
                }
            }
        }
    }
    report.table(&table)?;
    let text = format!("{} seeds. {TEXT}\n{}\n{lost}", args.seeds, table.markdown());
    Ok(report.page("Small budgets", &text)?)
}

/// The problems whose name contains one of `only`, or all where that is empty, with their names.
pub(crate) fn problems(only: &[String]) -> Result<Vec<(String, Case)>, Failure> {
    let asked = |name: &str| only.is_empty() || only.iter().any(|only| name.contains(only));
    let mut problems = Vec::new();
    for d in 1..=4 {
        problems
            .push((format!("Gaussian, {d} D"), Case::density(reference::gaussian(d, 0.8, 0.1))));
    }
    for reference in [
        reference::banana(),
        reference::bounded_ridge(),
        reference::two_modes(),
        reference::heavy_tail(),
    ] {
        problems.push((reference.name.to_owned(), Case::density(reference)));
    }
    problems.retain(|(name, _)| asked(name));
    for material in Material::ALL {
        let name = format!("neck growth, {}", material.name().to_uppercase());
        if asked(&name) {
            problems.push((name, Case::material(material)?));
        }
    }
    if problems.is_empty() {
        let only = only.join(" or ");
        return Err(RunError::new(format_args!("no problem has {only} in its name")).into());
    }
    Ok(problems)
}

/// Errors of runs over seeds, and what the runs say of themselves.
pub(crate) fn cells(exact: &Exact, runs: &[Run]) -> Vec<String> {
    let errors: Vec<Errors> = runs.iter().map(|run| Errors::of(exact, &run.estimate)).collect();
    let worst = |errors: &[&Vec<f64>]| {
        let of = |j: usize| capped_rms(errors.iter().map(|row| row[j]));
        (0..exact.mean.len()).map(of).fold(0.0, f64::max)
    };
    // Of runs that know their standard errors.
    let known = || runs.iter().zip(&errors).filter(|(run, _)| run.errors_known);
    let z = known().map(|(run, error)| error.mean[0] / (run.mean_se[0] / exact.sd[0]));
    let z_evidence = known().map(|(run, error)| {
        error.log_evidence.map_or(f64::NAN, |error| error / run.log_evidence_se)
    });
    let ends = of_ends(exact, runs);
    vec![
        format!("{:.2}", worst(&errors.iter().map(|e| &e.mean).collect::<Vec<_>>())),
        format!("{:.2}", worst(&errors.iter().map(|e| &e.sd).collect::<Vec<_>>())),
        format!("{:.2}", capped_rms(errors.iter().map(|e| e.log_evidence.unwrap_or(f64::NAN)))),
        ends.map_or("-".to_owned(), |[worst, _]| format!("{worst:.2}")),
        spread(capped_rms(z)),
        spread(capped_rms(z_evidence)),
        ends.map_or("-".to_owned(), |[_, z]| spread(z)),
        format!("{:.0}", median(runs.iter().map(|run| run.ess))),
        format!("{:.2}", median(runs.iter().map(|run| run.khat))),
        judged(runs, &errors, |off, said| off && !said),
        judged(runs, &errors, |off, said| !off && said),
    ]
}

/// A spread of z; a dash where no run knows its standard errors.
fn spread(z: f64) -> String {
    if z.is_nan() { "-".to_owned() } else { format!("{z:.1}") }
}

/// Error of the worst end of a 95 % interval in posterior sds, and the spread of z over all of them; none where they are not known.
fn of_ends(exact: &Exact, runs: &[Run]) -> Option<[f64; 2]> {
    let ends = || (0..exact.ends.len()).flat_map(|j| [(j, 0), (j, 1)]);
    let off = |run: &Run, (j, end): (usize, usize)| {
        let of = &run.intervals[j];
        let [value, se] = [[of.lower, of.lower_se], [of.upper, of.upper_se]][end];
        [(value - exact.ends[j][end]) / exact.sd[j], se / exact.sd[j]]
    };
    let errors = ends().map(|end| capped_rms(runs.iter().map(|run| off(run, end)[0])));
    let known = || runs.iter().filter(|run| run.errors_known);
    let z = ends().flat_map(|end| known().map(move |run| off(run, end)));
    (!exact.ends.is_empty())
        .then(|| [errors.fold(0.0, f64::max), capped_rms(z.map(|[off, se]| off / se))])
}

/// Number of runs of some kind, by whether a mean is off by more than one posterior sd and whether the run says that it is not
/// solved; a dash where runs do not judge themselves.
fn judged(runs: &[Run], errors: &[Errors], kind: impl Fn(bool, bool) -> bool) -> String {
    let mut count = 0;
    for (run, error) in runs.iter().zip(errors) {
        let Some(said) = run.unsolved else { return "-".to_owned() };
        let off = error.mean.iter().any(|e| e.is_nan() || e.abs() > 1.0);
        count += usize::from(kind(off, said));
    }
    count.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use smc_calib::Interval;

    use crate::rivals::Estimate;

    /// A run that is off by so much in all estimates, with standard errors of a tenth.
    fn run(off: f64, errors_known: bool) -> Run {
        Run {
            estimate: Estimate {
                mean: vec![off],
                sd: vec![1.0],
                log_evidence: Some(off),
                simulations: 50,
            },
            mean_se: vec![0.1],
            sd_se: vec![0.1],
            log_evidence_se: 0.1,
            intervals: vec![Interval {
                lower: off - 2.0,
                upper: off + 2.0,
                lower_se: 0.1,
                upper_se: 0.1,
            }],
            frozen_log_evidence: 0.0,
            ess: 1.0,
            khat: 0.0,
            component_densities: 0,
            errors_known,
            unsolved: None,
        }
    }

    #[test]
    fn runs_that_do_not_know_their_standard_errors_have_no_part_in_the_spread_of_z() {
        let exact = Exact {
            mean: vec![0.0],
            sd: vec![1.0],
            log_evidence: 0.0,
            ends: vec![[-2.0, 2.0]],
            settled: 0.0,
        };
        let spreads = |runs: &[Run]| cells(&exact, runs)[4..7].to_vec();
        let (close, far) = (run(0.1, true), run(0.8, false));
        assert_eq!(spreads(&[close.clone(), far.clone()]), ["1.0"; 3]);
        assert_eq!(spreads(&[run(0.8, true)]), ["8.0"; 3]);
        assert_eq!(spreads(std::slice::from_ref(&far)), ["-"; 3]);
        // Errors themselves count all runs.
        assert_eq!(cells(&exact, &[close, far])[0], "0.57");
    }
}
