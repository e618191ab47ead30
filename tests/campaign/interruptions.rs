//! Runs that are interrupted, killed or damaged, and taken up again.

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::{Driver, LINE_SH, line, line_plan, runs, status, until};

#[test]
fn an_interrupted_run_is_taken_up_with_the_same_bits_and_one_driver_has_it() {
    let whole = line(24, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    let bytes = whole.posterior_bytes("results/line");
    assert_eq!(runs(&whole), 24);

    for (signal, code) in
        [(Signal::INT, Some(130)), (Signal::TERM, Some(130)), (Signal::KILL, None)]
    {
        // The plan says how long a run takes, and is a part of the posterior: the script takes its time itself.
        let sandbox = line(24, "0");
        sandbox.write("line.sh", LINE_SH.replace("sleep \"$2\"", "sleep 0.1"));
        let driver = Driver::start(&sandbox, "--plan line.toml");
        until("a few runs", || runs(&sandbox) >= 5);
        let second = sandbox.run("--resume results/line");
        assert_eq!(second.code, 1, "{second:#?}");
        assert!(second.stderr.contains("is in use by process"), "{second:#?}");
        let running = status(&sandbox, "results/line");
        assert_eq!((&running["state"], &running["total"]), (&"running".into(), &24.into()));
        let mid = sandbox.run("export results/line --out mid");
        assert!(mid.succeeded().stdout.contains("samples"), "{mid:?}");
        let header = fs::read_to_string(sandbox.path().join("mid/samples.csv")).expect("samples");
        assert!(header.starts_with("sample,a [1],state"), "{header}");
        driver.signal(signal);
        let (exit, stderr) = driver.wait();
        assert_eq!(exit, code, "{stderr}");
        if code.is_some() {
            assert!(stderr.contains("calibrate --resume results/line"), "{stderr}");
            assert!(stderr.contains("of 24 runs have ended"), "{stderr}");
        }
        let stopped = status(&sandbox, "results/line");
        assert_eq!(stopped["state"], "stopped", "{stopped:#?}");
        let finished = stopped["finished"].as_u64().expect("a number") as usize;
        assert!((1..24).contains(&finished), "{finished}");
        let before = runs(&sandbox);
        sandbox.run("--resume results/line --quiet").succeeded();
        assert_eq!(sandbox.posterior_bytes("results/line"), bytes);
        assert_eq!(runs(&sandbox) - before, 24 - finished, "nothing that finished is run again");
    }
}

#[test]
fn a_changed_plan_and_damaged_files_are_named_and_the_rest_is_used() {
    let sandbox = line(24, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let bytes = sandbox.posterior_bytes("results/line");

    // Another plan is refused, by its first difference; another executor is not.
    sandbox.write("other.toml", line_plan(24, "0").replace("upper = 5.0", "upper = 6.0"));
    sandbox.run("--resume results/line --plan other.toml").refused(&[
        "other.toml",
        "upper",
        "6.0",
        "5.0",
    ]);
    sandbox.write("other.toml", line_plan(24, "0").replace("parallel = 2", "parallel = 1"));
    sandbox.run("--resume results/line --plan other.toml --quiet").succeeded();
    sandbox.write("line.toml", line_plan(32, "0"));
    let noted = sandbox.run("--resume results/line");
    assert!(noted.succeeded().stderr.contains("has changed since the run began"), "{noted:#?}");
    sandbox.write("line.toml", line_plan(24, "0"));

    // One flipped digit of one result: that run is made again, and no other.
    let journal = sandbox.path().join("results/line/campaign/results.jsonl");
    let text = fs::read_to_string(&journal).expect("results.jsonl");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let place = lines[7].find("values").expect("values") + 12;
    let digit = lines[7][place..].find(|c: char| c.is_ascii_digit()).expect("a digit") + place;
    let flipped = if &lines[7][digit..=digit] == "1" { "2" } else { "1" };
    lines[7].replace_range(digit..=digit, flipped);
    fs::write(&journal, lines.join("\n") + "\n").expect("written");
    let before = runs(&sandbox);
    let ran = sandbox.run("--resume results/line");
    ran.succeeded();
    assert!(ran.stderr.contains("results.jsonl, line 8"), "{}", ran.stderr);
    assert_eq!(runs(&sandbox) - before, 1);
    assert_eq!(sandbox.posterior_bytes("results/line"), bytes);

    // A damaged plan is mended with the plan.
    let resolved = sandbox.path().join("results/line/campaign/resolved-plan.json");
    let text = fs::read_to_string(&resolved).expect("the plan").replace("\"line\"", "\"lime\"");
    fs::write(&resolved, text).expect("written");
    sandbox.run("--resume results/line").refused(&["resolved-plan.json", "--plan"]);
    let before = runs(&sandbox);
    sandbox.run("--resume results/line --plan line.toml").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), bytes);
    assert_eq!(runs(&sandbox), before);
    let record = sandbox.path().join("results/line/campaign/campaign.json");
    let text = fs::read_to_string(&record).expect("campaign.json");
    fs::write(&record, &text[..text.len() / 2]).expect("cut off");
    sandbox.run("--resume results/line").refused(&["campaign.json", "--plan FILE"]);
    sandbox.run("--resume results/line --plan line.toml").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), bytes);
    assert_eq!(runs(&sandbox), before, "its runs are used");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_full_disk_stops_the_run_with_a_clear_word_and_loses_nothing() {
    let whole = line(48, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    let sandbox = line(48, "0");
    // No file may grow beyond 10 kB: the journal of results reaches that in the middle of the run.
    let output = Command::new("sh")
        .current_dir(sandbox.path())
        .args(["-c", "trap '' XFSZ; ulimit -f 20; exec \"$0\" --plan line.toml"])
        .arg(env!("CARGO_BIN_EXE_calibrate"))
        .output()
        .expect("sh");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("disk is full"), "{stderr}");
    assert!(stderr.contains("calibrate --resume results/line"), "{stderr}");
    let stored = status(&sandbox, "results/line")["finished"].as_u64().expect("a number");
    assert!(stored > 0, "{stored}");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), whole.posterior_bytes("results/line"));
}

/// Numbers that look random, from a seed.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn share(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1u64 << 31) as f64
    }
}

/// `cargo test -p calibrate --test e2e a_hundred_kills -- --ignored --nocapture`: a stage of its own in `.ci/run`.
#[test]
#[ignore = "takes a minute or two"]
fn a_hundred_kills_at_random_moments_and_the_same_posterior() {
    const KILLS: usize = 100;
    let sandbox = line(24, "0");
    let begun = Instant::now();
    sandbox.run("--plan line.toml --quiet").succeeded();
    let whole = begun.elapsed();
    let bytes = sandbox.posterior_bytes("results/line");
    let seed = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let mut random = Random(seed);
    let (mut kills, mut finished, mut made) = (0, 0, 0);
    while kills < KILLS || finished == 0 {
        let dir = format!("run-{finished}");
        made += 1;
        let there = sandbox.path().join(&dir).join("campaign/campaign.json").is_file();
        let arguments = if there {
            format!("--resume {dir} --quiet")
        } else {
            format!("--plan line.toml --out {dir} --quiet")
        };
        // The moments are spread over a whole run, and beyond the end of a resumed one.
        let patience = whole.mul_f64(random.share());
        let mut driver = Driver::start(&sandbox, &arguments);
        let started = Instant::now();
        let ended = loop {
            if let Some(status) = driver.child.try_wait().expect("a child") {
                break Some(status);
            }
            if started.elapsed() >= patience && kills < KILLS {
                driver.signal(Signal::KILL);
                break None;
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        let (code, stderr) = driver.wait();
        match (ended, code) {
            (None, None) => kills += 1,
            (_, Some(0)) => {
                assert!(sandbox.posterior_bytes(&dir) == bytes, "{dir} differs");
                finished += 1;
            }
            other => panic!("{dir}: {other:?}\n{stderr}"),
        }
    }
    eprintln!(
        "{kills} kills in {made} starts, {finished} runs to the end, each the same; {:.0} s",
        begun.elapsed().as_secs_f64()
    );
}

#[test]
#[ignore = "long: run by .ci/run"]
fn runs_of_several_stages_at_a_time_give_the_bits_of_one_at_a_time_through_a_kill() {
    // Half of the runs take their time.
    let script = LINE_SH.replace("sleep \"$2\"", "case $1 in *[02468]) sleep 0.2;; esac");
    let overlapping = |parallel: &str| {
        let plan = line_plan(48, "0").replace("samples = 48", "samples = 48\noverlap = 12");
        let sandbox = line(48, "0");
        sandbox.write("line.toml", plan.replace("parallel = 2", parallel));
        sandbox.write("line.sh", &script);
        sandbox
    };
    let whole = overlapping("parallel = 1");
    whole.run("--plan line.toml --quiet").succeeded();
    let bytes = whole.posterior_bytes("results/line");
    let sandbox = overlapping("parallel = 5");
    let driver = Driver::start(&sandbox, "--plan line.toml");
    until("a few runs", || runs(&sandbox) >= 20);
    driver.signal(Signal::KILL);
    driver.wait();
    let finished = status(&sandbox, "results/line")["finished"].as_u64().expect("a number");
    let before = runs(&sandbox);
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), bytes);
    assert_eq!(runs(&sandbox) - before, 48 - finished as usize, "nothing is run again");
    // Another overlap is another result, and refused on resuming.
    sandbox.write("other.toml", line_plan(48, "0"));
    let other = sandbox.run("--resume results/line --plan other.toml");
    assert!(other.code == 2 && other.stderr.contains("overlap"), "{other:#?}");
}
