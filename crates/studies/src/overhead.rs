//! Cost of a run beside the simulator: runs of a command that only leaves one number, started bare, through the
//! campaign's folder, and as a plan through `calibrate`; and of a worker that answers with it, alone and through the folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use campaign::{
    ANSWER, Call, Campaign, CampaignSpec, CommandSpec, Executor, Format, Interpolation, Local,
    OutputSpec, ResultSpec, Stop, Task, ask_worker,
};
use workbench::error::{Failure, RunError};
use workbench::number::significant;

use crate::args::OverheadArgs;
use crate::report::{Report, Table};
use crate::timing::{Clock, Timing};

/// Only builtins of the shell, so that one run is one process.
const SCRIPT: &str = r"printf 't,y\n1,%s\n' $0 > out.csv";
/// The same as a worker.
const WORKER: &str = r#"
import json, sys
for line in sys.stdin:
    request = json.loads(line)
    answer = {{"protocol": 1}}
    if "id" in request:
        answer = {{"id": request["id"], "values": {{"y": [request["parameters"]["a"]]}}}}
    print(json.dumps(answer), flush=True)
"#;
const ROUNDS: usize = 3;
/// Exchanges with a worker for each run: they are short beside the scatter of its start.
const EXCHANGES: usize = 50;

const TEXT: &str = "\
A command that leaves one number (`sh`, builtins only), so many runs, in turn, the median of three rounds. *bare*: the command started by
as many threads. *campaign*: the same through the run folder, with its journal and checksums, by the local executor. *plan*: the same as a
plan through `calibrate` beside this program, with sampler and report. *Python, bare*: `python3 -c pass` started by as many threads. *exchange*: one worker in Python
that answers with the number, asked for one run after the other, without a folder; its start is not counted. *worker*: such workers through the run folder, as many as runs at a time.
";

/// What is timed in each round.
const WAYS: [&str; 6] = ["bare", "campaign", "plan", "Python, bare", "exchange", "worker"];

pub(crate) fn run(args: &OverheadArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "overhead")?;
    let folder = tempfile::tempdir().map_err(RunError::new)?;
    let mut walls_s: [Vec<f64>; WAYS.len()] = Default::default();
    let python = Command::new("python3").arg("--version").output().is_ok();
    let tasks: Vec<Task> = (0..args.runs as u64)
        .map(|number| Task { number, command: 0, parameters: vec![0.1 * number as f64] })
        .collect();
    for round in 1..=ROUNDS {
        let dir = folder.path().join(round.to_string());
        fs::create_dir(&dir).map_err(RunError::new)?;
        walls_s[0].push(bare(args, &["sh", "-c", SCRIPT, "0.5"], &dir)?);
        walls_s[1].push(campaign(args, &command(), &tasks, &dir.join("campaign"))?);
        walls_s[2].extend(plan(args, &dir)?);
        if python {
            walls_s[3].push(bare(args, &["python3", "-c", "pass"], &dir)?);
            walls_s[4].push(exchange(&tasks, &dir)?);
            walls_s[5].push(campaign(args, &worker(), &tasks, &dir.join("workers"))?);
        }
    }
    let mut table = Table::new(&["way", "wall time per run [ms]", "beside the bare command [ms]"]);
    let per_run_ms =
        |walls_s: &[f64]| 1e3 * Timing::of(walls_s.to_vec()).median_s / args.runs as f64;
    let bare_ms = per_run_ms(&walls_s[0]);
    for (place, (way, walls_s)) in WAYS.into_iter().zip(&walls_s).enumerate() {
        let [time, beside] = if walls_s.is_empty() {
            ["not here".to_owned(), "–".to_owned()]
        } else {
            let ms = per_run_ms(walls_s);
            let beside = significant(ms - bare_ms, 3);
            [significant(ms, 3), if place < 3 { beside } else { "–".to_owned() }]
        };
        table.push(vec![way.to_owned(), time, beside]);
    }
    report.table(&table)?;
    let text =
        format!("{TEXT}\n{} runs, {} at a time.\n\n{}", args.runs, args.parallel, table.markdown());
    Ok(report.page("What a run costs beside the simulator", &text)?)
}

/// The command started as simply as possible on as many threads; wall time \[s\].
fn bare(args: &OverheadArgs, argv: &[&str], dir: &Path) -> Result<f64, RunError> {
    let next = AtomicUsize::new(0);
    let start = || -> std::io::Result<()> {
        while next.fetch_add(1, Ordering::Relaxed) < args.runs {
            let mut command = Command::new(argv[0]);
            command.args(&argv[1..]).current_dir(dir);
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
fn campaign(
    args: &OverheadArgs,
    spec: &CampaignSpec,
    tasks: &[Task],
    dir: &Path,
) -> Result<f64, RunError> {
    let campaign = Campaign::create(dir, spec, &BTreeMap::new()).map_err(RunError::new)?;
    let mut local = Local::new(args.parallel);
    let (wall_s, ran) =
        Clock::Wall.measure(|| local.run(&campaign, tasks, &mut |_| (), &Stop::new()));
    ran.map_err(RunError::new)?;
    for task in tasks {
        let outcome = campaign.outcome(task.number);
        if outcome.as_ref().and_then(|outcome| outcome.values()) != Some(&task.parameters) {
            return Err(RunError::new(format_args!("run {}: {outcome:?}", task.number)));
        }
    }
    Ok(wall_s)
}

/// One worker that is asked for one run after the other, without a folder; wall time \[s\].
fn exchange(tasks: &[Task], dir: &Path) -> Result<f64, RunError> {
    let asked = |tasks: &[Task], name: &str| -> Result<f64, RunError> {
        let folder = dir.join(name);
        fs::create_dir(&folder).map_err(RunError::new)?;
        let (wall_s, answers) = Clock::Wall.measure(|| ask_worker(&worker(), tasks, &folder));
        for (task, answer) in tasks.iter().zip(answers.map_err(RunError::new)?) {
            if answer["y"][0].as_f64() != task.parameters.first().copied() {
                return Err(RunError::new(format_args!("run {}: {answer}", task.number)));
            }
        }
        Ok(wall_s)
    };
    // The start, and the end, are those of a worker that is asked once.
    let all = vec![tasks; EXCHANGES].concat();
    let often = asked(&all, "asked")? - asked(&tasks[..1], "started")?;
    Ok(often / EXCHANGES as f64)
}

fn command() -> CampaignSpec {
    let argv = ["sh", "-c", SCRIPT, "{a}"].map(str::to_owned).to_vec();
    spec(Call::new(argv), "out.csv", Format::Csv)
}

fn worker() -> CampaignSpec {
    let argv = ["python3", "-c", WORKER].map(str::to_owned).to_vec();
    spec(Call { worker: true, ..Call::new(argv) }, ANSWER, Format::Json)
}

fn spec(call: Call, file: &str, format: Format) -> CampaignSpec {
    let call = Call { timeout_s: 60.0, retries: 0, ..call };
    let result = ResultSpec {
        file: file.into(),
        format,
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
