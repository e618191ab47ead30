//! Runs as local processes.

use std::fs;
use std::time::{Duration, Instant};

use campaign::{
    Campaign, Event, Executor, ExecutorError, FailureKind, Format, Interpolation, Keep, Local,
    LostRuns, Outcome, OutputSpec, ResultSpec, Stop,
};

use crate::sandbox::{
    Sandbox, bits, create, fails, is_gone, rows, run, shell, spec, task, tasks, values,
};

const ECHO: &str = "printf 'x\\n%s\\n' \"$1\" > out.csv";

fn failure(campaign: &Campaign, number: u64) -> (FailureKind, String, u32) {
    match campaign.outcome(number) {
        Some(Outcome::Failed { kind, detail, attempts, .. }) => (kind, detail, attempts),
        other => panic!("run {number} must have failed: {other:?}"),
    }
}

#[test]
fn every_run_gets_its_parameters_and_its_values_come_back_to_the_bit() {
    let sandbox = Sandbox::new();
    let mut command = shell("printf 'x\\n%s\\n%s\\n' \"$1\" \"$2\" > out.csv");
    command.outputs = vec![rows("out.csv", "x", 2)];
    let campaign = create(&sandbox.dir(), &spec(command));
    let tasks = tasks(20);
    let events = run(&campaign, &tasks);
    for task in &tasks {
        assert_eq!(bits(&values(&campaign, task.number)), bits(&task.parameters));
        let started = events.iter().position(|e| *e == Event::Started { number: task.number });
        let end = Event::Ended { number: task.number, failed: None };
        assert!(started.unwrap() < events.iter().position(|e| *e == end).unwrap());
    }
    // Nothing stays of runs that went well, and a second call runs nothing.
    assert_eq!(fs::read_dir(campaign.dir().join("work")).unwrap().count(), 0);
    assert_eq!(run(&campaign, &tasks), []);
}

#[test]
fn a_command_sees_its_file_of_parameters_its_seed_its_environment_and_no_input() {
    let sandbox = Sandbox::new();
    let file = sandbox.file("seen");
    let mut command = shell(&format!(
        "{{{{ pwd; cat {{parameters}}; echo {{seed}} {{run}} '{{{{}}}}' $VALUE $PARENT; cat; }}}} > {}; {ECHO}",
        file.display()
    ));
    command.call.environment.insert("VALUE".into(), "b={b}".into());
    let spec = spec(command);
    let campaign = create(&sandbox.dir(), &spec);
    run(&campaign, &[task(7)]);
    let seen = fs::read_to_string(file).unwrap();
    let (folder, rest) = seen.split_once('\n').unwrap();
    assert!(folder.ends_with("campaign/work/000007/attempt-1"), "{folder}");
    let (json, rest) =
        rest.split_at(rest.rfind('}').map(|_| rest.find("\n}\n").unwrap() + 3).unwrap());
    let parameters: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(parameters["parameters"]["a"].as_f64(), Some(task(7).parameters[0]));
    assert_eq!(parameters["run"].as_u64(), Some(7));
    assert_eq!(parameters["seed"].as_u64(), Some(spec.seed_of(7)));
    assert_eq!(rest, format!("{} 7 {{}} b={:e}\n", spec.seed_of(7), task(7).parameters[1]));
}

#[test]
fn observables_come_from_their_own_files_and_formats() {
    let sandbox = Sandbox::new();
    let mut command = shell(
        "printf '# t x\\n0 0\\n1 10\\n' > curve.dat; printf '{{\"t\": [1, 2], \"q\": [3, 4]}}' > q.json",
    );
    let output = |file: &str, format, value: &str, at: &[f64], interpolate| OutputSpec {
        result: ResultSpec {
            file: file.into(),
            format,
            control: Some("t".into()),
            value: value.into(),
            interpolate,
        },
        at: at.to_vec(),
    };
    command.outputs = vec![
        output("curve.dat", Format::Whitespace, "x", &[0.25, 0.5, 1.0], Interpolation::Linear),
        output("q.json", Format::Json, "q", &[2.0], Interpolation::Refuse),
    ];
    let campaign = create(&sandbox.dir(), &spec(command));
    run(&campaign, &[task(1)]);
    assert_eq!(values(&campaign, 1), [2.5, 5.0, 10.0, 4.0]);
}

#[test]
fn a_deterministic_failure_is_not_tried_again_and_each_has_its_words() {
    let cases = [
        ("echo to out; echo to err >&2; exit 3", "exit code 3"),
        ("kill -SEGV $$", "crashed with signal 11 (SIGSEGV)"),
        ("true", "no file out.csv"),
        ("printf 'y\\n1\\n' > out.csv", "out.csv has no column x"),
        ("printf 'x\\nnan\\n' > out.csv", "x in out.csv is not a number"),
        ("printf 'x\\none\\n' > out.csv", "out.csv is not a table as described"),
        ("printf 'x\\n1\\n2\\n' > out.csv", "x in out.csv has no row at an observation point"),
    ];
    for (script, words) in cases {
        let sandbox = Sandbox::new();
        let log = sandbox.file("log");
        let script = format!("echo {{run}} >> {}; {script}", log.display());
        let campaign = create(&sandbox.dir(), &spec(shell(&script)));
        let events = run(&campaign, &[task(4)]);
        let (kind, detail, attempts) = failure(&campaign, 4);
        assert_eq!((kind.to_string().as_str(), attempts), (words, 1), "{script}");
        assert_eq!(sandbox.lines("log").len(), 1, "{script}");
        assert_eq!(events.last(), Some(&Event::Ended { number: 4, failed: Some(kind) }));
        // The working directory of a failed run stays.
        let folder = campaign.dir().join("work/000004/attempt-1");
        assert!(folder.join("parameters.json").exists() && !folder.join("process.json").exists());
        if words == "exit code 3" {
            assert_eq!(detail, "to err");
            assert_eq!(fs::read_to_string(folder.join("stdout")).unwrap(), "to out\n");
            assert_eq!(fs::read_to_string(folder.join("stderr")).unwrap(), "to err\n");
        }
    }
}

#[test]
fn a_lost_run_is_tried_again_up_to_the_limit() {
    let sandbox = Sandbox::new();
    let count = sandbox.file("count");
    let counting = format!("echo x >> {0}; n=$(wc -l < {0});", count.display());
    let mut command = shell(&format!("{counting} if [ $n -lt 3 ]; then kill -KILL $$; fi; {ECHO}"));
    command.call.retries = 2;
    let campaign = create(&sandbox.dir(), &spec(command));
    let events = run(&campaign, &[task(1)]);
    assert_eq!(values(&campaign, 1), [task(1).parameters[0]]);
    assert_eq!(campaign.outcome(1).unwrap().attempts(), 3);
    let retried = events.iter().filter(|e| matches!(e, Event::Retried { number: 1, .. })).count();
    assert_eq!(retried, 2);

    // Once too often; a shell that says of its child that it was killed counts as killed.
    for (script, signal) in [("kill -TERM $$", 15), ("exit 137", 9)] {
        let sandbox = Sandbox::new();
        let log = sandbox.file("log");
        let mut command = shell(&format!("echo x >> {}; {script}", log.display()));
        command.call.retries = 1;
        let mut spec = spec(command);
        let mut campaign = create(&sandbox.dir(), &spec);
        let error = fails(&campaign, &[task(1)]);
        let right = matches!(&error, ExecutorError::Lost { numbers, .. } if numbers == &[1]);
        assert!(right && error.to_string().contains("run 1 was lost"), "{error}");
        assert_eq!((sandbox.lines("log").len(), campaign.outcome(1)), (2, None));
        // Where parameters decide on it, as by memory, it may count as failed.
        spec.commands[0].call.lost = LostRuns::Fail;
        campaign.set_limits(&spec).unwrap();
        run(&campaign, &[task(1)]);
        let (kind, _, attempts) = failure(&campaign, 1);
        assert_eq!((kind, attempts), (FailureKind::Lost { signal: Some(signal) }, 2));
    }
}

#[test]
fn a_timeout_is_a_failure_and_ends_grandchildren() {
    let sandbox = Sandbox::new();
    let file = sandbox.file("pid");
    let mut command = shell(&format!("sleep 300 & echo $! > {}; wait", file.display()));
    command.call.timeout_s = 0.3;
    let campaign = create(&sandbox.dir(), &spec(command));
    let start = Instant::now();
    run(&campaign, &[task(1)]);
    assert!(start.elapsed() < Duration::from_secs(10));
    let (kind, _, attempts) = failure(&campaign, 1);
    assert_eq!((kind.to_string().as_str(), attempts), ("timeout: not finished after 0.3 s", 1));
    let pid = sandbox.lines("pid")[0].parse().unwrap();
    assert!(is_gone(pid));
}

/// A script whose run starts a daemon, in a session of its own, that writes its number to a file.
fn daemon(file: &std::path::Path, rest: &str) -> String {
    let leaves = format!("setsid sh -c 'echo $$ >> {}; sleep 300' &", file.display());
    format!("{leaves} while [ ! -s {} ]; do sleep 0.01; done; {rest}", file.display())
}

#[test]
fn a_process_that_leaves_its_session_is_ended_after_its_run() {
    if !cfg!(target_os = "linux") {
        return;
    }
    // Also one that has nothing of its environment left, at the end of all runs.
    for (bare, rest) in [(false, ECHO), (false, "exit 3"), (false, "sleep 300"), (true, ECHO)] {
        let sandbox = Sandbox::new();
        let file = sandbox.file("pids");
        let mut script = daemon(&file, rest);
        if bare {
            script = script.replace("setsid sh", "env -i setsid sh");
        }
        let mut command = shell(&script);
        command.call.timeout_s = if rest == "sleep 300" { 0.5 } else { 60.0 };
        let campaign = create(&sandbox.dir(), &spec(command));
        run(&campaign, &tasks(1));
        let pids = sandbox.lines("pids");
        assert_eq!(pids.len(), 1, "{script}");
        let there = std::path::Path::new("/proc").join(&pids[0]).exists();
        assert!(!there, "the daemon is there, or a zombie, after {rest:?}");
    }
}

#[test]
fn what_is_written_to_stdout_without_end_is_bounded_while_it_is_written() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("sizes");
    let script = format!(
        "for i in 1 2 3 4 5 6 7 8; do head -c 16000000 /dev/zero | tr '\\0' y; sleep 0.2; \
         stat -c %s stdout >> {}; done; echo end; exit 3",
        log.display()
    );
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    run(&campaign, &tasks(1));
    let sizes: Vec<u64> = sandbox.lines("sizes").iter().map(|size| size.parse().unwrap()).collect();
    assert!(sizes.len() == 8 && sizes.iter().all(|size| *size <= 33_000_000), "{sizes:?}");
    let stdout = fs::read_to_string(campaign.dir().join("work/000000/attempt-1/stdout")).unwrap();
    assert!(stdout.len() < 400_000 && stdout.ends_with("y\nend\n") | stdout.ends_with("yend\n"));
    assert!(stdout.contains("bytes left out"), "a note says so");
}

#[test]
fn keep_says_which_working_directories_stay() {
    for (keep, stays) in [
        (Keep::Failed, vec!["000001"]),
        (Keep::All, vec!["000000", "000001"]),
        (Keep::None, vec![]),
    ] {
        let sandbox = Sandbox::new();
        let mut command = shell(&format!("if [ $3 = 1 ]; then exit 1; fi; {ECHO}"));
        command.call.keep = keep;
        let campaign = create(&sandbox.dir(), &spec(command));
        run(&campaign, &tasks(2));
        let entries = fs::read_dir(campaign.dir().join("work")).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        assert_eq!(names, stays, "{keep:?}");
    }
}

#[test]
fn a_program_that_is_not_there_is_no_outcome_and_can_be_mended() {
    let sandbox = Sandbox::new();
    let program = sandbox.file("program");
    let mut command = shell("");
    command.call.argv = vec![program.to_str().unwrap().into(), "{a}".into()];
    let campaign = create(&sandbox.dir(), &spec(command));
    let mut local = Local::new(2);
    let error = local.run(&campaign, &tasks(4), &mut |_| (), &Stop::new()).unwrap_err();
    assert!(matches!(error, ExecutorError::CannotStart { .. }), "{error}");
    assert!(error.to_string().contains("there is no such program"), "{error}");
    assert_eq!(campaign.missing(&tasks(4)).len(), 4);
    fs::write(&program, format!("#!/bin/sh\n{ECHO}\n")).unwrap();
    let error = local.run(&campaign, &tasks(4), &mut |_| (), &Stop::new()).unwrap_err();
    assert!(error.to_string().contains("not executable"), "{error}");
    use std::os::unix::fs::PermissionsExt as _;
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    run(&campaign, &tasks(4));
    assert_eq!(values(&campaign, 3), [task(3).parameters[0]]);
}

#[test]
fn cancel_ends_the_runs_at_once_and_keeps_what_had_finished() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("pids");
    let waits = sandbox.file("go");
    let script = format!(
        "if [ $3 -ge 3 ] && [ ! -e {1} ]; then echo $$ >> {0}; sleep 300; fi; {ECHO}",
        log.display(),
        waits.display()
    );
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    let stop = Stop::new();
    let mut started = 0;
    let mut asked = Instant::now();
    let mut watch = |event| {
        started += usize::from(matches!(event, Event::Started { .. }));
        if started == 5 {
            started += 1;
            std::thread::sleep(Duration::from_millis(300));
            asked = Instant::now();
            stop.cancel();
        }
    };
    let result = Local::new(2).run(&campaign, &tasks(8), &mut watch, &stop);
    assert!(matches!(result, Err(ExecutorError::Interrupted { detached: false })), "{result:?}");
    assert!(asked.elapsed() < Duration::from_secs(3), "{:?}", asked.elapsed());
    let missing = campaign.missing(&tasks(8));
    assert_eq!(missing.iter().map(|task| task.number).collect::<Vec<_>>(), [3, 4, 5, 6, 7]);
    for pid in sandbox.lines("pids") {
        assert!(is_gone(pid.parse().unwrap()));
    }
    assert_eq!(fs::read_dir(campaign.dir().join("work")).unwrap().count(), 0);
    fs::write(waits, "").unwrap();
    run(&campaign, &tasks(8));
    for number in 0..8 {
        assert_eq!(values(&campaign, number), [task(number).parameters[0]]);
    }
}

#[test]
fn no_more_runs_than_allowed_at_the_same_time() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("log");
    let script = format!("echo + >> {0}; sleep 0.1; echo - >> {0}; {ECHO}", log.display());
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    Local::new(3).run(&campaign, &tasks(12), &mut |_| (), &Stop::new()).unwrap();
    let (mut now, mut most) = (0, 0);
    for line in sandbox.lines("log") {
        now += if line == "+" { 1 } else { -1 };
        most = most.max(now);
    }
    assert_eq!((now, most), (0, 3));
}
