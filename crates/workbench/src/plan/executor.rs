//! The executor of a plan file.

use campaign::slurm::SlurmSettings;

use super::types::{ExecutorPlan, ExperimentPlan, SimulatorPlan};
use crate::error::{InputError, Mistake};
use crate::input::toml_fields::Fields;

/// Reads `[executor]`; by default threads for built-in simulators alone, and local processes for commands.
pub(super) fn executor(
    fields: Option<&Fields<'_>>,
    experiments: &[ExperimentPlan],
) -> Result<ExecutorPlan, InputError> {
    let commands = experiments.iter().any(|e| matches!(e.simulator, SimulatorPlan::Command(_)));
    let Some(fields) = fields else {
        return Ok(if commands {
            ExecutorPlan::Local { parallel: None }
        } else {
            ExecutorPlan::Threads { threads: None }
        });
    };
    let kinds = ["threads", "local", "slurm"];
    let kind = fields
        .choice("kind", &kinds.map(|kind| (kind, kind)))?
        .ok_or_else(|| fields.missing("kind").expected("\"threads\", \"local\" or \"slurm\""))?;
    if commands == (kind.value == "threads") {
        let (found, expected) = if commands {
            ("threads, which run built-in simulators alone", "\"local\" or \"slurm\"")
        } else {
            ("an executor of commands, and the plan has none", "\"threads\"")
        };
        return Err(fields
            .error("kind", kind.line, Mistake::Conflict)
            .found(found)
            .expected(expected)
            .help("leave [executor] out for the default"));
    }
    let stays =
        |e: &&ExperimentPlan| matches!(&e.simulator, SimulatorPlan::Command(call) if call.worker);
    if let ("slurm", Some(worker)) = (kind.value, experiments.iter().find(stays)) {
        return Err(fields
            .error("kind", kind.line, Mistake::Conflict)
            .found(format_args!("Slurm, which keeps no workers, and {} has one", worker.name))
            .expected("\"local\"")
            .help(format_args!(
                "or kind = \"command\" in [experiments.{}.simulator]: a program that is started for each run",
                worker.name
            )));
    }
    let few = |key, most| {
        Ok::<_, InputError>(fields.whole(key, 1, most)?.map(|number| number.value as usize))
    };
    let read = match kind.value {
        "threads" => ExecutorPlan::Threads { threads: few("threads", 1024)? },
        "local" => ExecutorPlan::Local { parallel: few("parallel", 1 << 16)? },
        _ => return slurm(fields),
    };
    fields.finish()?;
    Ok(read)
}

fn slurm(fields: &Fields<'_>) -> Result<ExecutorPlan, InputError> {
    let settings: SlurmSettings = fields.rest(&["kind"])?;
    settings.check().map_err(|error| {
        let line = fields.line_of(error.field).or(fields.line()).unwrap_or(1);
        fields
            .error(error.field, line, Mistake::OutOfRange)
            .found(error.found)
            .expected(error.expected)
    })?;
    Ok(ExecutorPlan::Slurm(settings))
}
