//! A plan in words: for `calibrate check` and `--dry-run`.

use std::path::Path;

use super::plan::{ExecutorPlan, ExternalPlan, Interpolate, ResultFormat, SimulatorPlan};
use super::plan_file::PlanFile;
use crate::check::{Understood, describe};
use crate::number::{shown_unit, significant};
use crate::plan::noise_in_words;

/// What `calibrate check` says of a plan.
#[must_use]
pub fn understood(file: &PlanFile) -> Understood {
    let plan = &file.plan;
    let (experiments, parameters) = (plan.experiments.len(), plan.parameters.len());
    let plural = |n: usize| if n == 1 { "" } else { "s" };
    Understood {
        headline: format!(
            "the plan {}: {parameters} parameter{}, {experiments} experiment{}, {} observations, {} runs",
            plan.name,
            plural(parameters),
            plural(experiments),
            plan.observations(),
            runs(plan),
        ),
        details: lines(plan, &file.executor),
        warnings: file.warnings.clone(),
    }
}

/// Runs of simulators that a plan asks for.
fn runs(plan: &ExternalPlan) -> usize {
    plan.budget() * plan.experiments.len()
}

/// What `--dry-run` prints.
#[must_use]
pub fn dry_run(file: &PlanFile, out: &Path) -> String {
    let mut text = format!("plan: {} ({})\n", file.plan.title, file.plan.name);
    for line in lines(&file.plan, &file.executor) {
        text.push_str("  ");
        text.push_str(&line);
        text.push('\n');
    }
    text.push_str(&format!("  results to    {}\n", out.display()));
    text
}

fn lines(plan: &ExternalPlan, executor: &ExecutorPlan) -> Vec<String> {
    let mut lines = vec!["parameters".to_owned()];
    for parameter in &plan.parameters {
        let unit = shown_unit(&parameter.unit);
        lines.push(format!("  {:<12} {} {unit}", parameter.name, describe(parameter.prior.spec())));
    }
    for experiment in &plan.experiments {
        lines.push(format!("experiment    {}", experiment.name));
        match &experiment.simulator {
            SimulatorPlan::Builtin(builtin) => {
                lines.push(format!(
                    "  simulator   built-in neck growth, {} kinetics, {} solver, R {} um{}",
                    builtin.kinetics,
                    builtin.solver.name,
                    significant(1e6 * builtin.radius_m, 4),
                    builtin.tau_s_radius_m.map_or_else(String::new, |radius| format!(
                        "; its tau_s is {} times the calibrated one",
                        significant(builtin.radius_m / radius, 4)
                    )),
                ));
                for (model, calibrated) in &builtin.parameters {
                    lines.push(format!("  {model:<11} is {calibrated}"));
                }
            }
            SimulatorPlan::Command(command) => {
                lines.push(format!("  command     {}", command.argv.join(" ")));
                lines.push(format!(
                    "  limits      {} s per run, {} retries of a lost run",
                    command.timeout_s, command.retries
                ));
            }
        }
        for observable in &experiment.observables {
            let points = observable.values.len();
            lines.push(format!(
                "  observable  {}: {points} point{} of {}{}",
                observable.name,
                if points == 1 { "" } else { "s" },
                observable.table,
                match (&observable.control_column, observable.control.first()) {
                    (Some(column), Some(first)) => format!(
                        ", {column} {first} .. {}",
                        observable.control.last().unwrap_or(first)
                    ),
                    _ => String::new(),
                }
            ));
            lines.push(format!("    noise     {}", noise_in_words(&observable.noise)));
            if let Some(result) = &observable.result {
                let between = match result.interpolate {
                    Interpolate::Linear => "interpolated",
                    Interpolate::Refuse if result.control.is_some() => "never interpolated",
                    Interpolate::Refuse => "row by row",
                };
                let format = match result.format {
                    ResultFormat::Csv => "csv",
                    ResultFormat::Whitespace => "whitespace",
                    ResultFormat::Json => "json",
                };
                lines.push(format!(
                    "    result    {} of {} ({format}), {between}",
                    result.value, result.file
                ));
            }
        }
    }
    lines.push(match &plan.design {
        Some(design) => {
            format!("design        {} parameter sets of {}", design.sets.len(), design.file)
        }
        None => format!(
            "sampler       {} parameter sets, seed {}",
            plan.sampler.samples, plan.sampler.seed
        ),
    });
    lines.push(format!(
        "executor      {}, {} runs in all",
        executor_in_words(executor),
        runs(plan)
    ));
    lines
}

fn executor_in_words(executor: &ExecutorPlan) -> String {
    let at_a_time = |n: Option<usize>, what: &str| match n {
        Some(n) => format!("{n} {what}"),
        None => format!("as many {what} as there are cores"),
    };
    match executor {
        ExecutorPlan::Threads { threads } => at_a_time(*threads, "threads of this program"),
        ExecutorPlan::Local { parallel } => at_a_time(*parallel, "processes at a time"),
        ExecutorPlan::Slurm(slurm) => format!(
            "Slurm{}{}",
            slurm.partition.as_ref().map_or_else(String::new, |p| format!(", partition {p}")),
            slurm.account.as_ref().map_or_else(String::new, |a| format!(", account {a}")),
        ),
    }
}
