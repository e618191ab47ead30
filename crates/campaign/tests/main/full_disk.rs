//! A full disk: a clear message, and nothing lost.

use std::path::Path;
use std::process::{Command, Stdio};

use campaign::{Campaign, CampaignError, Executor, ExecutorError, Fault, InProcess, Stop, Task};

use crate::sandbox::{
    Sandbox, create, given_dir, rows, run, shell, spec, task, tasks, this_program,
};

const TASKS: u64 = 400;

fn a_function() -> campaign::CampaignSpec {
    let mut command = shell("");
    command.call.argv.clear();
    command.outputs = vec![rows("-", "x", 1)];
    spec(command)
}

fn square(task: &Task) -> Result<Vec<f64>, Fault> {
    Ok(vec![task.parameters[0].powi(2)])
}

/// Fills the disk with its outcomes: the directory is given, and so small that it cannot end.
#[test]
#[ignore = "part of other tests"]
fn fill() {
    let Some(dir) = given_dir() else { return };
    let campaign = create(&dir, &a_function());
    let mut stored = 0;
    let mut pool = InProcess::new(1, square).unwrap();
    let error = loop {
        let batch: Vec<Task> = tasks(stored + 5).split_off(stored as usize);
        assert!(stored < TASKS, "the disk is never full");
        if let Err(error) = pool.run(&campaign, &batch, &mut |_| (), &Stop::new()) {
            break error;
        }
        stored += 5;
    };
    let ExecutorError::Campaign(full @ CampaignError::DiskFull { .. }) = error else {
        panic!("{error}");
    };
    assert!(full.to_string().contains("the disk is full; everything before is safe"), "{full}");
    assert!(stored > 0, "there was no room at all");
    eprintln!("stored {stored}");
}

/// Runs [`fill`] behind `wrapper`, and goes on once there is room.
fn fill_then_go_on(wrapper: &[&str], dir: &Path, make_room: impl FnOnce()) {
    let output = this_program(wrapper, "full_disk::fill", dir).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stdout));
    let stored = said.lines().find_map(|line| line.strip_prefix("stored ")).unwrap();
    let stored: u64 = stored.parse().unwrap();
    make_room();
    let (campaign, damage) = Campaign::open(dir).unwrap();
    assert_eq!(damage, [], "the directory is intact");
    for number in 0..stored {
        let outcome = campaign.outcome(number).unwrap();
        assert_eq!(outcome.values(), Some(&[task(number).parameters[0].powi(2)][..]));
    }
    let mut pool = InProcess::new(1, square).unwrap();
    pool.run(&campaign, &tasks(TASKS), &mut |_| (), &Stop::new()).unwrap();
    assert_eq!(campaign.missing(&tasks(TASKS)), []);
}

#[test]
fn a_file_that_may_not_grow_stops_the_run_and_loses_nothing() {
    let sandbox = Sandbox::new();
    // Sixteen blocks of 512 bytes or of 1 KiB, as the shell has it; the signal is ignored, so that
    // writing fails as on a full disk.
    let script = "trap '' XFSZ; ulimit -f 16; exec \"$@\"";
    fill_then_go_on(&["sh", "-c", script, "sh"], &sandbox.dir(), || ());
}

/// A small file system in memory, if this user may mount one.
struct SmallDisk {
    folder: tempfile::TempDir,
}

impl SmallDisk {
    fn new(size: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(folder.path())
            .stderr(Stdio::null())
            .status();
        if mounted.is_ok_and(|status| status.success()) {
            return Some(Self { folder });
        }
        eprintln!("skipped: a small disk cannot be mounted here");
        None
    }

    fn grow(&self) {
        let options = ["-o", "remount,size=64m"];
        let grown = Command::new("mount").args(options).arg(self.folder.path()).status();
        assert!(grown.unwrap().success());
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(self.folder.path()).status();
    }
}

#[test]
fn a_full_disk_stops_the_run_and_loses_nothing() {
    let Some(disk) = SmallDisk::new("64k") else { return };
    fill_then_go_on(&["env"], &disk.folder.path().join("campaign"), || disk.grow());
}

#[test]
fn a_program_that_fails_on_a_full_disk_is_not_a_failed_run() {
    let Some(disk) = SmallDisk::new("512k") else { return };
    let dir = disk.folder.path().join("campaign");
    let big = "dd if=/dev/zero of=big bs=1k count=4000 2>/dev/null || exit 1";
    let campaign = create(&dir, &spec(shell(&format!("{big}; printf 'x\\n%s\\n' $1 > out.csv"))));
    let mut local = campaign::Local::new(1);
    let error = local.run(&campaign, &tasks(2), &mut |_| (), &Stop::new()).unwrap_err();
    let full = matches!(&error, ExecutorError::Campaign(error) if error.is_disk_full());
    assert!(full, "{error}");
    assert_eq!(campaign.missing(&tasks(2)).len(), 2);
    disk.grow();
    run(&campaign, &tasks(2));
    assert_eq!(crate::sandbox::values(&campaign, 1), [task(1).parameters[0]]);
}

#[test]
fn a_run_that_finishes_on_a_full_disk_is_stored_in_the_room_kept_for_it() {
    if !cfg!(target_os = "linux") {
        return;
    }
    let Some(disk) = SmallDisk::new("512k") else { return };
    let dir = disk.folder.path().join("campaign");
    let big = disk.folder.path().join("somebody-elses");
    let fill = format!("dd if=/dev/zero of={} bs=1k count=4000 2>/dev/null", big.display());
    // More than what the removal of small files makes room for.
    let mut command = shell(&format!("(echo x; seq 0.125 3000) > out.csv; {fill}; exit 0"));
    command.outputs = vec![rows("out.csv", "x", 3000)];
    let expected: Vec<f64> = (0..3000).map(|i| 0.125 + f64::from(i)).collect();
    let campaign = create(&dir, &spec(command));
    run(&campaign, &tasks(1));
    assert_eq!(crate::sandbox::values(&campaign, 0), expected);
    drop(campaign);
    std::fs::remove_file(big).unwrap();
    disk.grow();
    let (campaign, damage) = Campaign::open(&dir).unwrap();
    assert_eq!(damage, []);
    assert_eq!(crate::sandbox::values(&campaign, 0), expected);
}
