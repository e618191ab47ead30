//! Failures that are not for ever: outages, failed runs made once more, limits that change, copies of folders.

use std::fs;

use super::{Driver, LINE_SH, line, line_plan, runs, status};
use crate::sandbox::Sandbox;

/// The line, whose program fails while the file `down` is there.
fn unreliable(samples: usize, fault: &str) -> Sandbox {
    let sandbox = line(samples, "0");
    let check = format!("if [ -e \"$(dirname \"$RUNS\")/down\" ]; then {fault}; fi\nsleep");
    sandbox.write("line.sh", LINE_SH.replacen("sleep", &check, 1));
    sandbox
}

fn mend(sandbox: &Sandbox) {
    fs::remove_file(sandbox.path().join("down")).expect("removed");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn after_an_outage_and_retries_the_result_is_that_of_a_quiet_run_to_the_bit() {
    let quiet = line(48, "0");
    quiet.run("--plan line.toml --quiet").succeeded();
    let bytes = quiet.posterior_bytes("results/line");

    // All runs fail from the first on.
    let sandbox = unreliable(48, "echo 'license server down' >&2; exit 3");
    sandbox.write("down", "");
    let ran = sandbox.run("--plan line.toml");
    assert_eq!(ran.code, 1, "{ran:#?}");
    for words in [
        "looks like an outage",
        "of the last",
        "exit code 3",
        "license server down",
        "--resume results/line --retry-failed",
    ] {
        assert!(ran.stderr.contains(words), "{words} is not in\n{}", ran.stderr);
    }
    assert!(runs(&sandbox) < 20, "{}", runs(&sandbox));
    let said = sandbox.run("status results/line");
    assert!(said.succeeded().stdout.contains("--retry-failed"), "{}", said.stdout);
    // Not mended yet: the same again, and no run is lost by it.
    let ran = sandbox.run("--resume results/line --retry-failed");
    assert!(ran.stderr.contains("looks like an outage"), "{}", ran.stderr);
    mend(&sandbox);
    let unknown = sandbox.run("--resume results/line --retry-failed=oom");
    unknown.refused(&["--retry-failed", "oom", "exit code 3"]);
    sandbox.run("--resume results/line --retry-failed=server --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), bytes);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn failures_that_were_counted_can_be_given_up_after_the_end_and_what_they_moved_is_placed_again() {
    let quiet = line(48, "0");
    quiet.run("--plan line.toml --quiet").succeeded();
    // Every third run of the first thirty fails, which moves the stages behind them.
    let sandbox = unreliable(
        48,
        "n=$(wc -l < \"$RUNS\"); if [ $n -le 30 ] && [ $((n % 3)) = 0 ]; then echo no >&2; exit 4; fi",
    );
    sandbox.write("down", "");
    sandbox.write("line.toml", line_plan(48, "0").replace("parallel = 2", "parallel = 1"));
    sandbox.run("--plan line.toml --quiet").succeeded();
    assert_eq!(status(&sandbox, "results/line")["failed"], 10);
    assert_ne!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    mend(&sandbox);
    let again = sandbox.run("--resume results/line --retry-failed");
    assert!(again.succeeded().stderr.contains("10 failed runs are made once more"), "{again:?}");
    assert!(again.stderr.contains("runs are placed again"), "{}", again.stderr);
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    let before = runs(&sandbox);
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(runs(&sandbox), before, "nothing is left to be made");
    let nothing = sandbox.run("--resume results/line --retry-failed");
    assert!(nothing.succeeded().stderr.contains("0 failed runs"), "{nothing:?}");
    sandbox.run("--plan line.toml --retry-failed").refused(&["--resume"]);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn what_was_placed_with_failures_can_be_kept_and_all_runs_count() {
    let samples = 128;
    let quiet = line(samples, "0");
    quiet.run("--plan line.toml --quiet").succeeded();
    let sandbox = unreliable(
        samples,
        "n=$(wc -l < \"$RUNS\"); if [ $n -le 90 ] && [ $((n % 3)) = 0 ]; then exit $((3 + n % 2)); fi",
    );
    sandbox.write("down", "");
    sandbox.write("line.toml", line_plan(samples, "0").replace("parallel = 2", "parallel = 1"));
    sandbox.run("--plan line.toml --quiet").succeeded();
    mend(&sandbox);
    // First those of one cause, then the others.
    let made = runs(&sandbox);
    for (cause, again) in [("3", 15), ("4", 15)] {
        let cause = format!("--retry-failed=exit code {cause}");
        let ran = sandbox.run_args(&["--resume", "results/line", &cause, "--keep-placed"]);
        let said = format!("{again} failed runs are made once more");
        assert!(ran.succeeded().stderr.contains(&said), "{ran:?}");
        assert!(!ran.stderr.contains("placed again"), "{ran:?}");
    }
    assert_eq!(runs(&sandbox), made + 30, "no other run was made");
    let bytes = sandbox.posterior_bytes("results/line");
    let (found, exact) = (sandbox.posterior("results/line"), quiet.posterior("results/line"));
    assert_eq!(found["failures"].as_array().map(Vec::len), Some(0));
    assert_ne!(bytes, quiet.posterior_bytes("results/line"), "its stages were placed otherwise");
    let of = |posterior: &serde_json::Value, what: &str| {
        posterior["parameters"][0]["in_coordinate"][what].as_f64().expect("a number")
    };
    let (sd, off) = (of(&exact, "sd"), of(&found, "mean") - of(&exact, "mean"));
    assert!(off.abs() < 0.1 * sd, "{off} of {sd}");
    let evidence =
        |posterior: &serde_json::Value| posterior["log_evidence"]["value"].as_f64().expect("ln Z");
    assert!((evidence(&found) - evidence(&exact)).abs() < 0.1);
    // Taken up once more, exported, and taken up after a kill: the same.
    sandbox.run("--resume results/line --quiet").succeeded();
    assert!(sandbox.posterior_bytes("results/line") == bytes);
    sandbox.run("export results/line").succeeded();
    let weights = |name: &str| {
        let text = fs::read_to_string(sandbox.path().join("results/line").join(name)).expect(name);
        let mut rows = text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned);
        let head = rows.next().expect("a head");
        let place = head.split(',').position(|column| column == "weight").expect("weights");
        rows.map(|row| row.split(',').nth(place).expect("a weight").to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(weights("export/samples.csv"), weights("samples.csv"));
    assert_eq!(runs(&sandbox), made + 30);
    // Where it is no longer known what had been given up, the runs are placed as if nothing had failed.
    sandbox.write("results/line/campaign/given-up.json", "[");
    let again = sandbox.run("--resume results/line");
    assert!(again.succeeded().stderr.contains("runs are placed again"), "{again:?}");
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    // Where stages overlap, everything may have been placed before the first failure was counted.
    let sandbox = unreliable(64, "exit 4");
    sandbox.write("down", "");
    let plan = line_plan(64, "0").replace("samples = 64", "samples = 64\nbatch = 8\noverlap = 16");
    sandbox.write("line.toml", plan);
    sandbox.run("--plan line.toml --quiet");
    let counted = sandbox.run("--resume results/line --quiet");
    assert!(counted.stderr.contains("simulations failed"), "{counted:?}");
    mend(&sandbox);
    sandbox.run("--resume results/line --retry-failed --keep-placed --quiet").succeeded();
    assert_eq!(status(&sandbox, "results/line")["failed"], 0);
    sandbox.run("--resume results/line --keep-placed").refused(&["--retry-failed"]);
}

#[test]
fn a_run_whose_failures_are_being_made_again_has_no_result() {
    let quiet = line(24, "0");
    let again = "timeout_s = 60\ntry_later = { pause_s = 0, retries = 0 }";
    let plan = line_plan(24, "0").replace("timeout_s = 60", again);
    quiet.write("line.toml", plan.as_str());
    quiet.run("--plan line.toml --quiet").succeeded();
    // A third fails; when these are made again, the program cannot be called.
    let sandbox = unreliable(
        24,
        "n=$(wc -l < \"$RUNS\"); if [ $n -gt 24 ]; then exit 75; elif [ $((n % 3)) = 0 ]; then exit 4; fi",
    );
    sandbox.write("down", "");
    sandbox.write("line.toml", plan.as_str());
    sandbox.run("--plan line.toml --quiet").succeeded();
    let with_failures = sandbox.posterior_bytes("results/line");
    assert_eq!(sandbox.run("--resume results/line --retry-failed --quiet").code, 1);
    assert_eq!(status(&sandbox, "results/line")["state"], "stopped");
    let aside = sandbox.path().join("results/line/campaign/posterior.json.retried-1");
    assert!(fs::read(aside).expect("the earlier result") == with_failures);
    // Nor do its sums stay beside files that are about to be others.
    assert!(!sandbox.path().join("results/line/SHA256SUMS").exists());
    sandbox.run("inspect results/line").refused(&["no posterior yet", "--resume results/line"]);
    mend(&sandbox);
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    assert_eq!(status(&sandbox, "results/line")["state"], "done");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn limits_may_change_on_resuming_and_hold_from_then_on() {
    let quiet = line(24, "0");
    let longer = line_plan(24, "0").replace("timeout_s = 60", "timeout_s = 50");
    quiet.write("line.toml", &longer);
    quiet.run("--plan line.toml --quiet").succeeded();

    let sandbox = unreliable(24, "sleep 5");
    sandbox.write("line.toml", line_plan(24, "0").replace("timeout_s = 60", "timeout_s = 0.2"));
    sandbox.write("down", "");
    let ran = sandbox.run("--plan line.toml");
    assert!(ran.stderr.contains("not finished after 0.2 s"), "{}", ran.stderr);
    mend(&sandbox);
    sandbox.write("line.toml", &longer);
    let noted = sandbox.run("--resume results/line");
    assert!(noted.stderr.contains("limits on runs"), "{}", noted.stderr);
    sandbox
        .run("--resume results/line --plan line.toml --retry-failed=timeout --quiet")
        .succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    // They are kept: the plan in the folder is the one with the new limits.
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
}

#[test]
fn an_exit_code_that_asks_for_a_later_call_is_obeyed_and_a_wrong_one_is_refused() {
    let sandbox = unreliable(24, "echo 'no token' >&2; exit 12");
    let with = |what: &str| {
        let at = "timeout_s = 60";
        line_plan(24, "0").replace(at, &format!("{at}\ntry_later = {{ {what} }}"))
    };
    sandbox.write("down", "");
    sandbox.write("line.toml", with("exit_codes = [12], pause_s = 0.05, retries = 2"));
    let ran = sandbox.run("--plan line.toml");
    assert_eq!(ran.code, 1);
    for words in ["asked 3 times to be called later: exit code 12", "no token", "--resume"] {
        assert!(ran.stderr.contains(words), "{words} is not in\n{}", ran.stderr);
    }
    mend(&sandbox);
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(status(&sandbox, "results/line")["failed"], 0);
    for (what, words) in [
        ("exit_codes = [0]", ["exit_codes", "0 is not an exit code"]),
        ("exit_codes = [256]", ["exit_codes", "256"]),
        ("pause_s = -1", ["pause_s", "-1 is not a pause"]),
        ("pause_s = nan", ["pause_s", "NaN is not a pause"]),
        ("retries = 1.5", ["try_later.retries", "whole number"]),
        ("codes = [1]", ["codes", "unknown field"]),
    ] {
        sandbox.write("wrong.toml", with(what));
        sandbox.run("check wrong.toml").refused(&words);
    }
    let wrong = line_plan(24, "0").replace("timeout_s = 60", "timeout_s = 60\nlost = \"never\"");
    sandbox.write("wrong.toml", wrong);
    sandbox.run("check wrong.toml").refused(&["lost", "never", "stop"]);
}

#[test]
fn a_copy_of_a_folder_is_said_to_be_one_and_gives_the_same() {
    let sandbox = line(24, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let copied = std::process::Command::new("cp")
        .current_dir(sandbox.path())
        .args(["-r", "results/line", "results/copy"])
        .status();
    assert!(copied.expect("cp").success());
    let ran = sandbox.run("--resume results/copy");
    assert!(ran.succeeded().stderr.contains("a copy of another run"), "{}", ran.stderr);
    assert_eq!(sandbox.posterior_bytes("results/copy"), sandbox.posterior_bytes("results/line"));
    assert_eq!(runs(&sandbox), 24);
}

#[test]
fn a_program_that_is_replaced_is_noticed_and_refused_or_accepted() {
    // Replaced while the run goes on, by itself after its tenth run.
    let sandbox = line(24, "0");
    let replaces = LINE_SH.replacen(
        "sleep",
        "if [ $(wc -l < \"$RUNS\") -ge 10 ] && mkdir \"$0.once\"; then echo '# another' >> \"$0\"; fi\nsleep",
        1,
    );
    sandbox.write("line.sh", &replaces);
    let ran = sandbox.run("--plan line.toml");
    assert_eq!(ran.code, 1, "{ran:#?}");
    for words in ["line.sh has changed since the run began", "--accept-changes"] {
        assert!(ran.stderr.contains(words), "{words} is not in\n{}", ran.stderr);
    }
    let before = runs(&sandbox);
    assert!(before < 24, "{before}");
    sandbox.run("--resume results/line --accept-changes").succeeded();
    // Which of the stage's runs the other one made is not known: they are made again.
    let after = runs(&sandbox);
    assert!((25..=24 + before).contains(&after), "{before} {after}");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(runs(&sandbox), after);
    // Where what the run began with has been lost, it is asked for.
    let file = sandbox.path().join("results/line/campaign/programs.json");
    fs::write(&file, "{}").expect("written");
    let ran = sandbox.run("--resume results/line");
    assert!(ran.code == 2 && ran.stderr.contains("a damaged programs.json"), "{ran:#?}");
    assert!(ran.stderr.contains("--accept-changes"), "{ran:#?}");
    sandbox.run("--resume results/line --accept-changes").succeeded();
    // Put back, it is another one again.
    sandbox.write("line.sh", &replaces);
    sandbox.run("--resume results/line").refused(&["line.sh has changed"]);
}

/// Replaced by a program that gives other values, and put back as the message says.
#[test]
fn runs_of_a_program_that_was_replaced_for_a_while_are_made_again() {
    for overlap in ["", "overlap = 6"] {
        let line = || {
            let sandbox = line(24, "0");
            let plan =
                line_plan(24, "0").replace("samples = 24", &format!("samples = 24\n{overlap}"));
            sandbox.write("line.toml", plan);
            sandbox
        };
        let quiet = line();
        quiet.run("--plan line.toml --quiet").succeeded();
        let sandbox = line();
        let wrong = LINE_SH.replacen("a * t", "a * t + 3", 1);
        sandbox.write("wrong.sh", wrong.as_str());
        let replaces = LINE_SH.replacen(
            "sleep",
            "if [ $(wc -l < \"$RUNS\") -ge 4 ] && mkdir \"$0.once\"; then cp \"$(dirname \"$0\")/wrong.sh\" \"$0\"; fi\nsleep",
            1,
        );
        sandbox.write("line.sh", replaces.as_str());
        let ran = sandbox.run("--plan line.toml");
        assert!(ran.code == 1 && ran.stderr.contains("line.sh has changed"), "{ran:#?}");
        sandbox.write("line.sh", replaces.as_str());
        sandbox.run("--resume results/line --quiet").succeeded();
        let samples = |sandbox: &Sandbox| fs::read(sandbox.path().join("results/line/samples.csv"));
        assert!(samples(&sandbox).expect("samples") == samples(&quiet).expect("samples"));
    }
}

/// The same where the driver is killed before it looks, and the program is put back before the next one does.
#[test]
fn runs_of_a_program_that_was_replaced_while_its_driver_was_killed_are_made_again() {
    // One after the other, so that the fourth run ends the driver, and a fifth is never made.
    let plan = line_plan(24, "0").replace("parallel = 2", "parallel = 1");
    let plan = plan.replace("samples = 24", "samples = 24\nbatch = 8");
    let (quiet, sandbox) = (line(24, "0"), line(24, "0"));
    quiet.write("line.toml", plan.as_str());
    quiet.run("--plan line.toml --quiet").succeeded();
    let kills = LINE_SH.replacen(
        "sleep",
        "if [ $(wc -l < \"$RUNS\") = 4 ]; then cp \"$(dirname \"$0\")/wrong.sh\" \"$0\"; kill -9 $PPID; fi\nsleep",
        1,
    );
    sandbox.write("wrong.sh", LINE_SH.replacen("a * t", "a * t + 3", 1));
    sandbox.write("line.sh", kills.as_str());
    sandbox.write("line.toml", plan);
    assert_eq!(Driver::start(&sandbox, "--plan line.toml --quiet").wait().0, None, "killed");
    sandbox.write("line.sh", LINE_SH);
    let again = sandbox.run("--resume results/line");
    assert!(again.stderr.contains("line.sh has changed"), "{again:#?}");
    sandbox.write("line.sh", kills.as_str());
    let again = sandbox.run("--resume results/line");
    assert!(again.succeeded().stderr.contains("runs are made again: a program"), "{again:#?}");
    let samples = |sandbox: &Sandbox| fs::read(sandbox.path().join("results/line/samples.csv"));
    assert!(samples(&sandbox).expect("samples") == samples(&quiet).expect("samples"));
}

/// Put back before anything looks; by a link that is switched, too.
#[test]
fn runs_of_a_program_that_was_another_one_between_two_looks_are_made_again() {
    let quiet = line(24, "0");
    quiet.run("--plan line.toml --quiet").succeeded();
    let samples = |sandbox: &Sandbox| fs::read(sandbox.path().join("results/line/samples.csv"));
    // The third run puts the wrong program into its place, the fourth puts the right one back.
    let swap = "n=$(wc -l < \"$RUNS\"); if [ $n = 3 ]; then SWAP wrong.sh; elif [ $n = 4 ]; then SWAP right.sh; fi\nsleep";
    let moved = "cd \"$(dirname \"$RUNS\")\" && cp";
    let by_copy = format!("{moved} {{}} new && mv new line.sh && cd - > /dev/null");
    let by_link = format!("{moved} -P link-{{}} new && mv new line.sh && cd - > /dev/null");
    for how in [by_copy, by_link] {
        let sandbox = line(24, "0");
        let swap = ["wrong.sh", "right.sh"].iter().fold(swap.to_owned(), |text, name| {
            text.replace(&format!("SWAP {name}"), &how.replace("{}", name))
        });
        let right = LINE_SH.replacen("sleep", &swap, 1);
        sandbox.write("right.sh", &right);
        sandbox.write("wrong.sh", right.replacen("a * t", "a * t + 3", 1));
        for name in ["right.sh", "wrong.sh"] {
            let link = sandbox.path().join(format!("link-{name}"));
            std::os::unix::fs::symlink(name, link).expect("linked");
        }
        fs::remove_file(sandbox.path().join("line.sh")).expect("removed");
        std::os::unix::fs::symlink("right.sh", sandbox.path().join("line.sh")).expect("linked");
        sandbox.write("line.toml", line_plan(24, "0").replace("parallel = 2", "parallel = 1"));
        let ran = sandbox.run("--plan line.toml");
        let said = "was written while runs were made, and is what it was";
        assert!(ran.succeeded().stderr.contains(said), "{ran:#?}");
        assert!(samples(&sandbox).expect("samples") == samples(&quiet).expect("samples"));
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn failures_inside_the_posterior_are_said_and_the_result_is_not_converged() {
    let sandbox = line(128, "0");
    // The slope is about 2.02; no run below it comes to an end.
    let fails =
        "if awk -v a=\"$1\" 'BEGIN { exit !(a < 2.0) }'; then echo diverged >&2; exit 3; fi\nsleep";
    sandbox.write("line.sh", LINE_SH.replacen("sleep", fails, 1));
    let ran = sandbox.run("--plan line.toml");
    ran.succeeded();
    for words in ["NOT TO BE TRUSTED", "it depends on the parameters", "a = ", "likelihood zero"] {
        assert!(ran.stdout.contains(words), "{words} is not in\n{}", ran.stdout);
    }
    let failing = &sandbox.posterior("results/line")["failing"];
    assert!(failing["mass"].as_f64().is_some_and(|mass| mass > 0.1), "{failing:#?}");
    assert_eq!(failing["place"]["parameter"], "a");
    assert!(sandbox.path().join("results/line/failures.png").is_file());
}

#[test]
fn a_disk_that_is_full_before_the_run_begins_is_said_and_the_same_command_begins_it() {
    let sandbox = line(24, "0");
    let output = std::process::Command::new("sh")
        .current_dir(sandbox.path())
        .args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" --plan line.toml"])
        .arg(env!("CARGO_BIN_EXE_calibrate"))
        .output()
        .expect("sh");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("the run has not begun") && !stderr.contains("--resume"), "{stderr}");
    sandbox.run("--plan line.toml --quiet").succeeded();
    assert_eq!(status(&sandbox, "results/line")["finished"], 24);
}

#[test]
fn received_plans_and_folders_cannot_write_to_a_terminal_or_run_unasked() {
    let sandbox = line(24, "0");
    let titled = format!("title = \"a\\u001b]0;owned\\u0007b\"\n{}", line_plan(24, "0"));
    sandbox.write("line.toml", titled);
    let dry = sandbox.run("--plan line.toml --dry-run");
    assert!(!dry.succeeded().stdout.contains('\u{1b}'), "{:?}", dry.stdout);
    let ran = sandbox.run("--plan line.toml");
    assert!(!ran.succeeded().stdout.contains(['\u{1b}', '\u{7}']), "{:?}", ran.stdout);
    sandbox.write("keys.toml", "\"a\\u001b]0;owned\\u0007b\" = 1\n");
    let checked = sandbox.run("check keys.toml");
    assert!(checked.code == 2 && !checked.stderr.contains(['\u{1b}', '\u{7}']), "{checked:?}");
    let record = sandbox.path().join("results/line/campaign/campaign.json");
    if std::os::unix::fs::chown(&record, Some(54321), None).is_ok() {
        let refused = ["another user (number 54321)", "runs its commands as you", "--accept-owner"];
        sandbox.run("--resume results/line").refused(&refused);
        sandbox.run("--resume results/line --accept-owner --quiet").succeeded();
    } else {
        eprintln!("skipped: files cannot be given to another user here");
    }
}

#[test]
fn parameters_without_a_use_are_refused_and_a_design_may_lie_on_its_bounds() {
    let sandbox = line(24, "0");
    let unused = line_plan(24, "0").replace(
        "[experiments.pull.simulator]",
        "[parameters.b]\ndistribution = \"uniform\"\nlower = 0\nupper = 1\n[experiments.pull.simulator]",
    );
    sandbox.write("unused.toml", &unused);
    sandbox.run("check unused.toml").refused(&["parameters.b", "no command uses", "{b}"]);
    sandbox.write("unused.toml", unused.replace("\"{a}\",", "\"{a}\", \"{parameters}\","));
    sandbox.run("check unused.toml").succeeded();

    // 0 and 5 are the bounds; a table may miss them by a rounding.
    sandbox.write("sets.txt", "description a\nx -5e-17\ny 2.05\nz 5.000000000000001\n");
    let design = line_plan(24, "0").replace("samples = 24", "samples = 3\ndesign = \"sets.txt\"");
    sandbox.write("line.toml", &design);
    let ran = sandbox.run("--plan line.toml");
    assert!(!ran.succeeded().stdout.contains("place the last samples"), "{}", ran.stdout);
    sandbox.write("line.toml", design.replace("samples = 3", "samples = 4"));
    sandbox.run("check line.toml").refused(&["4 samples beside a design of 3"]);
    sandbox.write("sets.txt", "description a\nx -1e-6\ny 2.05\nz 5\n");
    sandbox.write("line.toml", &design);
    sandbox.run("check line.toml").refused(&["sets.txt", "0 to 5"]);
}
