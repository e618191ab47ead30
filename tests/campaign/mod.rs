//! `calibrate --plan`, `--resume`, `status`, `export`: calibration of commands, and what survives interruptions.

mod extension;
mod interruptions;
mod outages;
mod proposal;
mod runs;
mod slurm;
mod storm;
mod workers;

use std::fs;
use std::io::Read as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::sandbox::Sandbox;

/// y = a t, with the time that a run takes and a note of every run that is made.
const LINE_SH: &str = r#"#!/bin/sh
set -eu
echo "$1" >> "$RUNS"
sleep "$2"
awk -v a="$1" 'BEGIN { print "t,y"; for (t = 0; t <= 4; t++) printf "%d,%.17g\n", t, a * t }' > out.csv
"#;
const LINE_CSV: &str = "t,y\n1,2.1\n2,3.9\n3,6.2\n";

/// A plan that calibrates the slope of a line with `samples` runs that take `seconds` each.
fn line_plan(samples: usize, seconds: &str) -> String {
    format!(
        r#"
name = "line"
[parameters.a]
distribution = "uniform"
lower = 0.0
upper = 5.0
[experiments.pull.simulator]
kind = "command"
argv = ["sh", "{{plan_dir}}/line.sh", "{{a}}", "{seconds}"]
environment = {{ RUNS = "{{plan_dir}}/runs.txt" }}
timeout_s = 60
keep = "none"
[experiments.pull.observables.y]
table = "line.csv"
control = "t"
noise = {{ kind = "inferred", s0 = 0.2 }}
result = {{ file = "out.csv", control = "t", value = "y" }}
[sampler]
samples = {samples}
[executor]
kind = "local"
parallel = 2
"#
    )
}

fn line(samples: usize, seconds: &str) -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("line.toml", line_plan(samples, seconds));
    sandbox.write("line.sh", LINE_SH);
    sandbox.write("line.csv", LINE_CSV);
    sandbox
}

/// Runs of the simulator so far.
fn runs(sandbox: &Sandbox) -> usize {
    fs::read_to_string(sandbox.path().join("runs.txt")).map_or(0, |text| text.lines().count())
}

fn status(sandbox: &Sandbox, dir: &str) -> Value {
    sandbox.run(&format!("status {dir} --json")).json()
}

/// A driver that is running.
struct Driver {
    child: Child,
}

impl Driver {
    fn start(sandbox: &Sandbox, arguments: &str) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_calibrate"))
            .current_dir(sandbox.path())
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command starts");
        Self { child }
    }

    fn signal(&self, signal: Signal) {
        // It may have ended by itself.
        let _ = kill_process(Pid::from_child(&self.child), signal);
    }

    fn wait(mut self) -> (Option<i32>, String) {
        let status = self.child.wait().expect("it ends");
        let mut stderr = String::new();
        self.child.stderr.take().expect("piped").read_to_string(&mut stderr).expect("UTF-8");
        (status.code(), stderr)
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until something is true, for at most half a minute.
#[track_caller]
fn until(what: &str, mut is: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < Duration::from_secs(30), "{what} did not happen");
        std::thread::sleep(Duration::from_millis(5));
    }
}
