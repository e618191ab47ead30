//! What the directory costs per run: 1000 runs of a command that does nothing but leave one number,
//! against starting the same command 1000 times.
//!
//! `cargo run --release -p campaign --example overhead [RUNS [PARALLEL [DIRECTORY]]]`

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use campaign::{
    Call, Campaign, CampaignSpec, CommandSpec, Executor, Format, Interpolation, Keep, Local,
    OutputSpec, ResultSpec, Stop, Task,
};

// Only builtins, so that one run is one process.
const SCRIPT: &str = "printf 'x\\n%s\\n' \"$0\" > out.csv";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let runs: usize = arguments.next().map_or(Ok(1000), |text| text.parse())?;
    let parallel: usize = arguments.next().map_or(Ok(2), |text| text.parse())?;
    let place = arguments.next().map_or_else(std::env::temp_dir, Into::into);
    let dir = tempfile::tempdir_in(place)?;
    for round in 1..=3 {
        let bare = bare(runs, parallel, dir.path())?;
        let kept = campaign(runs, parallel, &dir.path().join(format!("campaign-{round}")))?;
        let per_run = |seconds: f64| 1e3 * seconds / runs as f64;
        eprintln!(
            "{runs} runs, {parallel} at once: bare {:.3} ms per run, campaign {:.3} ms per run, overhead {:.3} ms",
            per_run(bare),
            per_run(kept),
            per_run(kept - bare)
        );
    }
    Ok(())
}

/// The same command, started as simply as possible on as many threads.
fn bare(runs: usize, parallel: usize, dir: &Path) -> Result<f64, Box<dyn Error>> {
    let next = AtomicUsize::new(0);
    let start = Instant::now();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..parallel)
            .map(|_| {
                scope.spawn(|| {
                    while next.fetch_add(1, Ordering::Relaxed) < runs {
                        let mut command = Command::new("sh");
                        command.args(["-c", SCRIPT, "0.5"]).current_dir(dir);
                        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
                        command.status()?;
                    }
                    Ok::<(), std::io::Error>(())
                })
            })
            .collect();
        threads.into_iter().try_for_each(|thread| thread.join().unwrap_or(Ok(())))
    })?;
    Ok(start.elapsed().as_secs_f64())
}

fn campaign(runs: usize, parallel: usize, dir: &Path) -> Result<f64, Box<dyn Error>> {
    let call = Call {
        argv: ["sh", "-c", SCRIPT, "{a}"].map(str::to_owned).to_vec(),
        environment: BTreeMap::new(),
        timeout_s: 60.0,
        retries: 0,
        keep: Keep::Failed,
    };
    let result = ResultSpec {
        file: "out.csv".into(),
        format: Format::Csv,
        control: None,
        value: "x".into(),
        interpolate: Interpolation::Refuse,
    };
    let outputs = vec![OutputSpec { result, at: vec![0.0] }];
    let command = CommandSpec { name: "nothing".into(), call, outputs };
    let spec = CampaignSpec { parameter_names: vec!["a".into()], commands: vec![command], seed: 1 };
    let campaign = Campaign::create(dir, &spec, &BTreeMap::new())?;
    let tasks: Vec<Task> = (0..runs as u64)
        .map(|number| Task { number, command: 0, parameters: vec![0.1 * number as f64] })
        .collect();
    let start = Instant::now();
    Local { parallel }.run(&campaign, &tasks, &mut |_| (), &Stop::new())?;
    let seconds = start.elapsed().as_secs_f64();
    for task in &tasks {
        let outcome = campaign.outcome(task.number).ok_or("a run has no outcome")?;
        if outcome.values() != Some(&task.parameters) {
            return Err(format!("run {}: {outcome:?}", task.number).into());
        }
    }
    Ok(seconds)
}
