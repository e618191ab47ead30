//! Workers: programs that stay and are asked for one run after the other.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use campaign::{
    ANSWER, Call, Campaign, CommandSpec, Event, Executor, ExecutorError, FailureKind, Format,
    Keep, Local, Outcome, OutputSpec, ResultSpec, Stop, TryLater, Worker, ask_worker,
};

use crate::sandbox::{
    Sandbox, bits, create, fails, is_gone, rows, run, shell, spec, task, tasks,
    this_program, values,
};

/// A worker in a shell: `fault` is done before an answer to a request, of which $id, $run, $a, $b and $folder are known.
/// Its starts and requests are lines of files beside the campaign.
fn worker(sandbox: &Sandbox, fault: &str) -> CommandSpec {
    let script = format!(
        r#"cd "$0"; echo $$ >> starts
get() {{{{ echo "$line" | sed "s/.*\"$1\":\"*\([^,\"}}}}]*\).*/\1/"; }}}}
once() {{{{ if [ -e "once-$run" ]; then return 1; fi; touch "once-$run"; }}}}
read -r line; echo '{{{{"protocol": 1}}}}'
while read -r line; do
  id=$(get id); run=$(get run); a=$(get a); b=$(get b); folder=$(get folder); echo $run >> requests
  {fault}
  echo "{{{{\"id\": $id, \"values\": {{{{\"x\": [$a, $b]}}}}}}}}"
done"#
    );
    let dir = sandbox.file("").display().to_string();
    let argv = vec!["sh".to_owned(), "-c".to_owned(), script, dir];
    let call = Call { worker: true, timeout_s: 60.0, ..Call::new(argv) };
    let OutputSpec { result, at } = rows(ANSWER, "x", 2);
    let outputs = vec![OutputSpec { result: ResultSpec { format: Format::Json, ..result }, at }];
    CommandSpec { name: "worker".into(), call, outputs }
}

fn pids(sandbox: &Sandbox, file: &str) -> Vec<i32> {
    sandbox.lines(file).iter().map(|pid| pid.parse().unwrap()).collect()
}

#[track_caller]
fn all_are_right(campaign: &Campaign, count: u64) {
    for task in tasks(count) {
        assert_eq!(bits(&values(campaign, task.number)), bits(&task.parameters));
    }
}

fn retried(events: &[Event]) -> usize {
    events.iter().filter(|event| matches!(event, Event::Retried { .. })).count()
}

#[test]
fn a_worker_gives_the_bits_of_the_command_for_any_number_of_slots_and_stays() {
    let sandbox = Sandbox::new();
    let mut command = shell("printf 'x\\n%s\\n%s\\n' \"$1\" \"$2\" > out.csv");
    command.outputs = vec![rows("out.csv", "x", 2)];
    let by_command = create(&sandbox.file("command"), &spec(command));
    run(&by_command, &tasks(30));
    for slots in [1, 3] {
        let sandbox = Sandbox::new();
        let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, ":")));
        let mut local = Local::new(slots);
        // In batches, as the stages of a calibration.
        for last in [5, 20, 30] {
            local.run(&campaign, &tasks(last), &mut |_| (), &Stop::new()).unwrap();
        }
        for number in 0..30 {
            let both = [values(&campaign, number), values(&by_command, number)];
            assert_eq!(bits(&both[0]), bits(&both[1]), "run {number}");
        }
        let started = pids(&sandbox, "starts");
        assert!(!started.is_empty() && started.len() <= slots, "{started:?}");
        assert_eq!(sandbox.lines("requests").len(), 30);
        let alive = |pid: &i32| Path::new(&format!("/proc/{pid}")).exists();
        assert!(!cfg!(target_os = "linux") || started.iter().all(alive), "they stay");
        drop(local);
        assert!(started.into_iter().all(is_gone), "they end with their executor");
        let left = |folder: &str| fs::read_dir(campaign.dir().join(folder)).map_or(0, Iterator::count);
        assert_eq!((left("work"), left("workers")), (0, 0), "nothing stays");
    }
}

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
fn a_worker_that_ended_while_it_was_idle_costs_nothing() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, ":")));
    let mut local = Local::new(1);
    local.run(&campaign, &tasks(3), &mut |_| (), &Stop::new()).unwrap();
    let pid = rustix::process::Pid::from_raw(pids(&sandbox, "starts")[0]).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
    std::thread::sleep(Duration::from_millis(100));
    let mut events = Vec::new();
    local.run(&campaign, &tasks(6), &mut |event| events.push(event), &Stop::new()).unwrap();
    all_are_right(&campaign, 6);
    assert_eq!(retried(&events), 0, "{events:?}");
}

#[test]
fn a_fault_that_comes_again_by_a_new_worker_is_the_runs_own_failure() {
    let cases = [
        ("exit 3", "exit code 3"),
        ("kill -SEGV $$", "crashed with signal 11 (SIGSEGV)"),
        ("sleep 300", "not finished after 1 s"),
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
fn stderr_of_a_worker_is_kept_run_by_run_and_bounded_while_it_is_written() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("sizes");
    let fault = format!(
        "echo run $run >&2; if [ $run = 2 ]; then for i in 1 2 3 4; do head -c 16000000 /dev/zero | tr '\\0' y >&2; \
         sleep 0.2; stat -c %s campaign/workers/*/stderr >> {}; done; echo end >&2; fi",
        log.display()
    );
    let mut command = worker(&sandbox, &fault);
    command.call.keep = Keep::All;
    let campaign = create(&sandbox.dir(), &spec(command));
    Local::new(1).run(&campaign, &tasks(4), &mut |_| (), &Stop::new()).unwrap();
    all_are_right(&campaign, 4);
    let stderr = |number: u64| {
        let folder = campaign.dir().join(format!("work/00000{number}/attempt-1"));
        fs::read_to_string(folder.join("stderr")).unwrap()
    };
    assert_eq!((stderr(0), stderr(1), stderr(3)), ("run 0\n".into(), "run 1\n".into(), "run 3\n".into()));
    let long = stderr(2);
    let (start, end) = (&long[..20], &long[long.len() - 20..]);
    let right = start.starts_with("run 2\nyyy") && end.ends_with("yend\n");
    assert!(right && long.len() < 400_000, "{start:?} .. {end:?}, {} bytes", long.len());
    assert!(long.contains("bytes left out"), "a note says so");
    let sizes: Vec<u64> = sandbox.lines("sizes").iter().map(|size| size.parse().unwrap()).collect();
    assert!(sizes.len() == 4 && sizes.iter().all(|size| *size <= 33_000_000), "{sizes:?}");
}

#[test]
fn a_worker_ends_with_all_that_it_has_started() {
    let children = "sleep 300 & echo $! >> children; setsid sh -c 'echo $$ >> children; exec sleep 300' &";
    for fault in [":", "exit 3"] {
        let sandbox = Sandbox::new();
        let fault = format!("if [ $run = 1 ]; then {children} sleep 0.2; {fault}; fi");
        let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, &fault)));
        run(&campaign, &tasks(3));
        let children = pids(&sandbox, "children");
        assert!(children.len() >= 2, "{children:?}");
        for pid in children.into_iter().chain(pids(&sandbox, "starts")) {
            assert!(is_gone(pid), "{fault}: {pid} is there");
        }
    }
}

#[test]
fn a_worker_that_does_not_obey_is_ended_too() {
    let sandbox = Sandbox::new();
    // It ignores the end of its input and the request to end.
    let mut command = worker(&sandbox, ":");
    command.call.argv[2] = format!("trap '' TERM; {}; while :; do sleep 1; done", command.call.argv[2]);
    let campaign = create(&sandbox.dir(), &spec(command));
    let begun = Instant::now();
    run(&campaign, &tasks(3));
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    assert!(pids(&sandbox, "starts").into_iter().all(is_gone));
}

#[test]
fn a_worker_that_reads_nothing_is_given_up_when_its_time_is_over() {
    let sandbox = Sandbox::new();
    let mut command = worker(&sandbox, ":");
    // A first line that no pipe takes, to a program that does not read.
    command.outputs[0].at = (0..100_000).map(f64::from).collect();
    command.call.argv[2] = "sleep 300".into();
    command.call.timeout_s = 0.5;
    let campaign = create(&sandbox.dir(), &spec(command));
    let error = fails(&campaign, &tasks(1)).to_string();
    assert!(error.contains("not finished after 0.5 s"), "{error}");
}

#[test]
fn a_stop_ends_workers_quickly_and_the_rest_is_made_later() {
    let sandbox = Sandbox::new();
    let fault = "if [ $run = 5 ] && [ ! -e go ]; then sleep 300; fi";
    let campaign = create(&sandbox.dir(), &spec(worker(&sandbox, fault)));
    let stop = Stop::new();
    let flag = stop.clone();
    let waits = sandbox.file("requests");
    let asks = std::thread::spawn(move || {
        while !fs::read_to_string(&waits).is_ok_and(|text| text.lines().any(|line| line == "5")) {
            std::thread::sleep(Duration::from_millis(10));
        }
        flag.cancel();
        Instant::now()
    });
    let mut local = Local::new(2);
    let error = local.run(&campaign, &tasks(8), &mut |_| (), &stop).unwrap_err();
    assert!(matches!(error, ExecutorError::Interrupted { detached: false }), "{error}");
    let asked = asks.join().unwrap();
    assert!(asked.elapsed() < Duration::from_secs(5), "{:?}", asked.elapsed());
    assert!(pids(&sandbox, "starts").into_iter().all(is_gone), "also those that were idle");
    assert!(campaign.outcome(5).is_none());
    fs::write(sandbox.file("go"), "").unwrap();
    run(&campaign, &tasks(8));
    all_are_right(&campaign, 8);
}

#[test]
fn workers_of_a_killed_driver_are_ended_and_the_runs_are_made() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let sandbox = Sandbox::new();
    let fault = "if [ ! -e go ]; then sh -c 'echo $$ >> children; sleep 300'; fi";
    let mut command = worker(&sandbox, fault);
    command.call.timeout_s = 300.0;
    drop(create(&sandbox.dir(), &spec(command)));
    let mut driver = this_program(&[], "kills::driver", &sandbox.dir());
    let mut driver = driver.stdout(std::process::Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while sandbox.lines("children").len() < 2 && begun.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(10));
    }
    driver.kill().unwrap();
    driver.wait().unwrap();
    let left: Vec<i32> =
        [pids(&sandbox, "starts"), pids(&sandbox, "children")].concat();
    assert!(left.len() >= 4, "{left:?}");
    fs::write(sandbox.file("go"), "").unwrap();
    let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
    let events = run(&campaign, &tasks(10));
    assert!(matches!(&events[0], Event::Note(note) if note.contains("killed driver")), "{events:?}");
    assert!(left.into_iter().all(is_gone));
    all_are_right(&campaign, 10);
}

#[test]
fn a_worker_may_write_files_to_the_folder_of_the_run_and_several_have_their_own() {
    let sandbox = Sandbox::new();
    let mut by_file = worker(&sandbox, "printf 'x\\n%s\\n%s\\n' $a $b > \"$folder/out.csv\"");
    by_file.outputs = vec![rows("out.csv", "x", 2)];
    let mut spec = spec(worker(&sandbox, ":"));
    spec.commands.push(by_file);
    let campaign = create(&sandbox.dir(), &spec);
    let mut tasks = tasks(12);
    for task in &mut tasks {
        task.command = (task.number % 2) as usize;
    }
    run(&campaign, &tasks);
    all_are_right(&campaign, 12);
    assert!(pids(&sandbox, "starts").len() <= 4, "two of each at most");
}

#[test]
fn a_worker_has_no_placeholders_and_is_not_run_on_a_cluster() {
    let sandbox = Sandbox::new();
    let mut spec = spec(worker(&sandbox, ":"));
    for argument in ["{a}", "{run}", "{seed}", "{parameters}"] {
        let mut wrong = spec.clone();
        wrong.commands[0].call.argv.push(argument.into());
        let error = wrong.check().unwrap_err();
        assert_eq!(error.field, "commands[0].call.argv[4]");
        assert!(error.problem.contains("with every request"), "{error}");
    }
    let campaign = create(&sandbox.dir(), &spec);
    campaign.record_submitted(&tasks(1)).unwrap();
    let element = Worker::open(campaign.dir()).unwrap();
    let error = element.run(0, &Stop::new()).unwrap_err().to_string();
    assert!(error.contains("the worker of worker is only kept by local processes"), "{error}");
    spec.commands[0].call.argv.clear();
    assert_eq!(spec.check().unwrap_err().field, "commands[0].call.worker");
}

#[test]
fn the_exchange_alone_gives_the_columns_of_each_answer() {
    let sandbox = Sandbox::new();
    let spec = spec(worker(&sandbox, ":"));
    let folder = tempfile::tempdir().unwrap();
    let answers = ask_worker(&spec, &tasks(5), folder.path()).unwrap();
    for (task, answer) in tasks(5).iter().zip(answers) {
        let x: Vec<f64> = serde_json::from_value(answer["x"].clone()).unwrap();
        assert_eq!(bits(&x), bits(&task.parameters));
    }
}
