//! Cost of a run beside the simulator: runs of a command that only leaves one number, started bare, through the
//! campaign's folder, and as a plan through `calibrate`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use campaign::{
    Call, Campaign, CampaignSpec, CommandSpec, Executor, Format, Interpolation, Local, OutputSpec,
    ResultSpec, Stop, Task,
};
use workbench::error::{Failure, RunError};
use workbench::number::significant;

use crate::args::OverheadArgs;
use crate::report::{Report, Table};
use crate::timing::{Clock, Timing};

/// Only builtins of the shell, so that one run is one process.
const SCRIPT: &str = r"printf 't,y\n1,%s\n' $0 > out.csv";
const ROUNDS: usize = 3;

const TEXT: &str = "\
A command that leaves one number (`sh`, builtins only), so many runs, in turn, the median of three rounds. *bare*: the command started by
as many threads. *campaign*: the same through the run folder, with its journal and checksums, by the local executor. *plan*: the same as a
plan through `calibrate` beside this program, with sampler and report.
";

pub(crate) fn run(args: &OverheadArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "overhead")?;
    let folder = tempfile::tempdir().map_err(RunError::new)?;
    let mut walls_s: [Vec<f64>; 3] = Default::default();
    for round in 1..=ROUNDS {
        let dir = folder.path().join(round.to_string());
        fs::create_dir(&dir).map_err(RunError::new)?;
        walls_s[0].push(bare(args, &dir)?);
        walls_s[1].push(campaign(args, &dir.join("campaign"))?);
        walls_s[2].extend(plan(args, &dir)?);
    }
    let mut table = Table::new(&["way", "wall time per run [ms]", "beside the bare command [ms]"]);
    let per_run_ms =
        |walls_s: &[f64]| 1e3 * Timing::of(walls_s.to_vec()).median_s / args.runs as f64;
    let bare_ms = per_run_ms(&walls_s[0]);
    for (way, walls_s) in ["bare", "campaign", "plan"].into_iter().zip(&walls_s) {
        let cells = if walls_s.is_empty() {
            ["calibrate is not built".to_owned(), "–".to_owned()]
        } else {
            let ms = per_run_ms(walls_s);
            [significant(ms, 3), significant(ms - bare_ms, 3)]
        };
        table.push([vec![way.to_owned()], cells.into()].concat());
    }
    report.table(&table)?;
    let text =
        format!("{TEXT}\n{} runs, {} at a time.\n\n{}", args.runs, args.parallel, table.markdown());
    Ok(report.page("What a run costs beside the simulator", &text)?)
}

/// The command started as simply as possible on as many threads; wall time \[s\].
fn bare(args: &OverheadArgs, dir: &Path) -> Result<f64, RunError> {
    let next = AtomicUsize::new(0);
    let start = || -> std::io::Result<()> {
        while next.fetch_add(1, Ordering::Relaxed) < args.runs {
            let mut command = Command::new("sh");
            command.args(["-c", SCRIPT, "0.5"]).current_dir(dir);
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status()?;
        }
        Ok(())
    };
    let (wall_s, ran) = Clock::Wall.measure(|| {
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..args.parallel).map(|_| scope.spawn(start)).collect();
            threads.into_iter().try_for_each(|thread| thread.join().unwrap_or(Ok(())))
        })
    });
    ran.map_err(RunError::new)?;
    Ok(wall_s)
}

/// The same through a campaign's folder; wall time \[s\].
fn campaign(args: &OverheadArgs, dir: &Path) -> Result<f64, RunError> {
    let spec = spec();
    let campaign = Campaign::create(dir, &spec, &BTreeMap::new()).map_err(RunError::new)?;
    let tasks: Vec<Task> = (0..args.runs as u64)
        .map(|number| Task { number, command: 0, parameters: vec![0.1 * number as f64] })
        .collect();
    let mut local = Local::new(args.parallel);
    let (wall_s, ran) =
        Clock::Wall.measure(|| local.run(&campaign, &tasks, &mut |_| (), &Stop::new()));
    ran.map_err(RunError::new)?;
    for task in &tasks {
        let outcome = campaign.outcome(task.number);
        if outcome.as_ref().and_then(|outcome| outcome.values()) != Some(&task.parameters) {
            return Err(RunError::new(format_args!("run {}: {outcome:?}", task.number)));
        }
    }
    Ok(wall_s)
}

fn spec() -> CampaignSpec {
    let argv = ["sh", "-c", SCRIPT, "{a}"].map(str::to_owned).to_vec();
    let call = Call { timeout_s: 60.0, retries: 0, ..Call::new(argv) };
    let result = ResultSpec {
        file: "out.csv".into(),
        format: Format::Csv,
        control: None,
        value: "y".into(),
        interpolate: Interpolation::Refuse,
    };
    let outputs = vec![OutputSpec { result, at: vec![0.0] }];
    let command = CommandSpec { name: "nothing".into(), call, outputs };
    CampaignSpec { parameter_names: vec!["a".into()], commands: vec![command], seed: 1 }
}

/// The same as a plan, by the `calibrate` beside this program; wall time \[s\], none where it is not built.
fn plan(args: &OverheadArgs, dir: &Path) -> Result<Option<f64>, RunError> {
    let program = std::env::current_exe().map_err(RunError::new)?.with_file_name("calibrate");
    if !program.exists() {
        return Ok(None);
    }
    let OverheadArgs { runs, parallel } = args;
    let script = SCRIPT.replace('\\', r"\\");
    let plan = format!(
        r#"name = "nothing"
[parameters.a]
distribution = "uniform"
lower = 0.0
upper = 5.0
[experiments.pull.simulator]
kind = "command"
argv = ["sh", "-c", "{script}", "{{a}}"]
timeout_s = 60
keep = "none"
[experiments.pull.observables.y]
table = "line.csv"
control = "t"
noise = {{ kind = "inferred", s0 = 0.2 }}
result = {{ file = "out.csv", control = "t", value = "y" }}
[sampler]
samples = {runs}
[executor]
kind = "local"
parallel = {parallel}
"#
    );
    fs::write(dir.join("line.csv"), "t,y\n1,2.1\n").map_err(RunError::new)?;
    fs::write(dir.join("plan.toml"), plan).map_err(RunError::new)?;
    let mut command = Command::new(program);
    command.args(["--plan", "plan.toml", "--out", "run", "--quiet"]).current_dir(dir);
    let (wall_s, output) = Clock::Wall.measure(|| command.output());
    let output = output.map_err(RunError::new)?;
    if !output.status.success() {
        return Err(RunError::new(String::from_utf8_lossy(&output.stderr)));
    }
    Ok(Some(wall_s))
}
