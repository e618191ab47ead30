//! Runs of programs that go on while the sampler places others.

use std::collections::BTreeSet;

use campaign::{Feed, Stop};

use crate::error::{Failure, RunError};
use crate::simulator::Runner;

/// Ends a feed, also after a panic.
struct Closing<'b, 'a>(&'b Feed<'a>);

impl Drop for Closing<'_, '_> {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// Does `work` with a runner whose executor makes runs on a thread of its own, beside the work.
pub(super) fn beside<T>(
    runner: Runner<'_>,
    stop: &Stop,
    work: impl FnOnce(Runner<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let Runner { campaign, mut executor, changed, given_up, mut on_event, .. } = runner;
    let feed = Feed::new(campaign);
    std::thread::scope(|scope| {
        let feed = &feed;
        let _closing = Closing(feed);
        let serve = move || feed.serve(&mut *executor, &mut *on_event, stop);
        std::thread::Builder::new().spawn_scoped(scope, serve).map_err(|error| {
            RunError::new(format_args!("the system gives no further thread: {error}"))
        })?;
        let (ahead, unsure) = (Some(feed), BTreeSet::new());
        let (executor, on_event) = (Box::new(feed), Box::new(|_| ()));
        work(Runner { campaign, executor, ahead, unsure, changed, given_up, on_event })
    })
}

#[cfg(test)]
mod tests {
    use super::super::run::Driver;
    use super::super::{RunOptions, store};
    use crate::error::Failure;
    use crate::plan::Planned;
    use crate::watch::Watch;
    use campaign::{RunTimes, Simulated, SimulatedRun, Stop, Task};
    use std::collections::BTreeMap;
    use std::path::Path;
    use std::sync::atomic::{AtomicI64, Ordering};

    /// Number of samples: four times the overlap at least.
    fn samples(overlap: usize) -> usize {
        4 * overlap.max(30)
    }

    /// A line with a slope and an intercept, of which a corner of the prior fails.
    fn planned(folder: &Path, overlap: usize) -> Planned {
        std::fs::write(folder.join("line.csv"), "t,y\n0,0.31\n1,0.79\n2,1.32\n").expect("a table");
        let samples = samples(overlap);
        let plan = format!(
            r#"name = "line"
[parameters.a]
distribution = "normal"
mean = 0.0
sd = 1.0
[parameters.b]
distribution = "normal"
mean = 0.0
sd = 2.0
[experiments.line.simulator]
kind = "command"
argv = ["true", "{{a}}", "{{b}}"]
[experiments.line.observables.y]
table = "line.csv"
control = "t"
noise = {{ kind = "fixed", sigma = 0.05 }}
result = {{ file = "out.csv", control = "t", value = "y" }}
[sampler]
samples = {samples}
overlap = {overlap}
"#
        );
        let path = folder.join("plan.toml");
        std::fs::write(&path, plan).expect("a plan");
        Planned::read(&path).expect("a plan")
    }

    fn line(task: &Task) -> SimulatedRun {
        let (a, b) = (task.parameters[0], task.parameters[1]);
        if a > 1.5 {
            SimulatedRun::Fails
        } else {
            SimulatedRun::Values(vec![a, a + b, a + 2.0 * b])
        }
    }

    struct Stoppable(Stop);

    impl Watch for Stoppable {
        fn stop(&self) -> &Stop {
            &self.0
        }
    }

    /// Runs or resumes in a folder on simulated slots, and stops after so many runs; files of the result, none where it stopped.
    fn drive(
        folder: &Path,
        overlap: usize,
        (slots, seed, stop_after): (usize, u64, i64),
    ) -> Option<BTreeMap<String, Vec<u8>>> {
        let (out, planned) = (folder.join("run"), planned(folder, overlap));
        let (campaign, stored) = if out.exists() {
            let (campaign, stored, damage) = store::open(&out, None).expect("a campaign");
            assert_eq!(damage, []);
            (campaign, stored)
        } else {
            store::create(&out, &planned).expect("a campaign")
        };
        let times = if seed == 0 { RunTimes::Equal } else { RunTimes::LogNormal(1.0) };
        let (watch, left) = (Stoppable(Stop::new()), AtomicI64::new(stop_after));
        let outcome = |task: &Task| {
            if left.fetch_sub(1, Ordering::SeqCst) == 1 {
                watch.0.cancel();
            }
            line(task)
        };
        let mut cluster = Simulated::new(slots, times, seed, outcome);
        cluster.loss = if seed == 0 { 0.0 } else { 0.2 };
        let options = RunOptions { threads: Some(1 + slots % 2), ..RunOptions::default() };
        let driver = Driver { dir: &out, campaign: &campaign, stored: &stored, watch: &watch };
        match driver.drive(Box::new(&mut cluster), &options) {
            Ok(_) => {}
            Err(Failure::Paused(_)) => return None,
            Err(other) => panic!("{other}"),
        }
        let names = ["posterior.json", "samples.csv", "table.md", "campaign/tasks.jsonl"];
        let read = |name: &str| (name.to_owned(), std::fs::read(out.join(name)).expect(name));
        let mut files: BTreeMap<_, _> = names.map(read).into();
        // Tasks are written when they are placed: in any order of batches, these are the same.
        let tasks = files.get_mut("campaign/tasks.jsonl").expect("tasks");
        let mut lines: Vec<&[u8]> = tasks.split(|byte| *byte == b'\n').collect();
        lines.sort_unstable();
        *tasks = lines.concat();
        Some(files)
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn order_of_ends_losses_kills_and_resumes_do_not_change_a_bit_at_any_overlap() {
        for overlap in [1, 100] {
            let folder = tempfile::tempdir().expect("a folder");
            let quiet = drive(folder.path(), overlap, (1, 0, i64::MAX)).expect("a result");
            let failed = String::from_utf8_lossy(&quiet["posterior.json"]).contains("exit code 1");
            assert!(failed, "the test needs failures too");
            for seed in 1..4 {
                let folder = tempfile::tempdir().expect("a folder");
                let mut stops = 0;
                let stormy = loop {
                    let slots = 3 + 29 * seed as usize;
                    // Another order after every stop.
                    let after = samples(overlap) as i64 / 4 + 3 * seed as i64;
                    let way = (slots + stops, seed + 10 * stops as u64, after);
                    match drive(folder.path(), overlap, way) {
                        Some(files) => break files,
                        None => stops += 1,
                    }
                };
                assert!(stops >= 3, "{stops}");
                for (name, bytes) in &quiet {
                    assert!(stormy[name] == *bytes, "overlap {overlap}, seed {seed}: {name}");
                }
            }
        }
    }

    #[test]
    fn the_posterior_of_a_line_is_the_conjugate_one_with_overlap() {
        // Precision X'X/s^2 + P^-1 and its mean, by hand for t = 0, 1, 2; the failing corner is 26 sds away.
        let (s2, y) = (0.05f64.powi(2), [0.31, 0.79, 1.32]);
        let [aa, ab, bb] = [3.0 / s2 + 1.0, 3.0 / s2, 5.0 / s2 + 0.25];
        let [ra, rb] = [y.iter().sum::<f64>() / s2, (y[1] + 2.0 * y[2]) / s2];
        let determinant = aa * bb - ab * ab;
        let mean = [(bb * ra - ab * rb) / determinant, (aa * rb - ab * ra) / determinant];
        let sd = [(bb / determinant).sqrt(), (aa / determinant).sqrt()];
        for overlap in [1, 30] {
            let folder = tempfile::tempdir().expect("a folder");
            let files = drive(folder.path(), overlap, (64, 3, i64::MAX)).expect("a result");
            let record: serde_json::Value =
                serde_json::from_slice(&files["posterior.json"]).expect("JSON");
            for j in 0..2 {
                let found = &record["parameters"][j]["in_coordinate"];
                let off = (found["mean"].as_f64().expect("a mean") - mean[j]) / sd[j];
                let spread = found["sd"].as_f64().expect("an sd") / sd[j] - 1.0;
                assert!(off.abs() < 0.1 && spread.abs() < 0.1, "overlap {overlap}: {off} {spread}");
            }
        }
    }
}
