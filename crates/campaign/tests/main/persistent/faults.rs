//! What a worker may do wrong, and what that costs.

use std::fs;

use campaign::{Executor, ExecutorError, FailureKind, Local, Outcome, Stop, TryLater};

use super::{all_are_right, pids, retried, worker};
use crate::sandbox::{Sandbox, bits, create, fails, is_gone, run, spec, task, tasks, values};

/// What a worker may do wrong, once: `fault` in the shell of [`worker`].
fn costs_one_attempt(fault: &str, timeout_s: f64) {
    let sandbox = Sandbox::new();
    let mut command = worker(&sandbox, &format!("if [ $run = 3 ] && once; then {fault}; fi"));
    command.call.timeout_s = timeout_s;
    let campaign = create(&sandbox.dir(), &spec(command));
    let mut events = Vec::new();
    let mut local = Local::new(1);
    local.run(&campaign, &tasks(6), &mut |event| events.push(event), &Stop::new()).unwrap();
    all_are_right(&campaign, 6);
    assert_eq!(retried(&events), 1, "{fault}: {events:?}");
    for number in 0..6 {
        let attempts = campaign.outcome(number).unwrap().attempts();
        assert_eq!(attempts, if number == 3 { 2 } else { 1 }, "{fault}: run {number}");
    }
    let started = pids(&sandbox, "starts");
    assert_eq!(started.len(), 2, "{fault}: it was restarted once");
    assert!(is_gone(started[0]), "{fault}");
}

#[test]
fn a_worker_that_crashes_costs_the_attempt_and_is_started_again() {
    for fault in ["kill -SEGV $$", "kill -KILL $$", "exit 3", "exit 137"] {
        costs_one_attempt(fault, 60.0);
    }
}

#[test]
fn a_worker_that_ends_without_an_answer_costs_the_attempt_and_is_started_again() {
    for fault in ["exit 0", "exec >&-; sleep 300"] {
        costs_one_attempt(fault, 60.0);
    }
}

#[test]
fn a_worker_that_hangs_or_answers_too_late_costs_the_attempt_and_is_started_again() {
    for fault in ["sleep 300", "trap '' TERM; sleep 1.5"] {
        costs_one_attempt(fault, 1.0);
    }
}

#[test]
fn a_worker_that_talks_nonsense_costs_the_attempt_and_is_started_again() {
    for fault in ["echo nonsense", "echo", "echo '{{}}'", "printf '\\377\\n'"] {
        costs_one_attempt(fault, 60.0);
    }
}

#[test]
fn a_line_without_its_end_costs_the_attempt_and_is_never_a_value() {
    let line = r#"printf '{{"id": %s, "values": {{"x": [1, 2]}}' $id"#;
    for end in ["exit 0", "kill -KILL $$", "exit 3", "exec >&-; sleep 300"] {
        costs_one_attempt(&format!("{line}; {end}"), 60.0);
    }
}

#[test]
fn an_answer_to_another_request_costs_the_attempt_and_is_never_a_value() {
    costs_one_attempt("id=$((id - 1))", 60.0);
    // Two answers to one request: the second is none to the next.
    let sandbox = Sandbox::new();
    let twice = r#"if [ $run = 3 ] && once; then echo "{{\"id\": $id, \"values\": {{\"x\": [1, 2]}}}}"; fi"#;
    let twice = twice.replace("[1, 2]", "[$a, $b]");
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, &twice)));
    Local::new(1).run(&campaign, &tasks(6), &mut |_| (), &Stop::new()).unwrap();
    all_are_right(&campaign, 6);
    assert_eq!(campaign.outcome(4).unwrap().attempts(), 2);
}

#[test]
fn an_answer_without_end_costs_the_attempt_and_no_memory() {
    costs_one_attempt("head -c 70000000 /dev/zero | tr '\\0' y", 60.0);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_fault_that_comes_again_by_a_new_worker_is_the_runs_own_failure() {
    let cases = [
        ("exit 3", "exit code 3"),
        ("kill -SEGV $$", "crashed with signal 11 (SIGSEGV)"),
        ("sleep 300", "timeout: not finished after 1 s"),
        ("echo nonsense", "the worker's answer: not JSON"),
        ("exit 0", "the worker's answer: none before its end"),
        ("printf '{{'; exit 0", "the worker's answer: cut off"),
        ("id=0", "the worker's answer: to another request"),
        ("a=null", "x in answer.json is not a number"),
        ("a=1,2", "x in answer.json has no row at an observation point"),
        ("a=\\\"1\\\"", "answer.json is not a table as described"),
    ];
    for (fault, words) in cases {
        let sandbox = Sandbox::new();
        let fault = format!("if [ $run = 3 ]; then echo said >&2; {fault}; fi");
        let mut command = worker(&sandbox, &fault);
        command.call.timeout_s = 1.0;
        let campaign = create(&sandbox.dir(), &spec(command));
        Local::new(1).run(&campaign, &tasks(5), &mut |_| (), &Stop::new()).unwrap();
        let Some(Outcome::Failed { kind, detail, attempts, .. }) = campaign.outcome(3) else {
            panic!("{fault} must fail");
        };
        assert_eq!(kind.to_string(), words, "{fault}");
        // A well-formed answer is the run's own at once.
        let answered = words.contains("answer.json");
        assert_eq!(attempts, if answered { 1 } else { 2 }, "{fault}");
        assert!(answered || detail.contains("said"), "{fault}: {detail}");
        for number in [0, 1, 2, 4] {
            assert_eq!(bits(&values(&campaign, number)), bits(&task(number).parameters));
        }
        // By a worker that has made no other run, there is nothing else to blame.
        if words == "exit code 3" {
            run(&campaign, &[task(9)]);
            let sandbox = Sandbox::new();
            let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, "exit 3")));
            run(&campaign, &[task(3)]);
            assert_eq!(campaign.outcome(3).unwrap().attempts(), 1);
        }
    }
}

#[test]
fn a_failure_that_a_worker_tells_is_that_of_a_command_and_the_worker_stays() {
    let tells = |code: &str| {
        format!(
            r#"if [ $run = 2 ] && [ ! -e mended ]; then echo "{{{{\"id\": $id, \"failure\": {{{{\"code\": {code}, \"message\": \"it diverged\"}}}}}}}}"; continue; fi"#
        )
    };
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, &tells("3"))));
    Local::new(1).run(&campaign, &tasks(4), &mut |_| (), &Stop::new()).unwrap();
    let Some(Outcome::Failed { kind, detail, attempts, .. }) = campaign.outcome(2) else {
        panic!("it failed");
    };
    assert_eq!((kind, &*detail, attempts), (FailureKind::ExitCode { code: 3 }, "it diverged", 1));
    assert_eq!(pids(&sandbox, "starts").len(), 1);
    // Its folder stays, with what it said.
    let stderr = campaign.dir().join("work/000002/attempt-1/stderr");
    assert_eq!(fs::read_to_string(stderr).unwrap(), "it diverged\n");

    // "Try again later", with pauses, then a stop without an outcome; and from there on.
    let sandbox = Sandbox::new();
    let mut command = worker(&sandbox, &tells("75"));
    command.call.try_later = TryLater { pause_s: 0.05, retries: 3, ..TryLater::default() };
    let campaign = create(&sandbox.dir(), &spec(command));
    let error = fails(&campaign, &[task(2)]);
    assert!(matches!(&error, ExecutorError::NotNow { attempts: 4, .. }), "{error}");
    assert!(error.to_string().contains("it diverged"), "{error}");
    assert_eq!((pids(&sandbox, "starts").len(), campaign.outcome(2)), (1, None));
    fs::write(sandbox.file("mended"), "").unwrap();
    run(&campaign, &[task(2)]);
    assert_eq!(bits(&values(&campaign, 2)), bits(&task(2).parameters));

    // Lost, as a shell says it of a child that was killed.
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, &tells("137"))));
    let error = fails(&campaign, &[task(2)]);
    assert!(matches!(&error, ExecutorError::Lost { .. }), "{error}");
}

#[test]
fn an_outage_of_a_worker_stops_the_driver_as_that_of_a_command() {
    let sandbox = Sandbox::new();
    let down = r#"if [ -e down ]; then echo "{{\"id\": $id, \"failure\": {{\"code\": 3, \"message\": \"license server down\"}}}}"; continue; fi"#;
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, down)));
    fs::write(sandbox.file("down"), "").unwrap();
    let error = fails(&campaign, &tasks(40));
    assert!(matches!(&error, ExecutorError::Outage { .. }), "{error}");
    assert!(error.to_string().contains("license server down"), "{error}");
    fs::remove_file(sandbox.file("down")).unwrap();
    campaign.forget_failed(&|_| true).unwrap();
    run(&campaign, &tasks(40));
    all_are_right(&campaign, 40);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_worker_that_does_not_get_ready_stops_the_driver_without_an_outcome() {
    let sandbox = Sandbox::new();
    let ready = worker(&sandbox, ":");
    let spec = |script: &str| {
        let mut command = ready.clone();
        let script = format!("if [ ! -e $0/mended ]; then {script}; fi; {}", command.call.argv[2]);
        (command.call.argv[2], command.call.timeout_s) = (script, 1.0);
        command.call.try_later = TryLater { pause_s: 0.01, retries: 2, ..TryLater::default() };
        spec(command)
    };
    for (script, words) in [
        ("echo no module >&2; exit 1", vec!["ready as a worker: exit code 1", "no module"]),
        ("exit 0", vec!["without a first line"]),
        ("sleep 300", vec!["not finished after 1 s"]),
        ("echo Loading; sleep 300", vec!["\"Loading\"", "stderr"]),
        ("echo '{{\"protocol\": 2}}'; sleep 300", vec!["version 2"]),
        ("exit 75", vec!["asked 3 times to be called later"]),
        ("kill -KILL $$", vec!["lost more often"]),
    ] {
        let sandbox = Sandbox::new();
        let campaign = create(&sandbox.dir(), &spec(script));
        let error = fails(&campaign, &tasks(3)).to_string();
        assert!(words.iter().all(|words| error.contains(words)), "{script}: {error}");
        assert!((0..3).all(|number| campaign.outcome(number).is_none()), "{script}");
    }
    let campaign = create(&sandbox.dir(), &spec("exit 1"));
    fails(&campaign, &tasks(3));
    fs::write(sandbox.file("mended"), "").unwrap();
    run(&campaign, &tasks(3));
    all_are_right(&campaign, 3);
    let mut gone = worker(&sandbox, ":");
    gone.call.argv[0] = "no-such-program".into();
    let campaign = create(&sandbox.file("gone"), &crate::sandbox::spec(gone));
    let error = fails(&campaign, &tasks(1)).to_string();
    assert!(error.contains("there is no such program"), "{error}");
}

#[test]
fn a_run_that_the_worker_before_may_have_broken_is_made_again_by_a_new_one() {
    let sandbox = Sandbox::new();
    // It breaks at run 9 where it has made another one before; two such are there.
    let fault = "n=$((${{n:-0}} + 1)); if [ $run = 9 ] && [ $n -gt 1 ]; then exit 3; fi; sleep 0.2";
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, fault)));
    let mut local = Local::new(2);
    local.run(&campaign, &tasks(6), &mut |_| (), &Stop::new()).unwrap();
    assert_eq!(pids(&sandbox, "starts").len(), 2);
    local.run(&campaign, &[task(9)], &mut |_| (), &Stop::new()).unwrap();
    assert_eq!(bits(&values(&campaign, 9)), bits(&task(9).parameters));
    assert_eq!(campaign.outcome(9).unwrap().attempts(), 2);
    assert_eq!(pids(&sandbox, "starts").len(), 3);
}
