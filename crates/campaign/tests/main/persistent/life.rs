//! How workers begin and end, what they see, and what is kept of them.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use campaign::inputs::{InputFile, Put};
use campaign::slurm::{Slurm, SlurmSettings};
use campaign::{
    ANSWER, Campaign, Event, Executor, ExecutorError, Keep, Local, Stop, Worker, ask_worker,
};

use super::{all_are_right, pids, retried, worker};
use crate::sandbox::{
    Sandbox, bits, create, fails, is_gone, rows, run, running_driver, shell, spec, tasks, values,
};

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
        let left =
            |folder: &str| fs::read_dir(campaign.dir().join(folder)).map_or(0, Iterator::count);
        assert_eq!((left("work"), left("workers")), (0, 0), "nothing stays");
    }
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
    assert_eq!(
        (stderr(0), stderr(1), stderr(3)),
        ("run 0\n".into(), "run 1\n".into(), "run 3\n".into())
    );
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
    let children =
        "sleep 300 & echo $! >> children; setsid sh -c 'echo $$ >> children; exec sleep 300' &";
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
#[ignore = "long: run by .ci/run"]
fn a_worker_that_does_not_obey_is_ended_too() {
    let sandbox = Sandbox::new();
    // It ignores the end of its input and the request to end.
    let mut command = worker(&sandbox, ":");
    command.call.argv[2] =
        format!("trap '' TERM; {}; while :; do sleep 1; done", command.call.argv[2]);
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
    let mut driver = running_driver(&sandbox, "children");
    driver.kill().unwrap();
    driver.wait().unwrap();
    let left: Vec<i32> = [pids(&sandbox, "starts"), pids(&sandbox, "children")].concat();
    assert!(left.len() >= 4, "{left:?}");
    fs::write(sandbox.file("go"), "").unwrap();
    let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
    let events = run(&campaign, &tasks(10));
    assert!(
        matches!(&events[0], Event::Note(note) if note.contains("killed driver")),
        "{events:?}"
    );
    assert!(left.into_iter().all(is_gone));
    all_are_right(&campaign, 10);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn workers_of_a_killed_driver_end_when_their_time_is_over() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let sandbox = Sandbox::new();
    // It does not see that its stdin has ended.
    let mut command = worker(&sandbox, "while :; do sleep 1; done");
    command.call.timeout_s = 3.0;
    drop(create(&sandbox.dir(), &spec(command)));
    let mut driver = running_driver(&sandbox, "requests");
    driver.kill().unwrap();
    driver.wait().unwrap();
    let left = pids(&sandbox, "starts");
    assert_eq!(left.len(), 2);
    std::thread::sleep(Duration::from_secs(3));
    assert!(left.into_iter().all(is_gone), "nobody resumed, and they run on");
}

#[test]
fn a_worker_may_write_files_to_the_folder_of_the_run_and_several_have_their_own() {
    let sandbox = Sandbox::new();
    // Its input file is filled in for each run.
    let mut by_file = worker(&sandbox, "cp \"$folder/in.txt\" \"$folder/out.csv\"");
    fs::write(sandbox.file("in.txt"), "x\n{{a}}\n{{b}}\n").unwrap();
    let from = sandbox.file("in.txt").display().to_string();
    by_file.call.files = vec![InputFile { from, to: "in.txt".into(), by: Put::Fill }];
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
    let mut slurm = Slurm::new(SlurmSettings::default(), vec!["program".into()]).unwrap();
    let whole = slurm.run(&campaign, &tasks(1), &mut |_| (), &Stop::new()).unwrap_err();
    for error in [error, whole.to_string()] {
        assert!(error.contains("the worker of worker is only kept by local processes"), "{error}");
    }
    let from = "/etc/hostname".to_owned();
    let answer = InputFile { from, to: ANSWER.into(), by: Put::Link };
    let mut wrong = spec.clone();
    wrong.commands[0].outputs = vec![rows("out.csv", "x", 2)];
    wrong.commands[0].call.files.push(answer);
    let error = wrong.check().unwrap_err();
    assert_eq!(error.field, "commands[0].call.files[0]", "an answer would go through the link");
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
