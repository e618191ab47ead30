//! Progress, notes and warnings of a long job, and the request to stop it: the library itself prints nothing.

use campaign::Stop;
use smc_calib::StageRecord;

/// Follows a long job, and may stop it. All methods may be called from several threads at once.
pub trait Watch: Sync {
    /// Asked between two pieces of work; once it is set, the job ends as soon as it can.
    fn stop(&self) -> &Stop;

    /// The job has so many steps, each of which begins its own work.
    fn steps(&self, _of: u64) {}

    /// Work begins: `total` pieces of `what`, `done` of which were done before; 0 where they cannot be counted.
    fn begin(&self, _total: u64, _done: u64, _what: &'static str) {}

    /// One more piece of work is done.
    fn advance(&self) {}

    /// The present step of the work.
    fn now(&self, _what: &str) {}

    /// A stage of the sampler has ended.
    fn stage(&self, _record: &StageRecord) {}

    /// The work that [`begin`](Self::begin) announced has ended.
    fn end(&self) {}

    /// Something worth knowing that does not put the result in doubt.
    fn note(&self, _message: &str) {}

    /// Something that may put the result in doubt.
    fn warn(&self, _message: &str) {}
}

/// A job within a larger one, which counts pieces of its own: what this one does is said, not counted.
pub(crate) struct Within<'a> {
    watch: &'a dyn Watch,
    what: String,
}

impl<'a> Within<'a> {
    /// Says what the job is.
    pub(crate) fn new(watch: &'a dyn Watch, what: String) -> Self {
        watch.now(&what);
        Self { watch, what }
    }
}

impl Watch for Within<'_> {
    fn stop(&self) -> &Stop {
        self.watch.stop()
    }

    fn now(&self, what: &str) {
        self.watch.now(&format!("{}: {what}", self.what));
    }

    fn stage(&self, record: &StageRecord) {
        self.now(&format!("stage {}", record.stage));
    }

    fn note(&self, message: &str) {
        self.watch.note(message);
    }

    fn warn(&self, message: &str) {
        self.watch.warn(message);
    }
}

/// Watches nothing and never stops a job.
#[derive(Debug, Clone, Default)]
pub struct Unwatched(Stop);

impl Watch for Unwatched {
    fn stop(&self) -> &Stop {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::calibration::{self, RunOptions};
    use crate::compare::Compared;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::report::TimeScale;
    use crate::table3::Table3;

    /// Keeps what is begun: how many pieces of what, and how many were done.
    #[derive(Default)]
    struct Kept {
        stop: Stop,
        begun: Mutex<Vec<(&'static str, u64, u64)>>,
        steps: Mutex<u64>,
    }

    impl Watch for Kept {
        fn stop(&self) -> &Stop {
            &self.stop
        }

        fn steps(&self, of: u64) {
            *self.steps.lock().expect("steps") = of;
        }

        fn begin(&self, total: u64, done: u64, what: &'static str) {
            self.begun.lock().expect("work").push((what, total, done));
        }

        fn advance(&self) {
            self.begun.lock().expect("work").last_mut().expect("work that was begun").2 += 1;
        }
    }

    fn options(samples: usize) -> PairOptions {
        PairOptions { material: Some(Material::Ps), samples, ..PairOptions::default() }
    }

    #[test]
    fn every_step_of_a_calibration_is_shown_and_none_ends_before_its_work() {
        let watch = Kept::default();
        let folder = tempfile::tempdir().expect("a folder");
        let run = RunOptions { out: Some(folder.path().join("run")), ..RunOptions::default() };
        calibration::run(&options(4096).plan().expect("a plan"), &run, &watch).expect("a run");
        let begun = watch.begun.into_inner().expect("work");
        let names: Vec<_> = begun.iter().map(|(what, ..)| *what).collect();
        let steps = ["simulations", "steps to the posterior", "with correlated errors"];
        assert_eq!(names[..3], steps);
        assert_eq!(names[3..], ["other kinetics", "tables and figures"]);
        assert_eq!(names.len() as u64, *watch.steps.lock().expect("steps"));
        for (what, total, done) in begun {
            // The step that is told of last is still to be done.
            let told = if what == "steps to the posterior" { total - 1 } else { total };
            assert_eq!(done, told, "{what}");
        }
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn a_job_of_many_calibrations_counts_each_of_them_once() {
        let watch = Kept::default();
        let noises = &crate::compare::default_noises()[..1];
        Compared::new(&options(8192), noises, false, TimeScale::ByData, &watch)
            .expect("a comparison");
        let cells = dem_core::Kinetics::ALL.len() as u64;
        assert_eq!(*watch.begun.lock().expect("work"), [("calibrations", cells, cells)]);
        let watch = Kept::default();
        Table3::regenerate(8192, 1, &watch).expect("a table");
        assert_eq!(*watch.begun.lock().expect("work"), [("calibrations", 5, 5)]);
    }
}
