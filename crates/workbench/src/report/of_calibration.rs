//! A calibration as the sections of its report.

use smc_calib::trust::limits::{KHAT_LIMIT, khat_in_words};

use super::pictures::not_in_corner;
use super::summary::{neck_growth, text};
use super::tables::{observable_cells, posterior_cells};
use crate::careful::{as_far_in_words, counted, noise_too_large};
use crate::number::{shown_unit, significant, with_error};
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, MOST_ROWS, Page, Part, Verdict};
use crate::plan::{
    ObservablePlan, PLAN, Plan, SimulatorPlan, command_line, noise_in_words, prior_rows, shell_word,
};
use crate::record::{ObservableRecord, Record};

/// The report of a calibration: its record, its figures, the files that it was made of, and the sums of its own.
pub(crate) fn page(record: &Record, drawn: &[Drawn], inputs: Option<&Inputs>, sums: &str) -> Page {
    let plan = &record.plan;
    let mut page = Page {
        title: plan.title.clone(),
        kind: match record.population {
            Some(_) => "Population of calibrations".to_owned(),
            None => "Calibration".to_owned(),
        },
        version: plan.version.clone(),
        verdict: Some(verdict(record)),
        summary: text(record, None, None),
        advice: record.advice.clone(),
        asked: asked(record),
        data: data(record),
        answer: answer(record),
        rows: rows(record),
        model: model(record),
        checked: checked(record),
        repeat: repeat(record, inputs, sums),
        cite: page::citation(&plan.version),
        ..Page::default()
    };
    if let Some(source) = &plan.source {
        page.cite.say(format!("The data: {source}."));
    }
    page.show(drawn, |name| {
        let left_out = not_in_corner(record);
        match name {
            "corner" if !left_out.is_empty() => format!(
                "Posterior of the parameters that the data say most of, and of each pair of them, beside the prior. Not drawn: {}.",
                left_out.join(", ")
            ),
            _ => caption(name).to_owned(),
        }
    });
    page
}

fn verdict(record: &Record) -> Verdict {
    let good = record.trusted();
    let word = match record.trust.verdict {
        _ if good => "To be trusted.",
        smc_calib::Verdict::Converged => {
            "Careful: the sampling is good, but read below why the intervals may not be."
        }
        smc_calib::Verdict::Rough => "Rough: read below what is known less well.",
        smc_calib::Verdict::Untrusted => "Not to be trusted.",
    };
    let why = format!("Sampling: {}.", record.trust.line(&record.log_evidence));
    Verdict { good, word: word.to_owned(), why }
}

/// What a figure shows.
fn caption(name: &str) -> &'static str {
    match name {
        "corner" => "Posterior of each parameter and of each pair, beside the prior.",
        "recursion" => "What was known of each parameter after each observation.",
        "convergence" => {
            "How the sampler got there: evidence, effective samples and weights, stage by stage."
        }
        "failures" => "Where in the parameter's range simulations failed.",
        "pairs" => "Each member by its own measurements alone, and the next one.",
        "shrunk" => "Each member as one of the population, and the next one.",
        "next" => "All measurements, and the bands of the next pair.",
        name if name.starts_with("fit") => "Measurements, and the bands of the posterior.",
        _ => "Measured minus best curve: what the model leaves over.",
    }
}

fn asked(record: &Record) -> Part {
    let plan = &record.plan;
    let mut part = Part::default();
    let names = plan.parameter_names().join(", ");
    if let Some(population) = &plan.population {
        part.say(format!(
            "How much do {names} differ between members, and what will the next one have?"
        ));
        for run in &population.runs {
            part.fact(format!("Member {}", run.name), &run.run);
        }
        part.fact("Evaluations", record.counters.simulations.to_string());
        return part;
    }
    part.say(format!(
        "Which values of {names} explain {} measured values, and how sure is that?",
        plan.observations()
    ));
    for experiment in &plan.experiments {
        let words = match &experiment.simulator {
            SimulatorPlan::Builtin(pair) => {
                let powder = &pair.powder;
                format!(
                    "neck growth of a pair of particles, {} kinetics; R {} µm, E {} GPa, gamma {} mN/m, final a/R {}; solver {}",
                    pair.kinetics,
                    significant(1e6 * powder.radius_m, 4),
                    significant(1e-9 * powder.youngs_modulus_pa, 3),
                    significant(1e3 * powder.surface_tension_n_per_m, 4),
                    significant(pair.final_contact_ratio, 4),
                    pair.solver.name,
                )
            }
            SimulatorPlan::Command(call) => format!("the program {}", call.argv.join(" ")),
            SimulatorPlan::Function { name } => format!("the function {name}"),
        };
        part.fact(format!("Model of {}", experiment.name), words);
    }
    part.fact(
        "Simulations",
        format!("{}, seed {}", record.counters.simulations, plan.sampler.seed),
    );
    if let Some(earlier) = &plan.proposal {
        part.fact("Begun from", format!("{}: {}", earlier.result(), earlier.taken()));
    }
    part
}

fn data(record: &Record) -> Part {
    let mut part = Part::default();
    if let Some(source) = &record.plan.source {
        part.fact("Source", source);
    }
    for (plan, found) in record.observables() {
        let points = plan.values.len();
        let mut words = format!("{points} values of {}", plan.table);
        if let Some(how) = &plan.table_read {
            words.push_str(&format!(", read {how}"));
        }
        if let (Some(column), [first, .., last]) = (&plan.control_column, &plan.control[..]) {
            words.push_str(&format!("; {column} from {first} to {last} {}", plan.control_unit));
        }
        if let Some([from, to]) = plan.window {
            words.push_str(&format!("; fitted from {from} to {to} {}", plan.control_unit));
        }
        part.fact(&found.label, words.trim_end());
    }
    part
}

/// Measured and predicted values.
fn rows(record: &Record) -> Part {
    let mut part = Part::default();
    for (plan, found) in record.observables() {
        let caption = format!("{}: measured, and as the posterior has it", found.label);
        let rows = found.predictive.iter().take(MOST_ROWS).map(|band| {
            let four = |value: f64| significant(value, 4);
            vec![
                plan.control.get(band.index).map_or_else(String::new, |value| value.to_string()),
                plan.values.get(band.index).map_or_else(String::new, |value| value.to_string()),
                found.map.get(band.index).map_or_else(String::new, |value| four(*value)),
                four(band.mean),
                format!("{} … {}", four(band.curve90[0]), four(band.curve90[1])),
                format!("{} … {}", four(band.noisy90[0]), four(band.noisy90[1])),
            ]
        });
        let control = plan.control_column.clone().unwrap_or_else(|| "row".to_owned());
        let measured = format!("measured {}", shown_unit(&plan.unit));
        let columns = [
            &control,
            measured.trim_end(),
            "best",
            "mean",
            "90 % of curves",
            "90 % of measurements",
        ];
        part.table(caption, &columns, rows.collect());
        if found.predictive.len() > MOST_ROWS {
            let all = found.predictive.len();
            part.say(format!(
                "{}: the first {MOST_ROWS} of {all} rows; all are in fit.csv.",
                found.label
            ));
        }
    }
    part
}

fn answer(record: &Record) -> Part {
    let mut part = Part::default();
    if let Some(population) = &record.population {
        let (columns, rows) = super::population::cells(record, population);
        part.table(
            "Mean and spread of the population, its members and the next one",
            &columns,
            rows,
        );
        return part;
    }
    let (columns, rows) = posterior_cells(record);
    part.table("Posterior of the parameters and of the noise", &columns, rows);
    let (columns, rows) = observable_cells(record);
    part.table("How well the measurements are met", &columns, rows);
    if let Some(sensitivity) = record.sensitivity.as_ref().filter(|found| found.trusted) {
        let rows = sensitivity.parameters.iter().map(|found| {
            let [lower, upper] = found.eti95.map(|end| significant(end, 3));
            vec![
                found.name.clone(),
                significant(found.median, 3),
                format!("{lower} … {upper}"),
                format!("{:+.1}", found.shift),
                significant(found.widening, 2),
            ]
        });
        let columns = ["parameter", "median", "95 % interval", "moves by [sd]", "times as wide"];
        part.table("The same with correlated errors", &columns, rows.collect());
    }
    let others = neck_growth(record).map_or(&[][..], |neck| &neck.other_kinetics);
    let rows = others.iter().map(|other| {
        let [lower, upper] = other.tau_s_eti95.map(|end| significant(end, 3));
        vec![
            other.kinetics.to_string(),
            {
                let (ln, error) = (other.ln_bayes_factor, other.ln_bayes_factor_se);
                format!("{} ± {}", with_error(ln, error, 2), significant(error, 2))
            },
            format!("{} s ({lower} … {upper})", significant(other.tau_s_median, 3)),
            match (other.judged, other.fits_as_well) {
                (false, _) => "not judged: too few simulations",
                (true, true) => "fits as well or better",
                (true, false) => "fits worse",
            }
            .to_owned(),
        ]
    });
    let columns = ["kinetics", "ln Bayes factor over the one used", "tau_s, 95 %", "judgement"];
    part.table("Other kinetics on the same data", &columns, rows.collect());
    part
}

fn model(record: &Record) -> Part {
    let plan = &record.plan;
    let mut part = Part::default();
    part.table("Priors", &["parameter", "unit", "prior"], prior_rows(plan));
    if let Some(source) = &plan.prior_source {
        part.fact("Priors of", source);
    }
    for (plan, found) in record.observables() {
        part.fact(format!("Noise of {}", found.label), noise_in_words(&plan.noise));
    }
    part
}

/// A check of the sampling, or of the fit of an observable, in words.
fn checked(record: &Record) -> Part {
    let mut part = Part::default();
    let (trust, evidence) = (&record.trust, &record.log_evidence);
    part.fact(
        "Effective samples",
        format!(
            "{:.0}, where {:.0} are wished for",
            trust.effective_samples, trust.effective_samples_wished
        ),
    );
    part.fact(
        "Weights",
        format!("k-hat {}, where {KHAT_LIMIT} is the limit", khat_in_words(record.khat)),
    );
    part.fact(
        "Evidence",
        format!(
            "{}; its two estimates, {:.3} ± {:.3} and {:.3} ± {:.3}, {}",
            trust.evidence(evidence).replace("+-", "±"),
            evidence.frozen_value,
            evidence.frozen_se,
            evidence.pooled_value,
            evidence.pooled_se,
            if evidence.agree { "agree" } else { "DISAGREE" },
        ),
    );
    for (plan, found) in record.observables() {
        part.fact(
            format!("Residuals of {}", found.label),
            residuals((plan, found), record.ess.importance),
        );
    }
    let failed: usize = record.failures.iter().map(|failure| failure.count).sum();
    part.fact("Failed simulations", failed.to_string());
    let rows = record.stages.iter().map(|stage| {
        vec![
            stage.stage.to_string(),
            stage.simulations.to_string(),
            stage.failed.to_string(),
            significant(stage.beta, 3),
            format!("{:.3} ± {}", stage.log_evidence, significant(stage.log_evidence_se, 2)),
            format!("{:.0}", stage.ess),
        ]
    });
    let columns = ["stage", "simulations", "failed", "beta", "log evidence", "effective samples"];
    part.table("Stages of the sampler", &columns, rows.collect());
    part
}

fn residuals((plan, found): (&ObservablePlan, &ObservableRecord), ess: f64) -> String {
    let residuals = &found.residuals;
    let misfit = residuals.misfit.map_or_else(String::new, |misfit| {
        format!("; {} times the expected noise", significant(misfit, 2))
    });
    let check = found.check.map_or_else(String::new, |check| {
        let words = |p: f64| as_far_in_words(p, counted(&check, ess));
        let but = noise_too_large(found).map_or_else(String::new, |but| format!(": {but}"));
        format!(
            "; data made by the posterior are as far off with {}, neighbours as much alike with {}{but}",
            words(check.as_far),
            words(check.as_alike)
        )
    });
    format!(
        "{}: correlation of neighbours {:.2}, runs of equal sign {:+.1} standard deviations from chance, over {} values{misfit}{check}",
        if residuals.independent { "independent" } else { "NOT independent" },
        residuals.lag1,
        residuals.runs_z,
        plan.values.len()
    )
}

/// The commands that make a result again, one to a line: that of its plan, and those that extended the run.
fn commands(plan: &Plan, inputs: Option<&Inputs>) -> Option<String> {
    let sampler = &plan.sampler;
    let of_file = inputs.and_then(|inputs| inputs.by_role(PLAN)).map(|file| shell_word(&file.name));
    let of_file = of_file.map(|file| format!("calibrate --plan {file}"));
    let begun = || command_line(&Plan { sampler: sampler.as_begun(), ..plan.clone() });
    let mut commands = of_file.or_else(begun)?;
    let folder = shell_word(&format!("results/{}", plan.name));
    let way = if plan.commands().next().is_some() { "--resume" } else { "--continue-from" };
    let extended = sampler.earlier.iter().skip(1).chain([&sampler.samples]);
    for samples in extended.take(sampler.earlier.len()) {
        commands.push_str(&format!("\ncalibrate {way} {folder} --samples {samples}"));
    }
    Some(commands)
}

fn repeat(record: &Record, inputs: Option<&Inputs>, sums: &str) -> Part {
    let mut part = Part::default();
    if let Some(first) = record.plan.sampler.earlier.first() {
        let all = record.plan.sampler.samples;
        part.say(format!("This run was extended, from {first} simulations to {all}."));
    }
    match commands(&record.plan, inputs) {
        Some(commands) => part.listings.push(commands),
        None => part.say(
            "The whole plan, with data, priors and settings, is in posterior.json: calibrate archive packs it, calibrate reproduce \
             runs it again.",
        ),
    }
    page::provenance(
        &mut part,
        (&record.plan.version, Some(record.plan.sampler.seed)),
        inputs,
        sums,
    );
    part
}
