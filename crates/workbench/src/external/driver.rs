//! `calibrate --plan` and `calibrate --resume`: runs a plan in its folder, and takes up again what was interrupted.
//!
//! A resumed run is the same run once more: the sampler draws the same parameter sets, and those that were run before
//! are answered from the folder.

use std::fs;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use campaign::slurm::{Slurm, SlurmSettingError, SlurmSettings};
use campaign::{Campaign, CampaignError, Event, Executor, ExecutorError, Local, Stop};
use indicatif::ProgressBar;
use smc_calib::{CalibrateError, Observer, Posterior, StageRecord};

use super::REPORT;
use super::describe;
use super::plan::{ExecutorPlan, ExternalPlan, SlurmPlan};
use super::plan_file::PlanFile;
use super::posterior_file::PlanPosterior;
use super::problem::{self, Unfinished};
use super::report;
use super::simulator::{PlanSimulator, Runner, STOPPED, sample_of};
use super::store::{self, Stored};
use super::summary;
use crate::args::{OnInterrupt, RunArgs};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::interrupt;
use crate::output::{POSTERIOR_RECORD, RunFolder};
use crate::run::{pool, pretty, progress_bar};

/// How long things took. Apart from the posterior, whose bytes do not depend on it.
#[derive(Debug, serde::Serialize)]
struct Timings {
    seconds: f64,
    stage_seconds: Vec<f64>,
}

/// Runs a plan, or goes on with one.
///
/// # Errors
///
/// [`Failure`] with the reason. What had finished is in the folder of the run by then.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    let given = args.plan.as_deref().map(PlanFile::read).transpose()?;
    let (dir, campaign, stored) = match (&args.resume, &given) {
        (Some(dir), given) => {
            let (campaign, stored, damage) = store::open(dir, given.as_ref())?;
            store::report_damage(&damage);
            about_the_plan_file(&stored, given.as_ref(), args.quiet);
            about_the_version(&stored.plan);
            (dir.clone(), campaign, stored)
        }
        (None, Some(file)) => {
            let dir =
                args.out.clone().unwrap_or_else(|| PathBuf::from("results").join(&file.plan.name));
            if args.dry_run {
                return dry_run(file, &dir, args.json);
            }
            for warning in &file.warnings {
                if args.quiet {
                    eprintln!("warning: {warning}");
                }
            }
            let (campaign, stored) = store::create(&dir, file)?;
            (dir, campaign, stored)
        }
        (None, None) => return Ok(()),
    };
    drive(&dir, &campaign, &stored, args)
}

fn dry_run(file: &PlanFile, dir: &Path, json: bool) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    if json {
        write!(out, "{}", pretty(&file.plan)?)?;
    } else {
        write!(out, "{}", describe::dry_run(file, dir))?;
    }
    for warning in &file.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(())
}

/// A run goes on with the plan it began with; that the file has changed since is worth saying.
fn about_the_plan_file(stored: &Stored, given: Option<&PlanFile>, quiet: bool) {
    if given.is_some() || quiet {
        return;
    }
    if let Ok(now) = PlanFile::read(&stored.file) {
        let same = ExternalPlan { version: stored.plan.version.clone(), ..now.plan } == stored.plan;
        if !same {
            eprintln!(
                "note: {} has changed since the run began; it goes on with the plan it began with",
                stored.file.display()
            );
        } else if now.executor != stored.executor {
            eprintln!(
                "note: [executor] of {0} has changed; to use it: calibrate --resume DIR --plan {0}",
                stored.file.display()
            );
        }
    }
}

fn about_the_version(plan: &ExternalPlan) {
    let version = env!("CARGO_PKG_VERSION");
    if plan.version != version {
        eprintln!(
            "warning: version {} of calibrate began this run, this is {version}: finished runs are used as far as \
             this version asks for the same parameter sets",
            plan.version
        );
    }
}

/// Progress on a terminal, and the clock.
struct Watch<'a> {
    bar: ProgressBar,
    campaign: &'a Campaign,
    last: Instant,
    stage_seconds: Vec<f64>,
    failed: Option<CampaignError>,
}

impl<'a> Watch<'a> {
    fn new(campaign: &'a Campaign, total: u64, done: u64, quiet: bool) -> Self {
        let bar = progress_bar(total, "runs", quiet);
        bar.set_position(done);
        bar.reset_eta();
        Self { bar, campaign, last: Instant::now(), stage_seconds: Vec::new(), failed: None }
    }
}

impl Observer for Watch<'_> {
    fn stage(&mut self, record: &StageRecord) -> ControlFlow<()> {
        let now = Instant::now();
        self.stage_seconds.push(now.duration_since(self.last).as_secs_f64());
        self.last = now;
        self.bar.set_message(format!("(stage {}, ESS {:.0})", record.stage, record.ess));
        let value = serde_json::to_value(record).unwrap_or_default();
        if let Err(error) = self.campaign.record_iteration(record.stage as u32, &value) {
            self.failed = Some(error);
            return ControlFlow::Break(());
        }
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// What the progress bar shows of an event, and what is said beside it.
fn show(bar: &ProgressBar, plan: &ExternalPlan, quiet: bool) -> impl FnMut(Event) + Send + 'static {
    let bar = bar.clone();
    let names: Vec<String> =
        plan.experiments.iter().map(|experiment| experiment.name.clone()).collect();
    let several = names.len() > 1;
    let place = {
        let plan = plan.clone();
        move |number: u64| {
            let (sample, experiment) = sample_of(&plan, number);
            let of = if several { format!(", {}", names[experiment]) } else { String::new() };
            format!("run {number} (sample {}{of})", sample + 1)
        }
    };
    let mut noted: std::collections::BTreeSet<String> = std::collections::BTreeSet::new();
    move |event| {
        let note = match event {
            Event::Ended { failed: None, .. } => {
                bar.inc(1);
                None
            }
            Event::Ended { number, failed: Some(kind) } => {
                bar.inc(1);
                // The first of a kind; all are counted in the report.
                let words = kind.to_string();
                noted.insert(words.clone()).then(|| format!("{}: {words}", place(number)))
            }
            Event::Retried { number, kind } => {
                let words = format!("lost: {kind}");
                noted.insert(words).then(|| format!("{}: {kind}; it is run again", place(number)))
            }
            Event::Note(words) => Some(words),
            _ => None,
        };
        if let Some(note) = note
            && !quiet
        {
            bar.suspend(|| eprintln!("note: {note}"));
        }
    }
}

fn executor_of(plan: &ExecutorPlan) -> Result<Box<dyn Executor + Send>, Failure> {
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    match plan {
        ExecutorPlan::Threads { .. } => Ok(Box::new(Local { parallel: 1 })),
        ExecutorPlan::Local { parallel } => {
            Ok(Box::new(Local { parallel: parallel.unwrap_or_else(cores) }))
        }
        ExecutorPlan::Slurm(slurm) => {
            let refused = |error: SlurmSettingError| {
                InputError::new("plan", Mistake::OutOfRange)
                    .in_field(format_args!("executor.{}", error.field))
                    .found(error.problem)
            };
            let program = std::env::current_exe().map_err(|error| {
                RunError::new(format_args!("the path of this program is not known: {error}"))
            })?;
            let worker = vec![program.display().to_string(), "run-task".to_owned()];
            let slurm = Slurm::new(settings(slurm), worker).map_err(refused)?;
            Ok(Box::new(slurm))
        }
    }
}

/// The options of a plan as the executor takes them, its defaults where the plan says nothing.
fn settings(plan: &SlurmPlan) -> SlurmSettings {
    let defaults = SlurmSettings::default();
    SlurmSettings {
        partition: plan.partition.clone(),
        account: plan.account.clone(),
        time_min: plan.time_min,
        memory_mb: plan.memory_mb,
        cpus: plan.cpus,
        extra: plan.extra.clone(),
        setup: plan.setup.clone(),
        max_parallel: plan.max_parallel,
        chunk: plan.chunk.unwrap_or(defaults.chunk),
        poll_min_s: plan.poll_min_s.unwrap_or(defaults.poll_min_s),
        poll_max_s: plan.poll_max_s.unwrap_or(defaults.poll_max_s),
        grace_s: plan.grace_s.unwrap_or(defaults.grace_s),
        command_timeout_s: plan.command_timeout_s.unwrap_or(defaults.command_timeout_s),
    }
}

fn drive(dir: &Path, campaign: &Campaign, stored: &Stored, args: &RunArgs) -> Result<(), Failure> {
    let plan = &stored.plan;
    let begun = Instant::now();
    let stop = Stop::new();
    {
        let stop = stop.clone();
        let detach = args.on_interrupt == OnInterrupt::Detach;
        interrupt::listen_with(move || if detach { stop.detach() } else { stop.cancel() });
    }
    let commands = plan.commands().count();
    let total = (plan.budget() * commands) as u64;
    let done =
        campaign.tasks().iter().filter(|task| campaign.outcome(task.number).is_some()).count();
    let mut watch = Watch::new(campaign, total, done as u64, args.quiet || commands == 0);
    let runner = Runner {
        executor: executor_of(&stored.executor)?,
        watch: Box::new(show(&watch.bar, plan, args.quiet)),
    };
    let simulator = PlanSimulator::new(plan, campaign, runner, stop)?;
    let threads = match &stored.executor {
        ExecutorPlan::Threads { threads } => args.threads.or(*threads),
        _ => args.threads,
    };
    let pool = pool(threads)?;
    let sampled = pool.install(|| problem::calibrate(plan, &simulator, &mut watch));
    watch.bar.finish_and_clear();
    let Watch { failed, stage_seconds, .. } = watch;
    if let Some(error) = failed {
        return Err(store::refused(dir, error));
    }
    if let Some(error) = simulator.take_failure() {
        return Err(stopped(dir, campaign, plan, error));
    }
    let posterior: Posterior = match sampled {
        Ok(posterior) if !interrupt::asked() => posterior,
        Ok(_) | Err(Unfinished::Sampler(CalibrateError::Interrupted { .. })) => {
            let error = ExecutorError::Interrupted { detached: false };
            return Err(stopped(dir, campaign, plan, error));
        }
        Err(Unfinished::Sampler(CalibrateError::Fatal { cause, .. })) if cause == STOPPED => {
            let error = ExecutorError::Interrupted { detached: false };
            return Err(stopped(dir, campaign, plan, error));
        }
        Err(Unfinished::Sampler(error)) => return Err(unfinished(dir, &error)),
        Err(error) => return Err(error.into()),
    };
    let file = report::of(plan, &stored.warnings, &posterior)?;
    let timings = Timings { seconds: begun.elapsed().as_secs_f64(), stage_seconds };
    pool.install(|| publish(dir, &file, &posterior, &timings))?;

    let report = dir.join(REPORT);
    if args.quiet {
        for line in &file.advice {
            eprintln!("warning: {line}");
        }
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        writeln!(out, "{}", summary::json(&file, Some(&report)).map_err(RunError::new)?)?;
    } else if !args.quiet {
        write!(out, "{}", summary::text(&file, Some(timings.seconds), Some(&report)))?;
    }
    Ok(())
}

/// Writes the report into the folder of the run, whole or not at all.
fn publish(
    dir: &Path,
    file: &PlanPosterior,
    posterior: &Posterior,
    timings: &Timings,
) -> Result<(), Failure> {
    // The folder is ours alone: what drivers that were killed had begun to write is of no use.
    if let Ok(entries) = fs::read_dir(dir) {
        let prefix = format!(".{REPORT}.tmp-");
        for entry in entries.flatten() {
            if entry.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
    }
    let folder = RunFolder::prepare(&dir.join(REPORT), POSTERIOR_RECORD)?;
    let staging = folder.stage()?;
    let shown = dir.join(REPORT);
    let write = |name: &str, bytes: &[u8]| {
        staging.write(&shown, name, bytes).map_err(|error| {
            error.help(format_args!(
                "make room on the disk, then: calibrate --resume {}; no run is made again",
                dir.display()
            ))
        })
    };
    report::write_all(file, posterior, &write)?;
    write("timings.json", pretty(timings)?.as_bytes())?;
    interrupt::check().map_err(|_| paused(dir, "every run has ended", false))?;
    staging.publish()?;
    Ok(())
}

fn paused(dir: &Path, what: &str, detached: bool) -> Failure {
    let jobs = if detached { "; jobs on the cluster go on" } else { "" };
    Failure::Paused(format!(
        "interrupted: {what}{jobs}\n  go on with: calibrate --resume {}",
        dir.display()
    ))
}

/// Why the runs stopped, as the user meets it.
fn stopped(dir: &Path, campaign: &Campaign, plan: &ExternalPlan, error: ExecutorError) -> Failure {
    let resume = format!("then: calibrate --resume {}", dir.display());
    match error {
        ExecutorError::Interrupted { detached } => {
            let ended = campaign
                .tasks()
                .iter()
                .filter(|task| campaign.outcome(task.number).is_some())
                .count();
            let total = plan.budget() * plan.commands().count();
            paused(dir, &format!("{ended} of {total} runs have ended and are stored"), detached)
        }
        ExecutorError::CannotStart { .. } => RunError::new(&error)
            .help("install the program, or correct argv in the plan and begin another run")
            .help(resume)
            .into(),
        ExecutorError::Campaign(error) => store::refused(dir, error),
        other => RunError::new(other).help(resume).into(),
    }
}

/// A calibration that cannot give a posterior, although its runs were made.
fn unfinished(dir: &Path, error: &CalibrateError) -> Failure {
    match error {
        CalibrateError::Setting { setting, value, range } => {
            InputError::new("plan", Mistake::OutOfRange)
                .in_field(format_args!("sampler.{setting}"))
                .found(value)
                .expected(range)
                .into()
        }
        _ => RunError::new(error)
            .help(format_args!("causes and runs as tables: calibrate export {}", dir.display()))
            .into(),
    }
}
