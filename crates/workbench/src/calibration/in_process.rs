//! A calibration that is computed in this process: of built-in simulators, or of a function of the calling program.

use std::time::Instant;

use smc_calib::Simulator;

use super::function::Called;
use super::options::{Finished, RunOptions, Timings, folder_of};
use super::sampling::{Calibration, Stages};
use super::{extension, other_kinetics, sensitivity};
use crate::error::Failure;
use crate::output::{RunFolder, make_room, pool, pretty};
use crate::plan::{ExecutorPlan, Planned};
use crate::record::FILE_NAME;
use crate::report;
use crate::simulator::Experiments;
use crate::watch::{Unwatched, Watch};

/// Runs a plan without programs and writes its results; `function` simulates what the plan leaves to one.
pub(super) fn run(
    planned: &Planned,
    function: Option<&dyn Simulator>,
    options: &RunOptions,
    watch: &dyn Watch,
) -> Result<Finished, Failure> {
    let out = folder_of(&planned.plan, options);
    let called = function.map(|function| Called::new(planned, function, watch)).transpose()?;
    let folder = RunFolder::prepare(&out, FILE_NAME)?;
    let threads = match planned.executor {
        ExecutorPlan::Threads { threads } => options.threads.or(threads),
        _ => options.threads,
    };
    let pool = pool(threads)?;
    let begun = Instant::now();
    let mut stages = Stages::new(watch, None);
    watch.steps(if options.without_other_kinetics { 4 } else { 5 });
    let Calibration { mut record, posterior } =
        pool.install(|| calibrated(planned, called.as_ref(), &mut stages, watch))?;
    if let Some(earlier) = &options.extends {
        extension::compare(earlier, &posterior, watch);
    }
    let mut timings = Timings {
        threads: pool.current_num_threads(),
        inference_seconds: begun.elapsed().as_secs_f64(),
        stage_seconds: stages.seconds,
        other_kinetics_seconds: 0.0,
        report_seconds: 0.0,
    };
    if !options.without_other_kinetics {
        pool.install(|| other_kinetics::add(&planned.plan, &posterior, &mut record, watch))?;
        timings.other_kinetics_seconds = begun.elapsed().as_secs_f64() - timings.inference_seconds;
    }
    let reporting = Instant::now();
    let staging = folder.stage()?;
    pool.install(|| {
        let write = |name: &str, bytes: &[u8]| staging.write(&out, name, bytes).map_err(make_room);
        if let Some(called) = &called {
            called.write(&posterior, &write)?;
        }
        report::write_all(&record, &posterior, planned.inputs.as_ref(), &write, watch)
    })?;
    timings.report_seconds = reporting.elapsed().as_secs_f64();
    staging.write(&out, "timings.json", pretty(&timings)?.as_bytes()).map_err(make_room)?;
    if watch.stop().asked() {
        return Err(Failure::Interrupted);
    }
    let published = staging.publish()?;
    Ok(Finished { record, out, published, timings })
}

/// The posterior, with the result under correlated errors where there is a reason for one.
fn calibrated(
    planned: &Planned,
    called: Option<&Called<'_>>,
    stages: &mut Stages<'_>,
    watch: &dyn Watch,
) -> Result<Calibration, Failure> {
    let unwatched = Unwatched::default();
    let (mut found, experiments);
    let again: &dyn Simulator = match called {
        Some(called) => {
            found = Calibration::by(planned, called, stages)?;
            called
        }
        None => {
            found = Calibration::in_process(planned, stages)?;
            experiments = Experiments::new(&planned.plan, None, &unwatched)?;
            &experiments
        }
    };
    let Calibration { record, posterior } = &mut found;
    watch.begin(0, 0, "with correlated errors");
    sensitivity::add(&planned.plan, posterior, record, again, watch)?;
    Ok(found)
}
