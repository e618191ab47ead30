//! The main job: calibrate, write the run's folder, say what was found.

use std::path::{Path, PathBuf};

use dem_core::Kinetics;
use smc_calib::Noise;
use workbench::calibration::{self, Finished, RunOptions};
use workbench::error::{Failure, InputError, Mistake, RunError};
use workbench::input::material::Material;
use workbench::output::{pool, pretty};
use workbench::plan::{self, PairOptions, Planned};
use workbench::watch::Watch as _;
use workbench::{report, verify};

use crate::arguments::{self, SolverChoice};
use crate::columns::ColumnArgs;
use crate::terminal::{self, OnInterrupt, Terminal};

/// The main job: calibrate one material.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub(crate) struct CalibrateArgs {
    /// Built-in material: its powder, measurements and priors
    #[arg(short, long, value_name = "NAME", value_parser = arguments::material(), help_heading = "What to calibrate")]
    material: Option<Material>,

    /// Own measurements: a description (.toml), a bare table (.csv; needs --material), or the name of
    /// a built-in experiment [default: the material's]. Given several times: experiments of one powder, calibrated together with
    /// all parameters shared, tau_s in proportion to R
    #[arg(short, long, value_name = "FILE", help_heading = "What to calibrate")]
    experiment: Vec<PathBuf>,

    /// Own priors (.toml) [default: the material's]
    #[arg(short, long, value_name = "FILE", help_heading = "What to calibrate")]
    prior: Option<PathBuf>,

    /// Calibrate any simulator, as a plan file (.toml or .json) says: parameters, experiments, commands,
    /// executor; see crates/guide/pages/plan-files.md
    #[arg(long, value_name = "FILE", conflicts_with_all = NOT_WITH_A_RUN, conflicts_with_all = ColumnArgs::NAMES, conflicts_with_all = ["samples", "verify"], help_heading = "What to calibrate")]
    plan: Option<PathBuf>,

    /// Go on with the runs of a plan's programs after an interruption, from their folder; nothing that finished is run
    /// again. With --samples the run is extended to so many: all it has made count. Plans with built-in simulators alone are
    /// computed in one go, and begun anew or extended by --continue-from
    #[arg(long, value_name = "DIR", conflicts_with_all = NOT_WITH_A_RUN, conflicts_with_all = ColumnArgs::NAMES, conflicts_with_all = ["verify", "out", "dry_run"], help_heading = "What to calibrate")]
    resume: Option<PathBuf>,

    /// Extend a run of the built-in simulators (its folder, or its posterior.json) to --samples: with its data, priors, seed
    /// and settings, and all its simulations, which are computed again to the same bits (in milliseconds, by the closed
    /// form). Written to its folder, the former result moved aside, or to --out
    #[arg(long, value_name = "DIR", requires = "samples", conflicts_with_all = NOT_WITH_A_RUN, conflicts_with_all = ColumnArgs::NAMES, conflicts_with_all = ["plan", "resume", "toml"], help_heading = "What to calibrate")]
    continue_from: Option<PathBuf>,

    /// With --resume: make failed runs once more, after what made them fail was mended; all of them, or those whose
    /// cause (as in calibrate status: "exit code 3", "timeout") or last words on stderr contain these words
    #[arg(long, value_name = "CAUSE", requires = "resume", num_args = 0..=1, require_equals = true, default_missing_value = "", help_heading = "What to calibrate")]
    retry_failed: Option<String>,

    /// With --retry-failed: keep the runs that were placed while those had counted as failed, and use all of them. Without it
    /// they are placed again, and the result is that of a run in which nothing had failed, to the bit
    #[arg(long, requires = "retry_failed", help_heading = "What to calibrate")]
    keep_placed: bool,

    /// With --resume: go on although a program, or a file beside the plan that its command names, has changed since the
    /// run began
    #[arg(long, requires = "resume", help_heading = "What to calibrate")]
    accept_changes: bool,

    /// With --resume: go on with a run of another user, whose commands are then run as you
    #[arg(long, requires = "resume", help_heading = "What to calibrate")]
    accept_owner: bool,

    /// Fit only the observations from T0 to T1, in seconds; either may be left out, as in 0.5:
    /// [default: all]
    #[arg(long, value_name = "T0:T1", value_parser = arguments::window, allow_hyphen_values = true, help_heading = "What to calibrate")]
    window: Option<[f64; 2]>,

    /// Columns of a table.
    #[command(flatten)]
    columns: ColumnArgs,

    /// How the neck grows
    #[arg(long, value_name = "NAME", default_value = "three-stage", value_parser = arguments::kinetics(), help_heading = "Model")]
    kinetics: Kinetics,

    /// How the curve is computed; auto takes the cheapest solver within --tolerance
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = arguments::solver(), help_heading = "Model")]
    solver: SolverChoice,

    /// Largest error of a/R allowed to the solver, from 1e-12 to 0.1
    #[arg(long, value_name = "A/R", default_value = "1e-4", value_parser = arguments::tolerance, allow_negative_numbers = true, help_heading = "Model")]
    tolerance: f64,

    /// How measurements scatter: inferred (independent), correlated (alike near each other; correlated:log
    /// and correlated:linear say what distances are measured in), robust (with outliers), fixed:SIGMA,
    /// fixed:table (the column sigma), fixed-relative:SHARE of the value, ess-target:SHARE (GrainLearning's
    /// tuning; the result is not a posterior). inferred, correlated and robust stand for inferred:4,0.05 and
    /// so on: NU0,S0 of the prior of sigma, both
    /// above 0; SIGMA is above 0, SHARE above 0 and below 1
    #[arg(long, value_name = "MODEL", default_value = "inferred", value_parser = arguments::noise, help_heading = "Model")]
    noise: Noise,

    /// Do not look at what other kinetics are worth by evidence. They are looked at for pairs with the closed-form
    /// solver, up to 500 observations and from 4096 simulations, and add about half to the time
    #[arg(long, help_heading = "Model")]
    no_other_kinetics: bool,

    /// Simulations in total, from 16 to 100000000; with --resume and --continue-from those of the extended run [default: 16384]
    #[arg(short = 'n', long, value_name = "N", value_parser = arguments::samples, allow_negative_numbers = true, help_heading = "Sampling")]
    samples: Option<usize>,

    /// Adaptive stages, from 1 to 1000, over which the proposal is refined, without a Gaussian process [default: 8; all of fewer
    /// than 2048 simulations and the first 400 of fewer than 8192 in 12 to 38 after a first, placed by a Gaussian process]
    #[arg(long, value_name = "N", value_parser = arguments::iterations, allow_negative_numbers = true, help_heading = "Sampling")]
    iterations: Option<usize>,

    /// Draw the first simulations from an earlier posterior (its folder, or its posterior.json), of a cheaper model or a coarser
    /// mesh, widened, beside a quarter from the prior. It says where to begin: the answer stays that of this model and its own
    /// prior. Parameters are matched by name
    #[arg(long, value_name = "DIR", help_heading = "Sampling")]
    proposal: Option<PathBuf>,

    /// Stop refining early once the effective sample size reaches N, at least 1 [default: use all samples]
    #[arg(long, value_name = "N", value_parser = arguments::effective_samples, allow_negative_numbers = true, help_heading = "Sampling")]
    ess: Option<f64>,

    /// Seed of the random numbers, from 0 to 18446744073709551615; the same seed gives the same bits, for any number of threads
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true, help_heading = "Sampling")]
    seed: u64,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true, help_heading = "Sampling")]
    threads: Option<usize>,

    /// Folder for the results [default: results/NAME of the material or experiment]
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,

    /// What Ctrl-C does to jobs on a cluster: detach leaves them running for --resume, cancel ends them.
    /// Runs on this machine are ended in any case
    #[arg(long, value_name = "WHAT", default_value = "detach", value_parser = arguments::on_interrupt(), help_heading = "Output")]
    on_interrupt: OnInterrupt,

    /// Print the plan and stop: what would be read, run and written
    #[arg(long, help_heading = "Output")]
    dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long, help_heading = "Output")]
    quiet: bool,

    /// Print the summary (or with --dry-run the plan) as JSON
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// With --dry-run: print the plan file that does the same, for --plan
    #[arg(long, requires = "dry_run", conflicts_with = "json", conflicts_with_all = ColumnArgs::NAMES, help_heading = "Output")]
    toml: bool,

    /// Hold the posterior against quadrature afterwards, and fail where they differ
    #[arg(long, help_heading = "Output")]
    verify: bool,
}

/// Options that a plan file, or a run that is there, says itself.
const NOT_WITH_A_RUN: [&str; 12] = [
    "material",
    "experiment",
    "prior",
    "window",
    "kinetics",
    "solver",
    "tolerance",
    "noise",
    "iterations",
    "ess",
    "seed",
    "proposal",
];

impl CalibrateArgs {
    /// Whether nothing was asked for.
    pub(crate) fn is_empty(&self) -> bool {
        self.material.is_none()
            && self.experiment.is_empty()
            && self.plan.is_none()
            && self.resume.is_none()
            && self.continue_from.is_none()
    }

    /// Options of a calibration on one pair of particles, or several of one powder.
    pub(crate) fn pair(&self) -> PairOptions {
        PairOptions {
            material: self.material,
            experiment: self.experiment.first().cloned(),
            others: self.experiment.iter().skip(1).cloned().collect(),
            columns: self.columns.columns(),
            prior: self.prior.clone(),
            window_s: self.window,
            kinetics: self.kinetics,
            solver: self.solver,
            tolerance: self.tolerance,
            noise: self.noise.clone(),
            samples: self.samples.unwrap_or(PairOptions::default().samples),
            iterations: self.iterations,
            ess: self.ess,
            seed: self.seed,
            proposal: self.proposal.clone(),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &CalibrateArgs) -> Result<(), Failure> {
    let several = args.experiment.len();
    if args.verify && several > 1 {
        return Err(InputError::new("--verify", Mistake::Conflict)
            .found(format_args!("{several} experiments"))
            .expected("one, over whose parameters quadrature goes")
            .into());
    }
    let (mut out, mut extends) = (args.out.clone(), None);
    let planned = match (&args.plan, &args.resume, &args.continue_from, args.samples) {
        (_, _, Some(from), Some(samples)) => {
            let (planned, folder) = calibration::continued(from, samples)?;
            extends = Some(folder.clone());
            out.get_or_insert(folder);
            Some(planned)
        }
        (Some(file), Some(dir), ..) => Some(calibration::plan_of_run(file, dir)?),
        (Some(file), ..) => Some(Planned::read(file)?),
        (None, None, ..) => Some(args.pair().plan()?),
        (None, Some(_), ..) => None,
    };
    let options = RunOptions {
        out,
        extends,
        samples: args.samples,
        threads: args.threads,
        worker: vec![program()?, "run-task".to_owned()],
        accept_owner: args.accept_owner,
        accept_changes: args.accept_changes,
        retry_failed: args.retry_failed.clone(),
        keep_placed: args.keep_placed,
        without_other_kinetics: args.no_other_kinetics,
    };
    let finished = match (&args.resume, &planned) {
        (Some(dir), given) => {
            let terminal = Terminal::new(args.quiet, args.on_interrupt);
            let finished = calibration::resume(dir, given.as_ref(), &options, &terminal)?;
            say(args, &terminal, finished)?
        }
        (None, Some(planned)) => {
            let out = options.folder(planned)?;
            if args.dry_run {
                return dry_run(args, planned, &out);
            }
            let terminal = Terminal::new(args.quiet, args.on_interrupt);
            for (_, observable) in planned.plan.observables() {
                if let Some(how) = &observable.table_read {
                    terminal.note(&format!("{}: read {how}", observable.table));
                }
            }
            let finished = calibration::run(planned, &options, &terminal)?;
            say(args, &terminal, finished)?
        }
        (None, None) => return Ok(()),
    };
    if args.verify {
        let integrate = || verify::verify(&finished.record);
        let checked = terminal::working(args.quiet, "quadrature of the posterior", || {
            pool(args.threads)?.install(integrate)
        })?;
        if !args.quiet {
            eprint!("{}", checked.text());
        }
        checked.passed(&finished.out)?;
    }
    Ok(())
}

/// This program, by which jobs on a cluster call it.
fn program() -> Result<String, RunError> {
    std::env::current_exe().map(|path| path.display().to_string()).map_err(|error| {
        RunError::new(format_args!("the path of this program is not known: {error}"))
    })
}

fn dry_run(args: &CalibrateArgs, planned: &Planned, out: &Path) -> Result<(), Failure> {
    match (args.json, args.toml) {
        (true, _) => terminal::write(pretty(&planned.plan)?.as_bytes())?,
        (_, true) => terminal::write(planned.toml()?.as_bytes())?,
        _ => terminal::report(&plan::dry_run(planned, out))?,
    }
    for warning in &planned.warnings {
        terminal::warning(warning);
    }
    Ok(())
}

fn say(args: &CalibrateArgs, terminal: &Terminal, finished: Finished) -> Result<Finished, Failure> {
    let Finished { record, out, published, timings } = &finished;
    terminal.announce(published, out);
    let advice: Vec<String> =
        record.advice.iter().map(|line| report::in_folder(line, out)).collect();
    terminal.advise(&advice);
    let text = || report::text(record, Some(timings.inference_seconds), Some(out));
    terminal.print_result(args.json, || report::json(record, Some(out)), text)?;
    Ok(finished)
}
