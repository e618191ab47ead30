//! How the cost of a calibration grows with samples, observations, dimensions and threads, and what memory a
//! million samples take.

use std::time::Instant;

use smc_calib::{Observations, Problem, Settings, calibrate, reference, sample_density};

use super::report::{self, Header, Table};
use crate::args::{GrowthBenchArgs, RunArgs};
use crate::error::{Failure, RunError};
use crate::material::Material;
use crate::model::NeckGrowth;
use crate::number::significant;
use crate::output;
use crate::plan::{Plan, Planned};

/// Each time is the median of so many runs, as long as one takes less than [`SLOW_S`].
const REPEATS: usize = 5;
const SLOW_S: f64 = 2.0;

/// Simulations where something else than their number grows.
const SIMULATIONS: usize = 16_384;

/// What one run says of itself.
struct Outcome {
    ess: f64,
    khat: f64,
    counters: smc_calib::Counters,
}

pub(super) fn run(args: &GrowthBenchArgs) -> Result<(), Failure> {
    report::folder(&args.out)?;
    let header = Header::now("cargo run --release -- bench growth");
    let plan = plan()?;
    let model = NeckGrowth::of(&plan)?;
    let mut table = Table::new(&[
        "what grows",
        "size",
        "threads",
        "seconds",
        "per simulation",
        "ESS",
        "k-hat",
        "mixture densities per simulation",
        "largest error of a mean (posterior sd)",
        "error of ln Z",
    ]);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let measured = plan.observations()?;

    // The million first: the memory of a process is known by its highest mark alone.
    let samples = [1_000_000, 262_144, 65_536, 16_384, 4_096, 1_000];
    let mut memory = None;
    let mut rows = Vec::new();
    for n in samples {
        let timed = median(cores, || calibrated(&model, &plan, &measured, n))?;
        if n == samples[0] {
            memory = peak_memory_mib();
        }
        rows.push(row("samples", n, cores, n, &timed, None));
    }
    for row in rows.into_iter().rev() {
        table.push(row);
    }
    for m in [10, 100, 1_000, 10_000] {
        let times_s: Vec<f64> = (1..=m).map(|k| 0.11 * k as f64 / m as f64).collect();
        let model = model.at_times(times_s.clone());
        let mut curve = vec![0.0; m];
        let sintering = Material::Ps.table3_sintering();
        model.curve(&sintering, &mut curve).map_err(RunError::new)?;
        // Scatter without random numbers: the golden ratio fills the unit interval evenly.
        for (k, value) in curve.iter_mut().enumerate() {
            let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
            *value += 0.02 * smc_calib::normal::quantile(u);
        }
        let observations = Observations::new(times_s, curve).map_err(RunError::new)?;
        let timed = median(cores, || calibrated(&model, &plan, &observations, SIMULATIONS))?;
        table.push(row("observations", m, cores, SIMULATIONS, &timed, None));
    }
    for d in 1..=10 {
        let reference = reference::gaussian(d, 0.5, 0.1);
        let settings = Settings { samples: SIMULATIONS, ..Settings::default() };
        let mut errors = (0.0, 0.0);
        let timed = median(cores, || {
            let found = sample_density(&reference, &settings).map_err(RunError::new)?;
            let off = |j: usize| (found.mean[j] - reference.mean[j]).abs() / reference.sd[j];
            errors.0 = (0..d).map(off).fold(0.0, f64::max);
            errors.1 = (found.log_evidence.value - reference.log_evidence).abs();
            Ok(Outcome { ess: found.ess, khat: found.khat, counters: found.counters })
        })?;
        table.push(row("dimensions", d, cores, SIMULATIONS, &timed, Some(errors)));
    }
    for threads in [1, 2] {
        let timed = median(threads, || calibrated(&model, &plan, &measured, SIMULATIONS))?;
        table.push(row("threads", threads, threads, SIMULATIONS, &timed, None));
    }
    output::write_file(&args.out.join("growth.csv"), table.csv(&header).as_bytes())?;
    let memory = memory.map_or_else(
        || "not measured here (it is read from /proc)".to_owned(),
        |mib| format!("{} MiB at most, of the whole process", significant(mib, 3)),
    );
    let text = format!(
        "# How the cost of a calibration grows\n\n{}\nMedian wall time of {REPEATS} runs (of one, where it takes more than {SLOW_S} s), \
         sampler and summary without files and figures. Samples, observations and threads: polystyrene, closed form; \
         the observations are the paper's curve with a scatter of 0.02. Dimensions: the conjugate Gaussian \
         reference, every coordinate measured with a tenth of its prior's standard deviation, against its exact answer. \
         Where not said otherwise {SIMULATIONS} simulations.\n\n{}\nMemory of a calibration of {} samples: {memory}.\n",
        header.lines("- "),
        table.markdown(),
        samples[0],
    );
    output::write_file(&args.out.join("growth.md"), text.as_bytes())?;
    Ok(())
}

fn plan() -> Result<Plan, Failure> {
    let args = RunArgs { material: Some(Material::Ps), ..RunArgs::default() };
    Ok(Planned::from_args(&args)?.plan)
}

fn calibrated(
    model: &NeckGrowth,
    plan: &Plan,
    observations: &Observations,
    samples: usize,
) -> Result<Outcome, RunError> {
    let problem = Problem {
        simulator: model,
        parameters: plan.parameters.clone(),
        observations: observations.clone(),
        noise: plan.noise.clone(),
    };
    let settings = Settings { samples, ..plan.sampler.clone() };
    let posterior = calibrate(&problem, &settings, &mut ()).map_err(RunError::new)?;
    Ok(Outcome {
        ess: posterior.ess.importance,
        khat: posterior.khat,
        counters: posterior.counters,
    })
}

/// Median wall time \[s\] on a number of threads, and the outcome of the last run.
fn median(
    threads: usize,
    mut job: impl FnMut() -> Result<Outcome, RunError> + Send,
) -> Result<(f64, Outcome), RunError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| RunError::new(format_args!("{threads} threads: {error}")))?;
    pool.install(|| {
        let mut times_s = Vec::new();
        loop {
            let start = Instant::now();
            let outcome = job()?;
            times_s.push(start.elapsed().as_secs_f64());
            if times_s.len() == REPEATS || times_s[0] > SLOW_S {
                times_s.sort_by(f64::total_cmp);
                return Ok((times_s[times_s.len() / 2], outcome));
            }
        }
    })
}

fn row(
    what: &str,
    size: usize,
    threads: usize,
    simulations: usize,
    (time_s, outcome): &(f64, Outcome),
    errors: Option<(f64, f64)>,
) -> Vec<String> {
    let densities = outcome.counters.component_densities as f64 / simulations as f64;
    let error = |error: Option<f64>| error.map_or_else(|| "–".to_owned(), |e| significant(e, 2));
    vec![
        what.to_owned(),
        size.to_string(),
        threads.to_string(),
        significant(*time_s, 3),
        report::seconds(time_s / simulations as f64),
        significant(outcome.ess, 4),
        significant(outcome.khat, 2),
        significant(densities, 3),
        error(errors.map(|errors| errors.0)),
        error(errors.map(|errors| errors.1)),
    ]
}

/// Highest memory of this process so far \[MiB\].
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}
