//! A driver that is killed at random moments.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use campaign::{Campaign, CampaignSpec, status};

use crate::sandbox::{
    Sandbox, bits, create, given_dir, is_gone, run, running_driver, shell, spec, task, tasks,
    this_program, values,
};

const TASKS: u64 = 50;
const KILLS: u32 = 25;

fn the_spec(log: &std::path::Path) -> CampaignSpec {
    let script =
        format!("echo $3 >> {}; sleep 0.01; printf 'x\\n%s\\n' $2 > out.csv", log.display());
    spec(shell(&script))
}

/// The driver that is killed.
#[test]
#[ignore = "the driver of other tests"]
fn driver() {
    let Some(dir) = given_dir() else { return };
    let (campaign, damage) = Campaign::open(&dir).unwrap();
    assert!(damage.iter().all(|damage| damage.torn), "{damage:?}");
    // In several batches, as the iterations of a calibration.
    for last in [10, 30, TASKS] {
        run(&campaign, &tasks(last));
    }
}

#[test]
fn a_driver_killed_at_random_moments_loses_nothing_and_runs_nothing_that_finished_again() {
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let (mut kills, mut damaged) = (0, 0);
    let start = Instant::now();
    while kills < KILLS {
        let sandbox = Sandbox::new();
        let log = sandbox.file("log");
        drop(create(&sandbox.dir(), &the_spec(&log)));
        let mut finished: BTreeSet<u64> = BTreeSet::new();
        let mut logged = 0;
        let mut complete = false;
        while !complete {
            let mut driver = this_program(&[], "kills::driver", &sandbox.dir());
            driver.stdout(std::process::Stdio::null());
            let mut driver = driver.spawn().unwrap();
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            if kills < KILLS {
                std::thread::sleep(Duration::from_millis(random % 250));
            } else {
                driver.wait().unwrap();
            }
            let ended = driver.try_wait().unwrap();
            if ended.is_none() {
                driver.kill().unwrap();
                driver.wait().unwrap();
                kills += 1;
            }
            assert!(ended.is_none_or(|status| status.success()), "{ended:?}");
            complete = ended.is_some();
            // What had an outcome before was not started again.
            let lines = sandbox.lines("log");
            for line in &lines[logged..] {
                let number: u64 = line.parse().unwrap();
                assert!(!finished.contains(&number), "run {number} was made again");
            }
            logged = lines.len();
            let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
            damaged += damage.len();
            assert!(damage.iter().all(|damage| damage.torn), "{damage:?}");
            for number in 0..TASKS {
                match campaign.outcome(number) {
                    Some(_) => _ = finished.insert(number),
                    None => assert!(!finished.contains(&number), "run {number} was lost"),
                }
            }
        }
        let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
        for number in 0..TASKS {
            assert_eq!(bits(&values(&campaign, number)), bits(&task(number).parameters[1..]));
        }
        let left = std::fs::read_dir(sandbox.dir().join("work")).unwrap().count();
        assert_eq!(left, 0, "abandoned attempts are removed");
    }
    eprintln!("{kills} kills in {:?}, {damaged} torn lines", start.elapsed());
}

#[test]
#[ignore = "long: run by .ci/run"]
fn runs_of_a_killed_driver_end_when_their_time_is_over() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let sandbox = Sandbox::new();
    let pids = sandbox.file("pids");
    let mut command = shell(&format!("echo $$ >> {}; sleep 300", pids.display()));
    command.call.timeout_s = 3.0;
    drop(create(&sandbox.dir(), &spec(command)));
    let mut driver = running_driver(&sandbox, "pids");
    driver.kill().unwrap();
    driver.wait().unwrap();
    let pids: Vec<i32> = sandbox.lines("pids").iter().map(|pid| pid.parse().unwrap()).collect();
    assert_eq!(pids.len(), 2);
    std::thread::sleep(Duration::from_secs(3));
    assert!(pids.into_iter().all(is_gone), "nobody resumed, and they run on");
}

#[test]
fn what_a_killed_driver_left_running_is_ended_before_it_is_run_again() {
    let sandbox = Sandbox::new();
    let pids = sandbox.file("pids");
    let go = sandbox.file("go");
    let script = format!(
        "if [ ! -e {1} ]; then sh -c 'echo $$ >> {0}; sleep 300' & wait; fi; printf 'x\\n%s\\n' $1 > out.csv",
        pids.display(),
        go.display()
    );
    drop(create(&sandbox.dir(), &spec(shell(&script))));
    let mut driver = running_driver(&sandbox, "pids");
    let running = status(&sandbox.dir()).unwrap();
    assert_eq!((running.submitted, running.running, running.queued), (10, 2, 8));
    assert_eq!(running.driver.unwrap().unwrap().pid, driver.id());
    driver.kill().unwrap();
    driver.wait().unwrap();
    let crashed = status(&sandbox.dir()).unwrap();
    assert_eq!((crashed.driver, crashed.running, crashed.queued), (None, 0, 10));
    let pids: Vec<i32> = sandbox.lines("pids").iter().map(|pid| pid.parse().unwrap()).collect();
    let alive = |pid: &i32| std::fs::metadata(format!("/proc/{pid}")).is_ok();
    if cfg!(target_os = "linux") {
        assert!(pids.len() == 2 && pids.iter().all(alive), "nobody could end them");
        std::fs::write(&go, "").unwrap();
        let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
        let events = run(&campaign, &tasks(10));
        let note = events.iter().any(|event| matches!(event, campaign::Event::Note(_)));
        assert!(note && pids.into_iter().all(is_gone), "{events:?}");
        assert_eq!(values(&campaign, 9), [task(9).parameters[0]]);
    }
}
