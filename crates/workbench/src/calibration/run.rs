//! A calibration in a folder of its own: run, kept, taken up again.
//!
//! A plan with built-in simulators is computed in this process, and its folder appears whole. The runs of programs are
//! kept in the folder as they end, and the results are put beside them at the end. A resumed run is the
//! same run once more: the sampler draws the same parameter sets, and those that were run before are answered from the
//! folder.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

use campaign::slurm::Slurm;
use campaign::{Campaign, Event, Executor, ExecutorError, Local, Outcome};
use smc_calib::{Posterior, Simulator};

use super::extension;
use super::fingerprints::{self, Guard, Unchecked};
use super::options::{Finished, RunOptions, Timings, folder_of};
use super::same_plan;
use super::sampling::{Stages, failure, sample};
use super::store::{self, Stored, refused};
use super::{ahead, in_process, record, sensitivity, stopped};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::given_up::{self, Counting};
use crate::output::{Staging, pool, pretty};
use crate::plan::{ExecutorPlan, Plan, Planned, sample_of};
use crate::record::{FILE_NAME, Record};
use crate::report;
use crate::simulator::{Experiments, Runner};
use crate::watch::Watch;

/// Runs a plan and writes its results.
///
/// # Errors
///
/// [`Failure`] with the reason. In this process nothing has been written then, and earlier results are untouched; the
/// runs of programs that had ended are in the folder.
pub fn run(
    planned: &Planned,
    options: &RunOptions,
    watch: &dyn Watch,
) -> Result<Finished, Failure> {
    let out = folder_of(&planned.plan, options);
    if planned.plan.commands().next().is_some() {
        let (campaign, stored) = store::create(&out, planned)?;
        let executor = executor(&stored.executor, options)?;
        let driver = Driver { dir: &out, campaign: &campaign, stored: &stored, watch };
        return driver.drive(executor, options);
    }
    in_process::run(planned, None, options, watch)
}

/// Same as [`run`] for a plan that leaves its experiment to a function of the calling program. The function is called for the
/// samples alone, through [`Simulator::simulate_batch`], once for each; what it gave is kept in the folder.
///
/// # Errors
///
/// [`Failure`] with the reason; nothing has been written then.
pub fn run_function(
    planned: &Planned,
    function: &dyn Simulator,
    options: &RunOptions,
    watch: &dyn Watch,
) -> Result<Finished, Failure> {
    in_process::run(planned, Some(function), options, watch)
}

/// Same as [`run`] for a plan with programs, whose runs are made by this executor.
///
/// # Errors
///
/// [`Failure`] with the reason. Runs that had ended are in the folder.
pub fn run_by(
    planned: &Planned,
    executor: Box<dyn Executor + Send + '_>,
    options: &RunOptions,
    watch: &dyn Watch,
) -> Result<Finished, Failure> {
    let out = folder_of(&planned.plan, options);
    let (campaign, stored) = store::create(&out, planned)?;
    Driver { dir: &out, campaign: &campaign, stored: &stored, watch }.drive(executor, options)
}

/// Reads the plan file of the run in a folder: the earlier posterior that the run has begun from is the one that it keeps,
/// wherever the other result is now.
///
/// # Errors
///
/// As [`Planned::read`].
pub fn plan_of_run(file: &Path, dir: &Path) -> Result<Planned, InputError> {
    let stored = store::read_stored(dir).ok();
    Planned::read_for(file, stored.as_ref().and_then(|stored| stored.plan.proposal.as_ref()))
}

/// Goes on with the runs of programs in a folder. A plan that is given mends a damaged copy, and may name another
/// executor.
pub fn resume(
    dir: &Path,
    given: Option<&Planned>,
    options: &RunOptions,
    watch: &dyn Watch,
) -> Result<Finished, Failure> {
    store::check_owner(dir, options.accept_owner)?;
    let (mut campaign, mut stored, damage) = store::open(dir, given)?;
    // Before anything is given up for it.
    let retried = options.retry_failed.is_some();
    let extended = extension::planned(dir, &stored.plan, options.samples, retried)?;
    // A line that was being written when the driver was killed is no damage.
    for damage in damage.iter().filter(|damage| !damage.torn) {
        watch.warn(&format!("{damage}; what it held is made again, the rest is used"));
    }
    if given.is_none() {
        about_the_plan_file(dir, &stored, watch);
    }
    if campaign.is_copy() {
        watch.note(&format!(
            "{}: a copy of another run; from now on it is a run of its own, and what runs for the other is left alone",
            dir.display()
        ));
    }
    let given_up = |outcome: &Outcome| {
        options.retry_failed.as_ref().is_some_and(|words| stopped::is_wanted(words, outcome))
    };
    if let Some(cause) = &options.retry_failed {
        stopped::check_cause(&campaign, cause)?;
    }
    let damaged = damage.iter().any(|damage| damage.file.ends_with(fingerprints::FILE));
    let accepted = (options.accept_changes, damaged);
    let changed = store::check_programs(dir, &mut campaign, &mut stored, accepted, &given_up)?;
    if let Some(change) = changed {
        watch.note(&format!("{change}; the run goes on with it"));
    }
    if damage.iter().any(|damage| damage.file.ends_with(given_up::FILE)) {
        // Without it the sampler places other runs than were made.
        campaign.place_again().map_err(|error| refused(dir, error))?;
    }
    if !options.accept_changes {
        let suspects = Unchecked::of(&campaign).suspects(&store::began_with(&campaign));
        let again = campaign.forget(&suspects).map_err(|error| refused(dir, error))?;
        if again > 0 {
            watch.note(&format!(
                "{again} runs are made again: a program or a file beside it was written after they had begun, and the driver \
                 was killed before it had looked"
            ));
        }
    }
    if let Some(cause) = &options.retry_failed {
        let again =
            stopped::retry_failed(dir, &mut campaign, &stored.plan, (cause, options.keep_placed))?;
        watch.note(&format!("{again} failed runs are made once more"));
    }
    if let Some(plan) = extended {
        extension::extend(dir, &mut campaign, &mut stored, plan)?;
    }
    let (began, version) = (&stored.plan.version, env!("CARGO_PKG_VERSION"));
    if began != version {
        watch.warn(&format!(
            "version {began} of calibrate began this run, this is {version}: finished runs are used as far as this version \
             asks for the same parameter sets"
        ));
    }
    let executor = executor(&stored.executor, options)?;
    Driver { dir, campaign: &campaign, stored: &stored, watch }.drive(executor, options)
}

/// A run goes on with the plan it began with; that the file has changed since is worth saying.
fn about_the_plan_file(dir: &Path, stored: &Stored, watch: &dyn Watch) {
    let Ok(now) = Planned::read_for(&stored.file, stored.plan.proposal.as_ref()) else { return };
    let file = stored.file.display();
    if !same_plan::same(&stored.plan, &now.plan) {
        watch.note(&format!(
            "{file} has changed since the run began; it goes on with the plan it began with"
        ));
    } else if now.executor != stored.executor || same_plan::limits_differ(&stored.plan, &now.plan) {
        watch.note(&format!(
            "[executor] or the limits on runs in {file} have changed; to use them: calibrate --resume {} --plan {file}",
            dir.display()
        ));
    }
}

/// Runs the programs of a plan in its folder.
pub(super) struct Driver<'a> {
    pub(super) dir: &'a Path,
    pub(super) campaign: &'a Campaign,
    pub(super) stored: &'a Stored,
    pub(super) watch: &'a dyn Watch,
}

impl Driver<'_> {
    pub(super) fn drive(
        &self,
        executor: Box<dyn Executor + Send + '_>,
        options: &RunOptions,
    ) -> Result<Finished, Failure> {
        let before = store::began_with(self.campaign);
        let mut guard =
            Guard::new(self.campaign, self.stored.folder(), before, options.accept_changes);
        let runner = Runner {
            campaign: self.campaign,
            executor,
            ahead: None,
            unsure: BTreeSet::new(),
            on_event: Box::new(on_event(&self.stored.plan, self.watch)),
            changed: Box::new(move |unsure| guard.change(unsure)),
            given_up: Counting::new(store::given_up(self.campaign)),
        };
        if self.stored.plan.sampler.overlap == 0 {
            return self.calibrate(runner, options);
        }
        ahead::beside(runner, self.watch.stop(), |runner| self.calibrate(runner, options))
    }

    fn calibrate(&self, runner: Runner<'_>, options: &RunOptions) -> Result<Finished, Failure> {
        let plan = &self.stored.plan;
        let begun = Instant::now();
        self.watch.steps(3);
        self.watch.begin(self.total() as u64, self.ended() as u64, "runs");
        let experiments = Experiments::new(plan, Some(runner), self.watch)?;
        let groups = plan.groups()?;
        let pool = pool(options.threads)?;
        let mut stages = Stages::new(self.watch, Some(self.campaign));
        let sampled = pool.install(|| sample(plan, groups, &experiments, &mut stages));
        self.watch.end();
        let again = self.campaign.placed_again();
        if again > 0 {
            self.watch.note(&format!(
                "{again} runs are placed again: the proposals that had placed them had counted failures that were given up. \
                 What they gave stays in campaign/, unused"
            ));
        }
        let Stages { failed, seconds: stage_seconds, .. } = stages;
        if let Some(error) = failed {
            return Err(refused(self.dir, error));
        }
        if let Some(error) = experiments.take_failure() {
            return Err(self.stopped(error));
        }
        let interrupted = || self.stopped(ExecutorError::Interrupted { detached: false });
        let posterior = match sampled.map_err(|error| self.unfinished(error)) {
            Ok(posterior) if !self.watch.stop().asked() => posterior,
            Ok(_) | Err(Failure::Interrupted) => return Err(interrupted()),
            Err(error) => return Err(error),
        };
        let timings = Timings {
            threads: pool.current_num_threads(),
            inference_seconds: begun.elapsed().as_secs_f64(),
            stage_seconds,
            other_kinetics_seconds: 0.0,
            report_seconds: 0.0,
        };
        pool.install(|| {
            let mut record = record::record(plan, &self.stored.warnings, &posterior)?;
            sensitivity::add(plan, &posterior, &mut record, &experiments, self.watch)?;
            self.publish(record, &posterior, timings, begun)
        })
    }

    /// Writes the results beside the runs.
    fn publish(
        &self,
        record: Record,
        posterior: &Posterior,
        mut timings: Timings,
        begun: Instant,
    ) -> Result<Finished, Failure> {
        self.campaign.check_lock().map_err(|error| refused(self.dir, error))?;
        let staging = Staging::beside_runs(self.dir, FILE_NAME)?;
        let write = |name: &str, bytes: &[u8]| {
            staging.write(self.dir, name, bytes).map_err(|error| {
                error.help(format_args!(
                    "make room on the disk, then: calibrate --resume {}; no run is made again",
                    self.dir.display()
                ))
            })
        };
        report::write_all(&record, posterior, self.stored.inputs.as_ref(), &write, self.watch)?;
        timings.report_seconds = begun.elapsed().as_secs_f64() - timings.inference_seconds;
        write("timings.json", pretty(&timings)?.as_bytes())?;
        if self.watch.stop().asked() {
            return Err(self.paused("every run has ended", false));
        }
        let published = staging.publish_beside_runs()?;
        Ok(Finished { record, out: self.dir.to_owned(), published, timings })
    }

    /// Number of runs that the plan asks for.
    fn total(&self) -> usize {
        self.stored.plan.budget() * self.stored.plan.commands().count()
    }

    /// Number of runs that have ended.
    fn ended(&self) -> usize {
        let tasks = self.campaign.tasks();
        tasks.iter().filter(|task| self.campaign.outcome(task.number).is_some()).count()
    }

    fn paused(&self, what: &str, detached: bool) -> Failure {
        let jobs = if detached { "; jobs on the cluster go on" } else { "" };
        Failure::Paused(format!(
            "interrupted: {what}{jobs}\n  go on with: calibrate --resume {}",
            self.dir.display()
        ))
    }

    /// Why the runs stopped, as the user meets it.
    fn stopped(&self, error: ExecutorError) -> Failure {
        match error {
            ExecutorError::Interrupted { detached } => {
                let (ended, total) = (self.ended(), self.total());
                self.paused(&format!("{ended} of {total} runs have ended and are stored"), detached)
            }
            other => stopped::failure(self.dir, other),
        }
    }

    /// A calibration that cannot give a posterior, although its runs were made.
    fn unfinished(&self, error: smc_calib::CalibrateError) -> Failure {
        let planned = Planned {
            plan: self.stored.plan.clone(),
            executor: self.stored.executor.clone(),
            warnings: Vec::new(),
            path: Some(self.stored.file.clone()),
            text: String::new(),
            inputs: None,
        };
        match failure(&planned, error) {
            Failure::Run(error) => {
                let dir = self.dir.display();
                let said = stopped::last_words(self.campaign);
                let cause = said
                    .map_or_else(|| error.cause.clone(), |said| format!("{}\n{said}", error.cause));
                RunError { cause, ..error }
                    .help(format_args!(
                        "if what failed is mended: calibrate --resume {dir} --retry-failed"
                    ))
                    .help(format_args!("causes and runs as tables: calibrate export {dir}"))
                    .into()
            }
            other => other,
        }
    }
}

/// Progress and notes on an event of a run.
fn on_event<'a>(plan: &'a Plan, watch: &'a dyn Watch) -> impl FnMut(Event) + Send + 'a {
    let place = |number: u64| {
        let (sample, experiment) = sample_of(plan, number);
        let of = match &plan.experiments[..] {
            [_] => String::new(),
            experiments => format!(", {}", experiments[experiment].name),
        };
        format!("run {number} (sample {}{of})", sample + 1)
    };
    let mut noted = BTreeSet::new();
    move |event| match event {
        Event::Ended { failed: None, .. } => watch.advance(),
        Event::Ended { number, failed: Some(kind) } => {
            watch.advance();
            // The first of a kind; all are counted in the report.
            let words = kind.to_string();
            if noted.insert(words.clone()) {
                watch.note(&format!("{}: {words}", place(number)));
            }
        }
        Event::Retried { number, kind } if noted.insert(format!("lost: {kind}")) => {
            watch.note(&format!("{}: {kind}; it is run again", place(number)));
        }
        Event::Note(words) => watch.note(&words),
        _ => {}
    }
}

fn executor(
    plan: &ExecutorPlan,
    options: &RunOptions,
) -> Result<Box<dyn Executor + Send>, Failure> {
    let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    match plan {
        ExecutorPlan::Threads { .. } => Ok(Box::new(Local::new(1))),
        ExecutorPlan::Local { parallel } => {
            Ok(Box::new(Local::new(parallel.unwrap_or_else(cores))))
        }
        ExecutorPlan::Slurm(settings) => {
            let slurm = Slurm::new(settings.clone(), options.worker.clone()).map_err(|error| {
                InputError::new("plan", Mistake::OutOfRange)
                    .in_field(format_args!("executor.{}", error.field))
                    .found(error.found)
                    .expected(error.expected)
            })?;
            Ok(Box::new(slurm))
        }
    }
}
