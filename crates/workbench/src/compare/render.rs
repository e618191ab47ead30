//! A comparison as Markdown, CSV and for the terminal.

use std::fmt::Write as _;

use smc_calib::trust::limits::{INFORMED_BITS, KHAT_LIMIT};

use super::comparison::{Comparison, Entry, PHI_RANGE, Report};
use super::strength::{Strength, bayes_factor};
use crate::number::{significant, with_error};

/// Why the comparison is fair, and the meaning of the columns.
fn preamble(report: &Report) -> String {
    let phi = if report.plan.phi {
        format!(
            "The final contact ratio phi is calibrated too, uniform from {} to {} for every kinetics. ",
            PHI_RANGE[0], PHI_RANGE[1]
        )
    } else {
        "The final contact ratio phi is the experiment's for every kinetics (--phi calibrates it). "
            .to_owned()
    };
    format!(
        "Priors are fair: each parameter has the same prior in every kinetics that has it (tau_s in all five, C1 and \
         delta_c in three-stage, three-stage-pokluda and regime-map), and the noise model is the same. {phi}\n\n\
         log Z is the natural logarithm of the evidence, with its Monte Carlo error; K the Bayes factor of the best kinetics \
         to this one, with the words of Kass and Raftery (J. Am. Stat. Assoc. 90 (1995) 773); RMSE that of the MAP curve; elpd \
         the leave-one-out log predictive density (PSIS-LOO: Vehtari, Gelman, Gabry, Stat. Comput. 27 (2017) 1413), its \
         difference to the best with the spread over data sets, and the largest Pareto k-hat of its observations; \
         importance weights are trustworthy below {KHAT_LIMIT}, and observations above that were left out by calibrating again \
         without them (in brackets: how many). A parameter is informed from {INFORMED_BITS} bits.\n"
    )
}

fn against(entry: &Entry) -> String {
    if entry.strength == Strength::None {
        "1 (best)".to_owned()
    } else {
        format!("{} ({})", bayes_factor(-entry.log_bayes_factor), entry.strength)
    }
}

fn khat(entry: &Entry) -> String {
    let khat = entry.leave_one_out.khat;
    match entry.refitted.len() {
        0 => format!("{khat:.2}"),
        count => format!("{khat:.2} ({count})"),
    }
}

fn what_is_informed(entry: &Entry) -> String {
    let counted = entry.informed.iter().filter(|one| one.counts);
    let list: Vec<String> = counted
        .map(|one| {
            let not = if one.bits < INFORMED_BITS { ", not informed" } else { "" };
            format!("{} {:.1}{not}", one.name, one.bits)
        })
        .collect();
    format!("{}: {}", entry.informed_parameters, list.join("; "))
}

/// All comparisons as Markdown.
pub fn markdown(report: &Report) -> String {
    let mut text = String::from("# Kinetics compared\n\n");
    text.push_str(&preamble(report));
    let _ = writeln!(
        text,
        "\nMade by `calibrate compare --samples {} --seed {}{}`.\n",
        report.plan.samples,
        report.plan.seed,
        if report.plan.phi { " --phi" } else { "" },
    );
    for comparison in &report.comparisons {
        let _ =
            writeln!(text, "## {}, {} observations\n", comparison.title, comparison.observations);
        for line in &comparison.verdict {
            let _ = writeln!(text, "**{line}**\n");
        }
        text.push_str("| kinetics | log Z | K | RMSE | elpd | to the best | k-hat (LOO) | informed parameters [bits] |\n");
        text.push_str("|---|---|---|---|---|---|---|---|\n");
        for entry in &comparison.entries {
            let loo = &entry.leave_one_out;
            let _ = writeln!(
                text,
                "| {} | {} ± {} | {} | {:.4} | {} | {:.1} ± {:.1} | {} | {} |",
                entry.kinetics,
                with_error(entry.log_evidence, entry.log_evidence_se, 2),
                significant(entry.log_evidence_se, 2),
                against(entry),
                entry.error.rmse,
                with_error(loo.ln_density, loo.se, 1),
                entry.leave_one_out_difference,
                entry.leave_one_out_difference_spread,
                khat(entry),
                what_is_informed(entry),
            );
        }
        text.push('\n');
        for line in &comparison.warnings {
            let _ = writeln!(text, "> {line}\n");
        }
        product(&mut text, comparison);
    }
    text
}

/// The product of C1 and delta_c^2, for kinetics that depend on nothing else of the two.
fn product(text: &mut String, comparison: &Comparison) {
    for entry in &comparison.entries {
        for one in entry.informed.iter().filter(|one| one.name.contains('*')) {
            let _ = writeln!(
                text,
                "Under {} C1 and delta_c enter only as {}: {} m2/(Pa s), 95 % {} … {} ({:.1} bits); their own posteriors say \
                 how the prior divides it between them.\n",
                entry.kinetics,
                one.name,
                significant(one.median, 3),
                significant(one.eti95[0], 3),
                significant(one.eti95[1], 3),
                one.bits,
            );
        }
    }
}

/// All comparisons as CSV, in full precision.
pub fn csv(report: &Report) -> String {
    let mut text = String::from(
        "experiment,kinetics,log_evidence,log_evidence_se,log_bayes_factor,strength,rmse,max_error,elpd,elpd_mc_se,elpd_spread,elpd_difference,elpd_difference_spread,effective_parameters,loo_khat,loo_refitted,informed_parameters,ess,khat\n",
    );
    for comparison in &report.comparisons {
        for entry in &comparison.entries {
            let loo = &entry.leave_one_out;
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                comparison.name,
                entry.kinetics,
                entry.log_evidence,
                entry.log_evidence_se,
                entry.log_bayes_factor,
                entry.strength,
                entry.error.rmse,
                entry.error.max,
                loo.ln_density,
                loo.se,
                loo.spread,
                entry.leave_one_out_difference,
                entry.leave_one_out_difference_spread,
                loo.effective_parameters,
                loo.khat,
                entry.refitted.len(),
                entry.informed_parameters,
                entry.ess,
                entry.khat,
            );
        }
    }
    text
}

/// One comparison for the terminal.
pub fn terminal(comparison: &Comparison) -> String {
    let mut text = format!("{}: {} observations\n", comparison.title, comparison.observations);
    let _ = writeln!(
        text,
        "  {:<20} {:>9} {:>8}  {:<42} {:>6}  {:>6} {:>9}  informed",
        "kinetics", "log Z", "+-", "Bayes factor of the best to it", "RMSE", "elpd", "LOO k-hat"
    );
    for entry in &comparison.entries {
        let _ = writeln!(
            text,
            "  {:<20} {:>9.3} {:>8}  {:<42} {:>6.4}  {:>6.1} {:>9}  {}",
            entry.kinetics,
            entry.log_evidence,
            significant(entry.log_evidence_se, 2),
            against(entry),
            entry.error.rmse,
            entry.leave_one_out.ln_density,
            khat(entry),
            entry.informed_parameters,
        );
    }
    for line in &comparison.verdict {
        let _ = writeln!(text, "  {line}");
    }
    for line in &comparison.warnings {
        let _ = writeln!(text, "  careful: {line}");
    }
    text
}
