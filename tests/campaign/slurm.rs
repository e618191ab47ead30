//! Runs of programs as jobs of a real Slurm.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use rustix::process::Signal;

use super::{Driver, line, line_plan, runs, until};
use crate::sandbox::{Sandbox, root};

/// A Slurm of two nodes on this machine, for as long as the test takes.
struct Cluster {
    folder: tempfile::TempDir,
}

impl Cluster {
    /// None where Slurm is not installed.
    fn up() -> Option<Self> {
        let script = root().join("tests/slurm/cluster.sh");
        if !Command::new(&script).arg("missing").status().expect("the script").success() {
            return None;
        }
        let cluster = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        let up = Command::new(script).arg("up").arg(cluster.dir()).status().expect("the script");
        assert!(up.success(), "the cluster does not come up");
        Some(cluster)
    }

    fn dir(&self) -> PathBuf {
        self.folder.path().join("cluster")
    }

    /// Starts the command with the environment in which sbatch and squeue speak to the cluster.
    fn start(&self, sandbox: &Sandbox, arguments: &str) -> Driver {
        let child = Command::new("bash")
            .current_dir(sandbox.path())
            .args(["-c", "source \"$0/env\"; exec \"$@\""])
            .arg(self.dir())
            .arg(env!("CARGO_BIN_EXE_calibrate"))
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("bash");
        Driver { child }
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let script = root().join("tests/slurm/cluster.sh");
        let _ = Command::new(script).arg("down").arg(self.dir()).status();
    }
}

/// `cargo test -p calibrate --test e2e a_real_slurm -- --ignored --nocapture`, with Debian's slurm-wlm and munge.
#[test]
#[ignore = "needs Slurm, and takes half a minute"]
fn a_real_slurm_gives_the_bits_of_local_runs_through_every_interruption() {
    let Some(cluster) = Cluster::up() else {
        eprintln!("skipped: Slurm is not installed (as root: tests/slurm/cluster.sh install)");
        return;
    };
    let sandbox = line(24, "0.2");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let bytes = sandbox.posterior_bytes("results/line");
    let executor = "kind = \"slurm\"\nchunk = 3\npoll_min_s = 0.1\npoll_max_s = 0.5\ngrace_s = 2\n";
    let local = "kind = \"local\"\nparallel = 2\n";
    sandbox.write("slurm.toml", line_plan(24, "0.2").replace(local, executor));
    // (name, options, what happens in the middle of the run)
    for (name, options, signal) in [
        ("whole", "", None),
        ("detached", "", Some(Signal::INT)),
        ("cancelled", "--on-interrupt cancel", Some(Signal::INT)),
        ("killed", "", Some(Signal::KILL)),
    ] {
        let before = runs(&sandbox);
        let driver =
            cluster.start(&sandbox, &format!("--plan slurm.toml --out {name} --quiet {options}"));
        if let Some(signal) = signal {
            until("a few runs", || runs(&sandbox) >= before + 3);
            driver.signal(signal);
            let (code, stderr) = driver.wait();
            assert_eq!(code, if signal == Signal::INT { Some(130) } else { None }, "{stderr}");
            assert_eq!(
                stderr.contains("jobs on the cluster go on"),
                name == "detached",
                "{stderr}"
            );
            let resumed = cluster.start(&sandbox, &format!("--resume {name} --quiet"));
            let (code, stderr) = resumed.wait();
            assert_eq!(code, Some(0), "{name}: {stderr}");
        } else {
            let (code, stderr) = driver.wait();
            assert_eq!(code, Some(0), "{name}: {stderr}");
        }
        assert!(sandbox.posterior_bytes(name) == bytes, "{name} differs from the local run");
        if name != "cancelled" {
            assert_eq!(runs(&sandbox) - before, 24, "{name}: no run is made twice");
        }
    }
}
