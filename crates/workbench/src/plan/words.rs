//! A plan in words: for `calibrate check` and `--dry-run`.

use std::path::Path;

use campaign::inputs::Put;
use campaign::{ANSWER, Format, Interpolation};
use smc_calib::{DistanceScale, FixedSigma, Noise, Parameter, PriorSpec};

use super::types::{
    ExecutorPlan, ExperimentPlan, ObservablePlan, PairPlan, Plan, Planned, SimulatorPlan,
};
use crate::number::{shown_unit, significant};

/// Contents of a file in words: a headline, details, and warnings.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Understood {
    /// Kind of the file, on one line.
    pub headline: String,
    /// Its contents, one statement per line.
    pub details: Vec<String>,
    /// Warnings on allowed input.
    pub warnings: Vec<String>,
}

/// A plan as `calibrate check` prints it.
pub fn understood(planned: &Planned) -> Understood {
    let plan = &planned.plan;
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
        details: lines(plan, &planned.executor),
        warnings: planned.warnings.clone(),
    }
}

/// Number of simulations that a plan asks for.
fn runs(plan: &Plan) -> usize {
    plan.budget() * plan.experiments.len()
}

/// The text that `--dry-run` prints.
pub fn dry_run(planned: &Planned, out: &Path) -> String {
    let mut text = format!("plan: {} ({})\n", planned.plan.title, planned.plan.name);
    for line in lines(&planned.plan, &planned.executor) {
        text.push_str("  ");
        text.push_str(&line);
        text.push('\n');
    }
    text.push_str(&format!("  results to    {}\n", out.display()));
    text
}

fn lines(plan: &Plan, executor: &ExecutorPlan) -> Vec<String> {
    let prior_source =
        plan.prior_source.as_ref().map_or_else(String::new, |file| format!(" (priors of {file})"));
    let mut lines = vec![format!("parameters{prior_source}")];
    for parameter in &plan.parameters {
        let unit = shown_unit(&parameter.unit);
        let prior = prior_in_words(parameter.prior.spec());
        lines.push(format!("  {:<11} {prior} {unit}", parameter.name));
    }
    for experiment in &plan.experiments {
        lines.extend(experiment_lines(experiment));
    }
    lines.push(match &plan.design {
        Some(design) => {
            format!("design        {} parameter sets of {}", design.sets.len(), design.file)
        }
        None => sampler_in_words(plan),
    });
    if let Some(earlier) = &plan.proposal {
        lines.push(format!("begins from   {}", earlier.result()));
        lines.push(format!("  takes       {}", earlier.taken()));
    }
    lines.push(format!(
        "executor      {}, {} runs in all",
        executor_in_words(executor),
        runs(plan)
    ));
    lines.extend(idle(plan, executor));
    lines
}

fn sampler_in_words(plan: &Plan) -> String {
    let sampler = &plan.sampler;
    let placed = match sampler.placed_by_process() {
        0 => None,
        all if all == sampler.samples => Some("placed".to_owned()),
        first => Some(format!("the first {first} placed")),
    };
    let at_a_time = sampler.placed_at_a_time().map_or_else(String::new, |n| match n {
        1 => ", one by one".into(),
        _ => format!(", up to {n} at a time"),
    });
    format!(
        "sampler       {} simulations{}, {}, seed {}{}",
        sampler.samples,
        match sampler.earlier.last() {
            Some(earlier) => format!(" ({earlier} of them those of the run that is extended)"),
            None => String::new(),
        },
        match placed {
            Some(placed) if !plan.is_tuned() =>
                format!("{placed} by a Gaussian process{at_a_time}"),
            _ => format!("{} adaptive stages", sampler.iterations),
        },
        sampler.seed,
        match sampler.overlap {
            0 => String::new(),
            overlap => format!(", overlap {overlap}: runs of several stages go on at a time"),
        }
    )
}

/// Processes that stand idle because fewer runs are placed at a time than could go on, where a larger batch would help.
fn idle(plan: &Plan, executor: &ExecutorPlan) -> Option<String> {
    let ExecutorPlan::Local { parallel: Some(parallel) } = executor else { return None };
    let (sampler, commands) = (&plan.sampler, plan.commands().count());
    let runs = sampler.placed_at_a_time()? * commands;
    let waits = sampler.overlap == 0 && plan.design.is_none() && !plan.is_tuned();
    if runs == 0 || runs >= *parallel || !waits {
        return None;
    }
    let batch = parallel.div_ceil(commands);
    if sampler.batch >= batch {
        return None;
    }
    Some(format!(
        "  idle        {} of {parallel} processes, as {runs} run{} can go on at a time; batch = {batch} in [sampler] takes less \
         time and is less accurate",
        parallel - runs,
        if runs == 1 { "" } else { "s" },
    ))
}

fn experiment_lines(experiment: &ExperimentPlan) -> Vec<String> {
    let mut lines = vec![format!("experiment    {}", experiment.name)];
    match &experiment.simulator {
        SimulatorPlan::Builtin(pair) => lines.extend(pair_lines(pair)),
        SimulatorPlan::Command(call) => {
            let kind = if call.worker { "worker " } else { "command" };
            lines.push(format!("  {kind}     {}", call.argv.join(" ")));
            for (put, by) in
                [("copied", Put::Copy), ("linked", Put::Link), ("filled in", Put::Fill)]
            {
                let files = call.files.iter().filter(|file| file.by == by);
                let files: Vec<&str> = files.map(|file| file.from.as_str()).collect();
                if !files.is_empty() {
                    lines.push(format!("  {put:<11} {}", files.join(", ")));
                }
            }
            lines.push(format!(
                "  limits      {} s per run, {} retries of a lost run",
                call.timeout_s, call.retries
            ));
            let codes: Vec<String> =
                call.try_later.exit_codes.iter().map(ToString::to_string).collect();
            if !codes.is_empty() {
                let line = format!("  try later   at exit code {}", codes.join(", "));
                lines.push(line);
            }
        }
        SimulatorPlan::Function { name } => lines.push(format!("  function    {name}")),
    }
    for observable in &experiment.observables {
        let worker = matches!(&experiment.simulator, SimulatorPlan::Command(call) if call.worker);
        lines.extend(observable_lines(observable, worker));
    }
    lines
}

fn pair_lines(pair: &PairPlan) -> Vec<String> {
    let powder = &pair.powder;
    let mut lines = vec![
        "  simulator   built-in neck growth of a pair of particles".to_owned(),
        format!(
            "  powder      R {} um, E {} GPa, gamma {} mN/m, rho {} kg/m3, phi {}",
            significant(1e6 * powder.radius_m, 4),
            significant(1e-9 * powder.youngs_modulus_pa, 3),
            significant(1e3 * powder.surface_tension_n_per_m, 4),
            significant(powder.density_kg_per_m3, 4),
            significant(pair.final_contact_ratio, 4)
        ),
        format!("  kinetics    {}", pair.kinetics),
        format!("  solver      {}", pair.solver.reason),
    ];
    if let Some(radius) = pair.tau_s_radius_m {
        let factor = significant(powder.radius_m / radius, 4);
        lines.push(format!("  tau_s       is {factor} times the calibrated one"));
    }
    lines.extend(pair.heat.as_ref().map(|heat| format!("  heat        {}", heat.in_words())));
    for (model, calibrated) in &pair.parameters {
        lines.push(format!("  {:<11} is {calibrated}", model.name()));
    }
    lines
}

fn observable_lines(observable: &ObservablePlan, worker: bool) -> Vec<String> {
    let points = observable.values.len();
    let span = match (&observable.control_column, &observable.control[..]) {
        (Some(column), [first, .., last]) => format!(", {column} {first} .. {last}"),
        (Some(column), [only]) => format!(", {column} {only}"),
        _ => String::new(),
    };
    let mut lines = vec![
        format!(
            "  observable  {}: {points} point{} of {}{span}",
            observable.name,
            if points == 1 { "" } else { "s" },
            observable.table,
        ),
        format!("    noise     {}", noise_in_words(&observable.noise)),
    ];
    lines.extend(observable.table_read.iter().map(|how| format!("    read      {how}")));
    if let Some(result) = &observable.result {
        let between = match result.interpolate {
            Interpolation::Linear => "interpolated",
            Interpolation::Refuse if result.control.is_some() => "never interpolated",
            Interpolation::Refuse => "row by row",
        };
        let format = match result.format {
            Format::Csv => "csv",
            Format::Whitespace => "whitespace",
            Format::Json => "json",
        };
        let source = match result.file.as_str() {
            ANSWER if worker => "the answer".to_owned(),
            file => format!("{file} ({format})"),
        };
        lines.push(format!("    result    {} of {source}, {between}", result.value));
    }
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

/// A noise model on one line.
pub fn noise_in_words(noise: &Noise) -> String {
    match noise {
        Noise::Inferred { nu0, s0 } => {
            format!("inferred: sigma^2 ~ Inverse-Gamma({nu0}/2, {nu0} * {s0}^2/2), integrated out")
        }
        Noise::Correlated { nu0, s0, scale, .. } => format!(
            "correlated: independent part and Ornstein-Uhlenbeck part, distances {}; sigma^2 ~ Inverse-Gamma({nu0}/2, {nu0} * {s0}^2/2), integrated out, as are correlation length and white share",
            match scale {
                Some(DistanceScale::Linear) => "in the control variable or rows",
                Some(DistanceScale::Log) => "in the logarithm of the control variable",
                None => "in the control variable or its logarithm",
            }
        ),
        Noise::Robust { nu0, s0 } => format!(
            "robust: independent, 0.5 % of them outliers of 10 sigma; sigma^2 ~ Inverse-Gamma({nu0}/2, {nu0} * {s0}^2/2), integrated out"
        ),
        Noise::Fixed { sigma: FixedSigma::Absolute(sigma) } => format!("fixed: sigma {sigma}"),
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => {
            format!("fixed: sigma {share} times each measured value")
        }
        Noise::Fixed { sigma: FixedSigma::PerPoint } => {
            "fixed: the column sigma of the table".to_owned()
        }
        Noise::EssTarget { share } => format!(
            "tuned until {share} of an iteration's samples are effective: NOT a posterior, for comparison only"
        ),
    }
}

/// A prior on one line.
pub fn prior_in_words(prior: &PriorSpec) -> String {
    match *prior {
        PriorSpec::Uniform { lower, upper } => {
            format!("uniform {} to {}", short(lower), short(upper))
        }
        PriorSpec::LogUniform { lower, upper } => {
            format!("log-uniform {} to {}", short(lower), short(upper))
        }
        PriorSpec::Normal { mean, sd } => format!("normal {} +- {}", short(mean), short(sd)),
        PriorSpec::LogNormal { median, sd_log10 } => {
            format!("log-normal, median {}, sd {} decades", short(median), short(sd_log10))
        }
        PriorSpec::TruncatedNormal { mean, sd, lower, upper } => format!(
            "normal {} +- {} between {} and {}",
            short(mean),
            short(sd),
            short(lower),
            short(upper)
        ),
    }
}

/// Parameters, units and priors as the rows of a table.
pub(crate) fn prior_rows(plan: &Plan) -> Vec<Vec<String>> {
    let row = |parameter: &Parameter| {
        let prior = prior_in_words(parameter.prior.spec());
        vec![parameter.name.clone(), parameter.unit.clone(), prior]
    };
    plan.parameters.iter().map(row).collect()
}

/// A number without the noise of its last bits.
pub(crate) fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}
