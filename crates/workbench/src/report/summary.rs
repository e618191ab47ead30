//! The closing summary of a run: what was found, how good the fit is, whether to trust it, where the files are.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};
use smc_calib::{Concern, ParameterSummary};

use super::noise::{beside, noise_line};
use super::population;
use crate::careful::{as_far_in_words, counted, noise_too_large};
use crate::error::RunError;
use crate::number::{digits_of, percentile, shown_unit, significant};
use crate::output::pretty;
use crate::plan::{ObservablePlan, SimulatorPlan};
use crate::record::{
    ExperimentRecord, FitError, KneeSummary, NeckGrowthRecord, ObservableRecord, PaperComparison,
    PrintedParameter, ProductSummary, Record,
};

/// Why the paper's C1 has another percentile in the form of Table 3 than in SI.
pub(super) const OF_TABLE3: &str =
    "c1 there is proportional to c1 * delta_c in SI, so the paper's value has another percentile";

/// Place of a parameter in the paper's triple.
pub(super) fn paper_place(name: &str) -> Option<usize> {
    ["c1", "tau_s", "delta_c"].iter().position(|known| *known == name)
}

/// Whether the data are said not to inform a parameter.
pub(super) fn is_uninformed(record: &Record, name: &str) -> bool {
    record.trust.concerns.iter().any(
        |concern| matches!(concern, Concern::NotInformed { parameter, .. } if parameter == name),
    )
}

/// The neck growth of a run with one pair.
pub(super) fn neck_growth(record: &Record) -> Option<&NeckGrowthRecord> {
    record.pair().ok().map(|pair| pair.neck_growth)
}

/// The summary as text, about ten lines. `seconds` is how long the inference took, where it has just run.
pub fn text(record: &Record, seconds: Option<f64>, out: Option<&Path>) -> String {
    let mut text = match &record.population {
        Some(population) => population::headline(record, population),
        None => headline(record, seconds),
    };
    if !record.is_posterior {
        text.push_str("  NOT A POSTERIOR: noise tuned to a wished-for sample size\n");
    }
    let neck = neck_growth(record);
    let width = record.parameters.iter().map(|p| p.parameter.name.len()).max().unwrap_or(0).max(8);
    for (place, summary) in record.parameters.iter().enumerate() {
        let mut line = parameter_line(summary, width);
        if let Some(paper) = neck.and_then(|neck| neck.paper.as_ref()) {
            line.push_str(&beside_the_paper(paper, place, &summary.parameter.name));
        }
        if is_uninformed(record, &summary.parameter.name) {
            let _ = write!(line, "; NOT INFORMED ({:.2} bits)", summary.information_gain_bits);
        }
        text.push_str(&line);
        text.push('\n');
    }
    if let Some(neck) = neck {
        text.push_str(&table3_lines(neck));
    }
    if let Some(population) = &record.population {
        text.push_str(&population::lines(record, population, width));
    }
    for (plan, found) in record.observables() {
        text.push_str(&fit_line((plan, found), neck, record.ess.importance));
        text.push_str(&noise_line(plan, found));
    }
    for experiment in &record.experiments {
        let several = record.experiments.len() > 1;
        text.push_str(&freezes_line(experiment, several));
    }
    if let Some(knee) = neck.and_then(|neck| neck.knee.as_ref()) {
        text.push_str(&knee_line(knee));
    }
    text.push_str(&other_kinetics_line(record));
    if let Some(earlier) = &record.plan.proposal {
        let _ = writeln!(text, "  begun from {}: {}", earlier.result(), earlier.taken());
    }
    let _ = writeln!(text, "  trust: {}", record.trust.line(&record.log_evidence));
    text.push_str(&beside(record, width));
    for failure in &record.failures {
        let _ = writeln!(text, "  failed {} times: {}", failure.count, failure.cause);
    }
    if let Some(line) = failing_line(record) {
        let _ = writeln!(text, "  {line}");
    }
    for line in &record.advice {
        let _ = writeln!(text, "  careful: {line}");
    }
    if let Some(out) = out {
        let figures = match record.population {
            Some(_) => "population.csv, draws.csv, pairs.png, shrunk.png, ...",
            None => "samples.csv, draws.csv, corner.png, fit*.png, ...",
        };
        let _ = writeln!(text, "  files: {}/ (posterior.json, table.md, {figures})", out.display());
        return in_folder(&text, out);
    }
    text
}

/// Text on a result with the folder of the run in the commands that it names. The record itself has `DIR` there: it does not
/// depend on where it is written to.
pub fn in_folder(text: &str, folder: &Path) -> String {
    ["--resume", "--continue-from"].iter().fold(text.to_owned(), |text, option| {
        let named = format!("calibrate {option} {} ", folder.display());
        text.replace(&format!("calibrate {option} DIR "), &named)
    })
}

/// What failures do to the evidence, and whether they depend on the parameters.
pub(super) fn failing_line(record: &Record) -> Option<String> {
    let failing = record.failing.as_ref()?;
    let (zero, random) = (&record.log_evidence, failing.log_evidence_if_random);
    let depends = if failing.depends() { "depends on the parameters" } else { "looks random" };
    Some(format!(
        "failing {depends} (p = {}), with about {} % of the posterior; log evidence {:.3} counts failures as likelihood \
         zero, {random:.3} +- {} holds if they are random",
        significant(failing.p_value, 2),
        significant(100.0 * failing.mass, 2),
        zero.value,
        significant(failing.log_evidence_if_random_se, 2),
    ))
}

fn headline(record: &Record, seconds: Option<f64>) -> String {
    let plan = &record.plan;
    let (mut kinetics, mut solver) = (String::new(), String::new());
    if let [experiment] = &plan.experiments[..]
        && let SimulatorPlan::Builtin(pair) = &experiment.simulator
    {
        kinetics = format!("{} kinetics, ", pair.kinetics);
        solver = format!(" ({})", pair.solver.name);
    }
    let several = match plan.observables().count() {
        1 => String::new(),
        n => format!(" of {n} observables"),
    };
    let failed: usize = record.failures.iter().map(|failure| failure.count).sum();
    let failed = if failed > 0 { format!(" ({failed} failed)") } else { String::new() };
    let took = seconds.map_or_else(String::new, |s| format!(" in {} s", significant(s, 2)));
    format!(
        "{}: {kinetics}{} observations{several}, {} simulations{solver}{failed}{took}\n",
        plan.title,
        plan.observations(),
        record.counters.simulations,
    )
}

fn parameter_line(summary: &ParameterSummary, width: usize) -> String {
    let si = &summary.in_si;
    let digits = digits_of([si.eti95.lower, si.eti95.upper]);
    format!(
        "  {:<width$} {:>9} {:<9} 95 % {} .. {}",
        summary.parameter.name,
        significant(si.median, digits),
        shown_unit(&summary.parameter.unit),
        significant(si.eti95.lower, digits),
        significant(si.eti95.upper, digits),
    )
}

fn beside_the_paper(paper: &PaperComparison, place: usize, name: &str) -> String {
    match (paper.percentile_si.get(place), paper_place(name)) {
        (Some(Some(share)), Some(at)) => {
            format!("; paper {} ({})", significant(paper.si[at], 3), percentile(*share))
        }
        _ => String::new(),
    }
}

/// The product that kinetics inform, and the parameters as Table 3 prints them.
fn table3_lines(neck: &NeckGrowthRecord) -> String {
    let mut text = String::new();
    if let Some(ProductSummary { name, unit, median, eti95, information_gain_bits, .. }) =
        &neck.product
    {
        let _ = writeln!(
            text,
            "  {name} {} {unit}  95 % {} .. {} ({information_gain_bits:.1} bits): all that these kinetics see of the two",
            significant(*median, 3),
            significant(eti95[0], 3),
            significant(eti95[1], 3),
        );
    }
    let printed = |printed: &PrintedParameter| {
        let paper = printed
            .paper
            .map_or_else(String::new, |paper| format!(" (paper {})", significant(paper, 3)));
        format!("{} {}{paper}", printed.name, significant(printed.median, 3))
    };
    if !neck.printed.is_empty() {
        let medians: Vec<String> = neck.printed.iter().map(printed).collect();
        let _ = writeln!(text, "  as printed in Table 3: {}; {OF_TABLE3}", medians.join(", "));
    }
    text
}

fn fit_line(
    (plan, found): (&ObservablePlan, &ObservableRecord),
    neck: Option<&NeckGrowthRecord>,
    ess: f64,
) -> String {
    let noise = found.sigma.map_or_else(String::new, |sigma| {
        format!("; noise sigma {}", significant(sigma.median, 2))
    });
    let rmse = significant(found.map_error.rmse, 2);
    if let Some(neck) = neck {
        let beside = |what: &str, error: Option<FitError>| {
            error.map_or_else(String::new, |error| {
                format!(", {what} {}", significant(error.rmse, 2))
            })
        };
        let (paper, frenkel) =
            (beside("paper", neck.fit.paper), beside("best Frenkel", neck.fit.frenkel));
        return format!("  fit: RMSE of a/R {rmse} (MAP){paper}{frenkel}{noise}\n");
    }
    let unit = match shown_unit(&plan.unit) {
        "" => String::new(),
        unit => format!("{unit} "),
    };
    let check = found.check.map_or_else(String::new, |check| {
        let words = as_far_in_words(check.as_far, counted(&check, ess));
        let but = noise_too_large(found).map_or_else(String::new, |but| format!(" ({but})"));
        format!("; as far off again: {words}{but}")
    });
    format!("  fit of {}: RMSE {rmse} {unit}(MAP){noise}{check}\n", found.label)
}

/// Where a pair stops growing as its heat ends; empty where it has none, or one without an end.
fn freezes_line(experiment: &ExperimentRecord, several: bool) -> String {
    let neck = experiment.neck_growth.as_ref();
    let Some(freezes) = neck.and_then(|neck| neck.freezes_at.as_ref()) else {
        return String::new();
    };
    let digits = digits_of(freezes.eti95);
    let [median, lower, upper] =
        [freezes.median, freezes.eti95[0], freezes.eti95[1]].map(|end| significant(end, digits));
    let name = if several { format!("{} ", experiment.name) } else { String::new() };
    format!("  {name}freezes at a/R {median} (95 % {lower} .. {upper})\n")
}

fn knee_line(knee: &KneeSummary) -> String {
    let probability = if knee.probability < 0.995 {
        format!(", with probability {:.2}", knee.probability)
    } else {
        String::new()
    };
    let digits = digits_of(knee.time_s.eti95);
    format!(
        "  knee: a/R {} at {} s (95 % {} .. {} s){probability}\n",
        significant(knee.contact_ratio.median, 3),
        significant(knee.time_s.median, digits),
        significant(knee.time_s.eti95[0], digits),
        significant(knee.time_s.eti95[1], digits),
    )
}

/// Kinetics that fit as well as those that were used or better, and tau_s under them; empty where there are none.
fn other_kinetics_line(record: &Record) -> String {
    let Ok(pair) = record.pair() else { return String::new() };
    let as_good = pair.neck_growth.other_kinetics.iter().filter(|other| other.fits_as_well);
    let others: Vec<String> = as_good
        .map(|other| {
            let apart = if other.tau_s_disjoint { ", apart from that above" } else { "" };
            let [lower, upper] = other.tau_s_eti95.map(|end| significant(end, 3));
            format!(
                "{} (Bayes factor {} over the one used; tau_s {} s, 95 % {lower} .. {upper} s{apart})",
                other.kinetics,
                significant(other.ln_bayes_factor.exp(), 2),
                significant(other.tau_s_median, 3),
            )
        })
        .collect();
    let not_judged: Vec<String> = pair
        .neck_growth
        .other_kinetics
        .iter()
        .filter(|other| !other.judged)
        .map(|other| other.kinetics.to_string())
        .collect();
    let material = match pair.plan.material {
        Some(material) if material.name() == record.plan.name => format!(" --material {material}"),
        _ => String::new(),
    };
    let mut text = String::new();
    for (what, which) in [
        ("fit as well or better by evidence", others),
        ("were not judged, few simulations did not suffice", not_judged),
    ] {
        if !which.is_empty() {
            let which = which.join(", ");
            let _ =
                writeln!(text, "  other kinetics {what}: {which}; see calibrate compare{material}");
        }
    }
    text
}

/// The summary as JSON: the same facts for a program to read.
pub fn json(record: &Record, out: Option<&Path>) -> Result<String, RunError> {
    let observables: Vec<Value> = record
        .observables()
        .map(|(_, found)| json!({"label": found.label, "sigma": found.sigma, "map_error": found.map_error, "check": found.check}))
        .collect();
    let neck_growth = neck_growth(record).map(|neck| {
        json!({
            "kinetics": record.pair().ok().map(|pair| pair.plan.kinetics),
            "printed": neck.printed,
            "paper": neck.paper,
            "product": neck.product,
            "fit": neck.fit,
            "knee": neck.knee,
            "other_kinetics": neck.other_kinetics,
        })
    });
    let mut summary = json!({
        "name": record.plan.name,
        "is_posterior": record.is_posterior,
        "trusted": record.trusted(),
        "trust": record.trust,
        "parameters": record.parameters,
        "observables": observables,
        "neck_growth": neck_growth,
        "log_evidence": record.log_evidence,
        "ess": record.ess,
        "khat": record.khat,
        "failures": record.failures,
        "sensitivity": record.sensitivity,
        "advice": record.advice,
        "out": out.map(|path| path.display().to_string()),
    });
    if let Some(population) = &record.population {
        summary["population"] = json!(population);
    }
    pretty(&summary)
}
