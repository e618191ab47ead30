//! What is around a run fails, and not the run: outages, disks, copies of folders, locks that are gone.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use campaign::{Campaign, CampaignError, Event, ExecutorError, FailureKind};

use crate::sandbox::{
    Sandbox, create, fails, given_dir, is_gone, run, shell, spec, task, tasks, this_program, values,
};

const ECHO: &str = "printf 'x\\n%s\\n' \"$1\" > out.csv";

/// A script that fails as long as a file is there.
fn while_there(file: &Path, fault: &str) -> campaign::CommandSpec {
    shell(&format!("if [ -e {} ]; then {fault}; fi; {ECHO}", file.display()))
}

fn finished(campaign: &Campaign, numbers: u64) {
    for number in 0..numbers {
        assert_eq!(values(campaign, number), [task(number).parameters[0]], "run {number}");
    }
}

#[test]
fn a_server_that_is_down_for_a_while_costs_nothing_where_the_program_says_try_again_later() {
    let sandbox = Sandbox::new();
    let down = sandbox.file("down");
    fs::write(&down, "").unwrap();
    let mut command = while_there(&down, "echo 'license server down' >&2; exit 75");
    command.call.try_later.pause_s = 0.05;
    let campaign = create(&sandbox.dir(), &spec(command));
    let events = std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(400));
            fs::remove_file(&down).unwrap();
        });
        run(&campaign, &tasks(20))
    });
    finished(&campaign, 20);
    let code = FailureKind::ExitCode { code: 75 };
    assert!(events.iter().any(|e| matches!(e, Event::Retried { kind, .. } if *kind == code)));
    assert!(!events.iter().any(|e| matches!(e, Event::Ended { failed: Some(_), .. })));
}

#[test]
fn pauses_grow_and_end_with_a_stop_from_which_the_runs_are_made() {
    let sandbox = Sandbox::new();
    let (down, log) = (sandbox.file("down"), sandbox.file("log"));
    fs::write(&down, "").unwrap();
    let mut command =
        while_there(&down, &format!("date +%s%N >> {}; echo later >&2; exit 9", log.display()));
    command.call.try_later.exit_codes = vec![9];
    command.call.try_later.pause_s = 0.1;
    command.call.try_later.retries = 3;
    let campaign = create(&sandbox.dir(), &spec(command));
    let error = fails(&campaign, &tasks(1));
    let ExecutorError::NotNow { number: 0, attempts: 4, .. } = &error else { panic!("{error}") };
    assert!(error.to_string().contains("exit code 9; it said:\nlater"), "{error}");
    let times: Vec<f64> =
        sandbox.lines("log").iter().map(|time| time.parse::<f64>().unwrap() * 1e-9).collect();
    for (pair, least) in times.windows(2).zip([0.1, 0.2, 0.4]) {
        assert!(pair[1] - pair[0] >= least, "{times:?}");
    }
    assert_eq!(campaign.missing(&tasks(1)).len(), 1);
    fs::remove_file(down).unwrap();
    run(&campaign, &tasks(1));
    finished(&campaign, 1);
}

#[test]
fn an_outage_stops_the_driver_and_its_failures_can_be_given_up() {
    let sandbox = Sandbox::new();
    let down = sandbox.file("down");
    let campaign =
        create(&sandbox.dir(), &spec(while_there(&down, "echo 'license server down' >&2; exit 3")));
    run(&campaign, &tasks(10));
    fs::write(&down, "").unwrap();
    let error = fails(&campaign, &tasks(200));
    let ExecutorError::Outage { count, .. } = &error else { panic!("{error}") };
    assert!((12..=14).contains(count), "{count}");
    let words = format!("looks like an outage, {count} of the last {count}: exit code 3");
    assert!(error.to_string().starts_with(&words), "{error}");
    assert!(error.to_string().ends_with("license server down"), "{error}");
    let stopped = campaign.missing(&tasks(200)).len() as u64;
    // Runs that went on when it was noticed may have ended too before the driver stopped.
    assert!((176..=190 - count).contains(&stopped), "{stopped} {count}");
    drop(campaign);

    fs::remove_file(down).unwrap();
    let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
    let other =
        campaign.forget_failed(&|it| it.failure() == Some(&FailureKind::OutOfMemory)).unwrap();
    assert!(other.is_empty() && campaign.missing(&tasks(200)).len() as u64 == stopped);
    let again = campaign
        .forget_failed(&|it| it.failure() == Some(&FailureKind::ExitCode { code: 3 }))
        .unwrap();
    assert_eq!(again.len() as u64, *count);
    run(&campaign, &tasks(200));
    finished(&campaign, 200);
    assert_eq!(campaign.placed_again(), 0);
    drop(campaign);
    // What was given up is still there to be read, and does not come back.
    assert!(sandbox.dir().join("results.jsonl.retried-1").exists());
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert_eq!((damage, campaign.missing(&tasks(200))), (vec![], vec![]));
    finished(&campaign, 200);
}

#[test]
fn after_failures_are_given_up_tasks_may_be_placed_otherwise_and_what_fits_is_used() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("log");
    let script = format!("echo $3 >> {}; if [ $3 = 1 ]; then exit 3; fi; {ECHO}", log.display());
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    run(&campaign, &tasks(6));
    let mut moved = tasks(6);
    moved[5].parameters[0] = 7.0;
    assert!(matches!(
        campaign.record_submitted(&moved),
        Err(CampaignError::TaskDiffers { number: 5, .. })
    ));
    assert_eq!(campaign.forget_failed(&|_| true).unwrap(), [1]);
    campaign.record_submitted(&moved).unwrap();
    assert_eq!(campaign.placed_again(), 1);
    let missing: Vec<u64> = campaign.missing(&moved).iter().map(|task| task.number).collect();
    assert_eq!(missing, [1, 5], "run 5 has other parameters now, the others are used");
    run(&campaign, &moved);
    assert_eq!(values(&campaign, 5), [7.0]);
    assert_eq!(sandbox.lines("log").len(), 6 + 2);
}

#[test]
fn errors_of_the_disk_are_never_failures_of_the_run() {
    // Reading address 0 of one's own memory is an input/output error: EIO, as from a broken disk.
    let broken = [
        "ln -s /proc/self/mem out.csv; exit 0",
        "echo 'cannot write: No space left on device' >&2; exit 2",
        "echo 'OSError: [Errno 122] Disk quota exceeded' >&2; exit 0",
        "echo 'x: Stale file handle' >&2; kill -ABRT $$",
        // The disk was full while the run wrote: its last number lost digits, or all is gone.
        "printf 'x\\n0.12' > out.csv; exit 0",
        ": > out.csv; exit 0",
        "rm -r ../attempt-1; exit 0",
        "rm -r ../attempt-1; exit 3",
    ];
    for fault in broken {
        let sandbox = Sandbox::new();
        let once = sandbox.file("once");
        fs::write(&once, "").unwrap();
        let command = while_there(&once, &format!("rm {}; {fault}", once.display()));
        let campaign = create(&sandbox.dir(), &spec(command));
        let events = run(&campaign, &tasks(1));
        finished(&campaign, 1);
        assert!(events.iter().any(|e| matches!(e, Event::Retried { .. })), "{fault}: {events:?}");
        assert_eq!(campaign.outcome(0).unwrap().attempts(), 2, "{fault}");
    }
    // Where it does not pass, the driver stops and nothing is stored.
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(shell("ln -s /proc/self/mem out.csv")));
    let error = fails(&campaign, &tasks(1));
    assert!(matches!(error, ExecutorError::Lost { .. }), "{error}");
    assert!(error.to_string().contains("out.csv cannot be read: Input/output error"), "{error}");
    assert_eq!(campaign.outcome(0), None);
}

#[test]
fn a_result_that_always_ends_in_the_middle_of_a_line_is_a_failure_after_a_second_look() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(shell("printf 'x\\n0.12' > out.csv")));
    run(&campaign, &tasks(1));
    let outcome = campaign.outcome(0).unwrap();
    let kind = FailureKind::MalformedOutput { file: "out.csv".into() };
    assert_eq!((outcome.failure(), outcome.attempts()), (Some(&kind), 2));
}

fn copy_folder(from: &Path, to: &Path) {
    let copied = std::process::Command::new("cp").arg("-r").args([from, to]).status().unwrap();
    assert!(copied.success());
}

/// A driver whose runs wait for a file.
#[test]
#[ignore = "the driver of other tests"]
fn driver() {
    let Some(dir) = given_dir() else { return };
    let (campaign, _) = Campaign::open(&dir).unwrap();
    match campaign::Executor::run(
        &mut campaign::Local::new(2),
        &campaign,
        &tasks(6),
        &mut |_| (),
        &campaign::Stop::new(),
    ) {
        Ok(()) => {}
        Err(ExecutorError::Campaign(CampaignError::LockLost { .. })) => std::process::exit(42),
        Err(error) => panic!("{error}"),
    }
}

/// Starts [`driver`] on runs that wait for the file `go`, and waits until two of them run.
fn start_driver(sandbox: &Sandbox) -> std::process::Child {
    let (pids, go) = (sandbox.file("pids"), sandbox.file("go"));
    let script = format!(
        "echo $$ >> {}; while [ ! -e {} ]; do sleep 0.02; done; {ECHO}",
        pids.display(),
        go.display()
    );
    drop(create(&sandbox.dir(), &spec(shell(&script))));
    let mut driver = this_program(&[], "outages::driver", &sandbox.dir());
    let driver = driver.stdout(std::process::Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while sandbox.lines("pids").len() < 2 {
        assert!(start.elapsed() < Duration::from_secs(30), "nothing was started");
        std::thread::sleep(Duration::from_millis(10));
    }
    driver
}

#[test]
fn a_copy_of_a_folder_is_a_campaign_of_its_own_and_leaves_the_original_alone() {
    let sandbox = Sandbox::new();
    let mut driver = start_driver(&sandbox);
    let first: Vec<i32> = sandbox.lines("pids").iter().map(|pid| pid.parse().unwrap()).collect();
    let copy = sandbox.file("copy");
    copy_folder(&sandbox.dir(), &copy);
    let (campaign, _) = Campaign::open(&copy).unwrap();
    assert!(campaign.is_copy());
    let events = std::thread::scope(|scope| {
        let running = scope.spawn(|| run(&campaign, &tasks(6)));
        std::thread::sleep(Duration::from_millis(300));
        let alive = |pid: &i32| Path::new(&format!("/proc/{pid}")).exists();
        assert!(first.iter().all(alive), "the original's runs were ended");
        fs::write(sandbox.file("go"), "").unwrap();
        running.join().unwrap()
    });
    assert!(!events.iter().any(|event| matches!(event, Event::Note(_))), "{events:?}");
    finished(&campaign, 6);
    drop(campaign);
    assert!(driver.wait().unwrap().success());
    let (original, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert!(damage.is_empty() && !original.is_copy());
    finished(&original, 6);
    assert!(!Campaign::open(&copy).unwrap().0.is_copy(), "it is its own by now");
    // A folder that was only renamed is the same campaign.
    drop(original);
    let renamed = sandbox.file("renamed");
    fs::rename(sandbox.dir(), &renamed).unwrap();
    assert!(!Campaign::open(&renamed).unwrap().0.is_copy());
}

#[test]
fn a_driver_whose_lock_was_removed_stops_before_it_writes_and_keeps_off_the_next_one() {
    let sandbox = Sandbox::new();
    let mut driver = start_driver(&sandbox);
    fs::remove_file(sandbox.dir().join("lock")).unwrap();
    // The next driver is let in; it does not end what belongs to the one that lives.
    let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
    let running: Vec<i32> = sandbox.lines("pids").iter().map(|pid| pid.parse().unwrap()).collect();
    let journal = fs::read(sandbox.dir().join("results.jsonl")).unwrap();
    fs::write(sandbox.file("go"), "").unwrap();
    assert_eq!(driver.wait().unwrap().code(), Some(42), "it said that its lock is gone");
    assert_eq!(fs::read(sandbox.dir().join("results.jsonl")).unwrap(), journal);
    assert!(running.into_iter().all(is_gone));
    run(&campaign, &tasks(6));
    finished(&campaign, 6);
    drop(campaign);
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert_eq!((damage, campaign.missing(&tasks(6))), (vec![], vec![]));
}

#[test]
fn a_link_in_place_of_the_lock_is_refused_and_what_it_points_to_is_not_touched() {
    let sandbox = Sandbox::new();
    drop(create(&sandbox.dir(), &spec(shell(ECHO))));
    let precious = sandbox.file("precious");
    fs::write(&precious, "precious").unwrap();
    let lock = sandbox.dir().join("lock");
    fs::remove_file(&lock).unwrap();
    std::os::unix::fs::symlink(&precious, &lock).unwrap();
    let error = Campaign::open(&sandbox.dir()).unwrap_err();
    assert!(matches!(&error, CampaignError::Io { path, .. } if path.ends_with("lock")), "{error}");
    assert_eq!(fs::read_to_string(&precious).unwrap(), "precious");
}
