//! A comparison as Markdown, CSV and for the terminal.

use std::fmt::Write as _;

use smc_calib::trust::limits::{INFORMED_BITS, KHAT_LIMIT};

use super::comparison::{Comparison, Entry, Informed, PHI_RANGE, Report};
use super::strength::{Strength, bayes_factor};
use crate::number::{probability, significant, with_error};

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
        "Priors are fair: each parameter has the same prior in every kinetics that has it (tau_s in all six, C1 and \
         delta_c in three-stage, three-stage-pokluda and regime-map, lambda in bellehumeur), and that of sigma is the same in every noise model. \
         {phi}Errors are independent and normal (`--noise inferred`), correlated (alike near each other: an Ornstein-Uhlenbeck \
         process beside an independent part) or robust (independent, with outliers).\n\n\
         log Z is the natural logarithm of the evidence, with its Monte Carlo error, and comparable over the whole table; the \
         probability is that of the model where all of the table are as likely beforehand. Noise by noise follow K, the Bayes \
         factor of the best kinetics \
         to this one, with the words of Kass and Raftery (J. Am. Stat. Assoc. 90 (1995) 773); RMSE that of the MAP curve; elpd \
         the leave-one-out log predictive density (PSIS-LOO: Vehtari, Gelman, Gabry, Stat. Comput. 27 (2017) 1413), of each \
         observation given all others and, where errors are correlated, given theirs too, its \
         difference to the best with the spread over data sets, and the largest Pareto k-hat of its observations; \
         importance weights are trustworthy below {KHAT_LIMIT}, and observations above that were left out by calibrating again \
         without them (in brackets: how many). A parameter is informed from {INFORMED_BITS} bits; parameters are given as \
         median and 95 % interval.\n"
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
    let mut text = String::from("# Kinetics and noise compared\n\n");
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
        evidence_table(&mut text, comparison);
        for noise in &comparison.noises {
            let _ = writeln!(text, "### {}, {} errors\n", comparison.title, noise.name);
            one_noise(&mut text, comparison, &noise.name);
        }
        for line in &comparison.warnings {
            let _ = writeln!(text, "> {line}\n");
        }
        product(&mut text, comparison);
    }
    text
}

/// A row per kinetics, a column per noise: log evidence and probability.
fn evidence_table(text: &mut String, comparison: &Comparison) {
    let heads = comparison.noises.iter().map(|noise| format!(" log Z, {} errors |", noise.name));
    let _ = writeln!(text, "| kinetics |{}", heads.collect::<String>());
    let _ = writeln!(text, "|---|{}", "---|".repeat(comparison.noises.len()));
    for kinetics in comparison.kinetics() {
        let cells = comparison.noises.iter().map(|noise| {
            comparison.cell(kinetics, &noise.name).map_or_else(String::new, |entry| {
                format!(
                    " {} ± {} ({}) |",
                    with_error(entry.log_evidence, entry.log_evidence_se, 2),
                    significant(entry.log_evidence_se, 2),
                    probability(entry.probability),
                )
            })
        });
        let _ = writeln!(text, "| {kinetics} |{}", cells.collect::<String>());
    }
    let all = comparison
        .noises
        .iter()
        .map(|noise| format!(" {:.2} ({}) |", noise.log_evidence, probability(noise.probability)));
    let _ = writeln!(text, "| average of the kinetics |{}\n", all.collect::<String>());
}

/// The kinetics under one noise: Bayes factors, errors, left-out observations; then the parameters.
fn one_noise(text: &mut String, comparison: &Comparison, noise: &str) {
    text.push_str(
        "| kinetics | K | RMSE | elpd | to the best | k-hat (LOO) | informed parameters [bits] |\n",
    );
    text.push_str("|---|---|---|---|---|---|---|\n");
    for entry in comparison.under(noise) {
        let loo = &entry.leave_one_out;
        let _ = writeln!(
            text,
            "| {} | {} | {:.4} | {} | {:.1} ± {:.1} | {} | {} |",
            entry.kinetics,
            against(entry),
            entry.error.rmse,
            with_error(loo.ln_density, loo.se, 1),
            entry.leave_one_out_difference,
            entry.leave_one_out_difference_spread,
            khat(entry),
            what_is_informed(entry),
        );
    }
    let names = parameters(comparison);
    let _ = writeln!(text, "\n| kinetics | {} |", names.join(" | "));
    let _ = writeln!(text, "|---|{}", "---|".repeat(names.len()));
    for entry in comparison.under(noise) {
        let cells = names.iter().map(|name| {
            let found = entry.informed.iter().find(|one| one.name == *name);
            format!(" {} |", found.map_or_else(String::new, interval))
        });
        let _ = writeln!(text, "| {} |{}", entry.kinetics, cells.collect::<String>());
    }
    text.push('\n');
}

/// Parameters that any of the kinetics has, without the product of two.
fn parameters(comparison: &Comparison) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for one in comparison.entries.iter().flat_map(|entry| &entry.informed) {
        if !one.name.contains('*') && !names.contains(&one.name.as_str()) {
            names.push(&one.name);
        }
    }
    names
}

/// Median and 95 % interval.
fn interval(one: &Informed) -> String {
    let [lower, upper] = one.eti95.map(|end| significant(end, 3));
    format!("{} ({lower} .. {upper})", significant(one.median, 3))
}

/// The product of C1 and delta_c^2, for kinetics that depend on nothing else of the two.
fn product(text: &mut String, comparison: &Comparison) {
    for entry in &comparison.entries {
        for one in entry.informed.iter().filter(|one| one.name.contains('*')) {
            let _ = writeln!(
                text,
                "Under {} with {} errors C1 and delta_c enter only as {}: {} m2/(Pa s), 95 % {} … {} ({:.1} bits); their own \
                 posteriors say how the prior divides it between them.\n",
                entry.kinetics,
                entry.noise,
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
        "experiment,kinetics,noise,log_evidence,log_evidence_se,probability,log_bayes_factor,strength,rmse,max_error,elpd,elpd_mc_se,elpd_spread,elpd_difference,elpd_difference_spread,effective_parameters,loo_khat,loo_refitted,informed_parameters,tau_s_median,tau_s_lower95,tau_s_upper95,ess,khat\n",
    );
    for comparison in &report.comparisons {
        for entry in &comparison.entries {
            let loo = &entry.leave_one_out;
            let tau_s = entry.informed.iter().find(|one| one.name == "tau_s");
            let tau_s = tau_s.map_or_else(
                || ",,".to_owned(),
                |tau| format!("{},{},{}", tau.median, tau.eti95[0], tau.eti95[1]),
            );
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{tau_s},{},{}",
                comparison.name,
                entry.kinetics,
                entry.noise,
                entry.log_evidence,
                entry.log_evidence_se,
                entry.probability,
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

/// What a table says of one cell.
type CellText<'a> = &'a dyn Fn(&Entry) -> String;

/// One comparison for the terminal.
pub fn terminal(comparison: &Comparison) -> String {
    let mut text = format!("{}: {} observations\n", comparison.title, comparison.observations);
    let tables: [(&str, CellText<'_>); 3] = [
        ("log Z (probability)", &|entry| {
            format!("{:.2} ({})", entry.log_evidence, probability(entry.probability))
        }),
        ("tau_s [s], 95 %", &|entry| {
            let tau_s = entry.informed.iter().find(|one| one.name == "tau_s");
            tau_s.map_or_else(String::new, interval)
        }),
        ("leave-one-out", &|entry| {
            format!(
                "{:.1} ± {:.1}",
                entry.leave_one_out_difference, entry.leave_one_out_difference_spread
            )
        }),
    ];
    for (name, cell) in tables {
        let heads = comparison.noises.iter().map(|noise| format!("  {:<26}", noise.name));
        let _ =
            writeln!(text, "  {}", format!("{name:<22}{}", heads.collect::<String>()).trim_end());
        for kinetics in comparison.kinetics() {
            let cells = comparison.noises.iter().map(|noise| {
                let cell = comparison.cell(kinetics, &noise.name).map_or_else(String::new, cell);
                format!("  {cell:<26}")
            });
            let line = format!("{kinetics:<20}{}", cells.collect::<String>());
            let _ = writeln!(text, "    {}", line.trim_end());
        }
    }
    for line in &comparison.verdict {
        let _ = writeln!(text, "  {line}");
    }
    for line in &comparison.warnings {
        let _ = writeln!(text, "  careful: {line}");
    }
    text
}
