//! Storms: everything around the runs fails at random, again and again, and the result is that of a quiet run to the bit.

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::interruptions::Random;
use super::runs::walk;
use super::{Driver, line, line_plan, status, workers};
use crate::sandbox::{Sandbox, root};

/// y = a t, by a program that meets a fault in about a third of its attempts. $SEED and the number of the attempt say which.
const SCRIPT: &str = r#"#!/bin/sh
set -eu
echo "$1" >> "$RUNS"
fault=$(awk -v s="$SEED" -v n="$(wc -l < "$RUNS")" 'BEGIN { srand(s * 100003 + n); rand(); print int(100 * rand()) }')
case $fault in
[0-4]) kill -KILL $$ ;;
[5-7]) ln -s /proc/self/mem out.csv; exit 0 ;;
8|9|10) echo "cannot write: No space left on device" >&2; exit 1 ;;
11|12|13) exit 75 ;;
14|15|16) echo "license server down" >&2; exit 3 ;;
17|18|19) setsid sleep 30 & ;;
20|21) head -c 30000000 /dev/zero ;;
22|23) printf 't,y\n1,0.1' > out.csv; exit 0 ;;
24) rm -r "$(pwd)"; exit 1 ;;
esac
awk -v a="$1" 'BEGIN { print "t,y"; for (t = 0; t <= 4; t++) printf "%d,%.17g\n", t, a * t }' > out.csv
"#;

/// The same by a worker, which may also be broken from its start on, and talk nonsense.
const FAULTS: &str = r#"fault=$(awk -v s="$SEED" -v n="$(wc -l < "$RUNS")" 'BEGIN { srand(s * 100003 + n); rand(); print int(100 * rand()) }')
case $fault in
[0-3]) kill -KILL $$ ;;
4|5) echo nonsense; continue ;;
6|7) printf '{"id": %s, "values"' "$id"; exit 0 ;;
8|9|10) echo "cannot write: No space left on device" >&2; exit 1 ;;
11|12) echo "{"id": $id, "failure": {"code": 75}}"; continue ;;
13|14) echo "{"id": $id, "failure": {"code": 3, "message": "license server down"}}"; continue ;;
15|16) exit 3 ;;
17) sleep 30 ;;
18|19) setsid sleep 30 & ;;
20) head -c 30000000 /dev/zero >&2 ;;
21) head -c 70000000 /dev/zero | tr '\0' y; continue ;;
22|23) id=$((id + 1)) ;;
24) rm -r "$folder" ;;
25) exec >&- ;;
esac
"#;

/// What one worker after the other meets at its start.
const STARTS: &str = r#"echo start >> "$RUNS.starts"
case $(awk -v s="$SEED" -v n="$(wc -l < "$RUNS.starts")" 'BEGIN { srand(s * 100019 + n); rand(); print int(100 * rand()) }') in
[0-3]) kill -KILL $$ ;;
[4-6]) exit 75 ;;
7) echo "no module" >&2; exit 1 ;;
8) echo Loading ;;
esac
"#;

/// Simulators of a storm.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Command,
    Worker,
}

impl Kind {
    /// A sandbox with a quiet plan of so many runs, whose storm `seed` says.
    fn quiet(self, samples: usize, seed: u64) -> Sandbox {
        let sandbox = match self {
            Self::Command => line(samples, "0"),
            Self::Worker => workers::line(samples),
        };
        let text = match self {
            Self::Command => line_plan(samples, "0"),
            Self::Worker => workers::line_plan(samples).replace("timeout_s = 60", "timeout_s = 5"),
        };
        sandbox.write("line.toml", plan(&text, seed));
        sandbox
    }

    /// Makes its simulator one that meets faults.
    fn make_stormy(self, sandbox: &Sandbox) {
        match self {
            Self::Command => sandbox.write("line.sh", SCRIPT),
            Self::Worker => sandbox.write("worker.sh", workers::script(STARTS, FAULTS)),
        };
    }
}

/// A plan whose storm `seed` says.
fn plan(text: &str, seed: u64) -> String {
    text.replace("timeout_s = 60", "timeout_s = 60\ntry_later = { pause_s = 0.01 }")
        .replace("timeout_s = 5\n", "timeout_s = 5\ntry_later = { pause_s = 0.01 }\n")
        .replace("RUNS =", &format!("SEED = \"{seed}\", RUNS ="))
}

/// What happens to a driver.
#[derive(Debug, Clone, Copy)]
enum Blow {
    None,
    Kill,
    Interrupt,
    RemoveLock,
    /// A copy of the folder is resumed from then on, while the original is driven.
    Copy,
}

/// Drives a plan through a storm to its end; returns the number of drivers that it took.
fn storm(kind: Kind, samples: usize, seed: u64) -> usize {
    let quiet = kind.quiet(samples, seed);
    quiet.run("--plan line.toml --quiet").succeeded();
    let bytes = quiet.posterior_bytes("results/line");

    let sandbox = kind.quiet(samples, seed);
    kind.make_stormy(&sandbox);
    let mut random = Random(seed);
    let (mut dir, mut copies, mut drivers) = ("run".to_owned(), 0, 0);
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < Duration::from_secs(600), "seed {seed}: {drivers} drivers");
        let there = sandbox.path().join(&dir).join("campaign/campaign.json").is_file();
        let failed = there && status(&sandbox, &dir)["failed"] != 0;
        let arguments = match (there, failed) {
            (false, _) => format!("--plan line.toml --out {dir} --quiet"),
            (true, false) => format!("--resume {dir} --quiet"),
            (true, true) => format!("--resume {dir} --retry-failed --quiet"),
        };
        let mut driver = Driver::start(&sandbox, &arguments);
        drivers += 1;
        let blow = match (16.0 * random.share()) as usize {
            0..=3 => Blow::Kill,
            4 | 5 => Blow::Interrupt,
            6 | 7 => Blow::RemoveLock,
            8 => Blow::Copy,
            _ => Blow::None,
        };
        let patience = Duration::from_secs_f64(0.01 * samples as f64 * random.share());
        let started = Instant::now();
        let mut struck = false;
        while driver.child.try_wait().expect("a child").is_none() {
            std::thread::sleep(Duration::from_millis(2));
            if struck || started.elapsed() < patience {
                continue;
            }
            struck = true;
            match blow {
                Blow::None => {}
                Blow::Kill => driver.signal(Signal::KILL),
                Blow::Interrupt => driver.signal(Signal::INT),
                Blow::RemoveLock => {
                    // It may not be there yet.
                    let _ = fs::remove_file(sandbox.path().join(&dir).join("campaign/lock"));
                }
                Blow::Copy if there => {
                    copies += 1;
                    let copy = format!("copy-{copies}");
                    // Files come and go while it is copied; what is torn is mended.
                    let mut cp = Command::new("cp");
                    let cp = cp.current_dir(sandbox.path()).args(["-r", &dir, &copy]);
                    let _ = cp.stderr(std::process::Stdio::null()).status();
                    if sandbox.path().join(&copy).join("campaign/campaign.json").is_file() {
                        dir = copy;
                        driver.signal(Signal::KILL);
                    }
                }
                Blow::Copy => {}
            }
        }
        let (code, stderr) = driver.wait();
        assert!(!stderr.contains("panicked"), "seed {seed}: {blow:?}\n{stderr}");
        assert!(
            matches!(code, None | Some(0 | 1 | 130)),
            "seed {seed}: {blow:?} {code:?}\n{stderr}"
        );
        if code == Some(0) && status(&sandbox, &dir)["failed"] == 0 {
            assert!(sandbox.posterior_bytes(&dir) == bytes, "seed {seed}: {dir} differs");
            return drivers;
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_storm_ends_in_the_bits_of_a_quiet_run() {
    // A run that ends before the first blow is none.
    let drivers: usize = [1, 2].map(|seed| storm(Kind::Command, 40, seed)).iter().sum();
    assert!(drivers > 2, "no storm at all");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_storm_over_workers_ends_in_the_bits_of_a_quiet_run() {
    // A run that ends before the first blow is none.
    let drivers: usize = [1, 2].map(|seed| storm(Kind::Worker, 40, seed)).iter().sum();
    assert!(drivers > 2, "no storm at all");
}

/// `cargo test -p calibrate --test e2e hundred_storms -- --ignored --nocapture`; STORMS and SEED say how many, from which,
/// RUNS of how many runs each, and KIND=worker takes workers.
#[test]
#[ignore = "takes an hour or so"]
fn a_hundred_storms_over_two_hundred_runs_end_in_the_bits_of_a_quiet_run() {
    let number = |name: &str, default| {
        std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
    };
    let (storms, first) = (number("STORMS", 100), number("SEED", 1));
    let runs = number("RUNS", 200) as usize;
    let worker = std::env::var("KIND").is_ok_and(|kind| kind == "worker");
    let kind = if worker { Kind::Worker } else { Kind::Command };
    for seed in first..first + storms {
        let begun = Instant::now();
        let drivers = storm(kind, runs, seed);
        eprintln!("storm {seed}: {drivers} drivers, {:.0} s", begun.elapsed().as_secs_f64());
    }
}

#[test]
fn every_test_of_the_fault_table_exists() {
    let page = fs::read_to_string(root().join("crates/campaign/docs/faults.md")).expect("the page");
    let rows = page.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| fault"));
    let mut sources = String::new();
    for folder in ["tests", "crates/campaign/src", "crates/campaign/tests", "crates/smc-calib/src"]
    {
        sources.extend(walk(&root().join(folder)).iter().filter_map(|path| {
            let rust = path.extension().is_some_and(|extension| extension == "rs");
            let text = fs::read_to_string(path).ok().filter(|_| rust)?;
            // What takes long is left out of the README's tests alone.
            let lines = text.lines().map(str::trim);
            let lines = lines.filter(|line| !line.starts_with("#[ignore = \"long"));
            Some(lines.map(|line| format!("{line}\n")).collect::<String>())
        }));
    }
    let mut tests = 0;
    for row in rows {
        let name = row.rsplit('|').nth(1).map(|cell| cell.trim().trim_matches('`'));
        let name = name.unwrap_or_else(|| panic!("no test in {row}"));
        assert!(sources.contains(&format!("#[test]\nfn {name}(")), "{name} is no test");
        tests += 1;
    }
    assert!(tests > 30, "{tests} rows");
}
