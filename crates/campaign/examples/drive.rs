//! A driver in fifty lines: the same runs by processes of this machine or by Slurm, taken up again when it is started again.
//!
//! ```sh
//! drive DIR local|slurm RUNS PROGRAM      # writes DIR/table.txt; goes on where DIR is there already
//! drive run-task DIR --tasks 1-3,7        # what an array element of Slurm calls
//! ```
//!
//! `PROGRAM {x} {run}` shall write `out.csv` with the columns t and y. Ctrl-C cancels the runs; with the
//! variable DETACH set it leaves those on the cluster alone. SLURM_SETTINGS holds settings as JSON,
//! RUN_TIMEOUT_S the time limit of a run.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use campaign::slurm::{Slurm, SlurmSettings};
use campaign::{
    Call, Campaign, CampaignSpec, CommandSpec, Executor, ExecutorError, Format, Interpolation,
    Local, Outcome, OutputSpec, ResultSpec, Stop, Task, Worker, numbers,
};

fn main() -> ExitCode {
    let stop = Stop::new();
    let flag = stop.clone();
    let detach = std::env::var_os("DETACH").is_some();
    if let Err(error) =
        ctrlc::set_handler(move || if detach { flag.detach() } else { flag.cancel() })
    {
        return failed(&error);
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words.as_slice() {
        ["run-task", dir, "--tasks", tasks] => run_tasks(Path::new(dir), tasks, &stop),
        [dir, executor, runs, program] => drive(Path::new(dir), executor, runs, program, &stop),
        _ => Err("drive DIR local|slurm RUNS PROGRAM".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failed(error.as_ref()),
    }
}

fn failed(error: &(dyn Error + 'static)) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "{error}");
    let interrupted = matches!(error.downcast_ref(), Some(ExecutorError::Interrupted { .. }));
    ExitCode::from(if interrupted { 130 } else { 1 })
}

fn run_tasks(dir: &Path, tasks: &str, stop: &Stop) -> Result<(), Box<dyn Error>> {
    let worker = Worker::open(dir)?;
    for number in numbers::parse(tasks)? {
        worker.run(number, stop)?;
    }
    Ok(())
}

fn drive(
    dir: &Path,
    executor: &str,
    runs: &str,
    program: &str,
    stop: &Stop,
) -> Result<(), Box<dyn Error>> {
    let result = ResultSpec {
        file: "out.csv".into(),
        format: Format::Csv,
        control: Some("t".into()),
        value: "y".into(),
        interpolate: Interpolation::Linear,
    };
    let output = OutputSpec { result, at: vec![0.0, 0.25, 1.0] };
    let timeout_s = std::env::var("RUN_TIMEOUT_S").map_or(Ok(60.0), |text| text.parse())?;
    let call = Call { timeout_s, ..Call::new(vec![program.into(), "{x}".into(), "{run}".into()]) };
    let spec = CampaignSpec {
        parameter_names: vec!["x".into()],
        commands: vec![CommandSpec { name: "example".into(), call, outputs: vec![output] }],
        seed: 1,
    };
    let campaign = if dir.exists() {
        Campaign::open(dir)?.0
    } else {
        Campaign::create(dir, &spec, &BTreeMap::new())?
    };
    let tasks: Vec<Task> = (1..=runs.parse()?)
        .map(|number| Task { number, command: 0, parameters: vec![0.1 * number as f64] })
        .collect();
    let mut executor: Box<dyn Executor> = match executor {
        "local" => Box::new(Local::new(8)),
        _ => {
            let settings = std::env::var("SLURM_SETTINGS").unwrap_or_else(|_| "{}".into());
            let settings: SlurmSettings = serde_json::from_str(&settings)?;
            let this = std::env::current_exe()?.display().to_string();
            Box::new(Slurm::new(settings, vec![this, "run-task".into()])?)
        }
    };
    let mut watch = |event| {
        let _ = writeln!(std::io::stderr(), "{event:?}");
    };
    executor.run(&campaign, &tasks, &mut watch, stop)?;
    let mut table = String::new();
    for task in &tasks {
        let line = match campaign.outcome(task.number) {
            Some(Outcome::Finished { values, .. }) => format!("{values:?}"),
            Some(Outcome::Failed { kind, .. }) => kind.to_string(),
            None => "no outcome".into(),
        };
        table += &format!("{} {line}\n", task.number);
    }
    fs::write(dir.join("table.txt"), table)?;
    Ok(())
}
