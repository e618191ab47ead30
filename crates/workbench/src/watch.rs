//! Progress, notes and warnings of a long job, and the request to stop it: the library itself prints nothing.

use campaign::Stop;
use smc_calib::StageRecord;

/// Follows a long job, and may stop it. All methods may be called from several threads at once.
pub trait Watch: Sync {
    /// Asked between two pieces of work; once it is set, the job ends as soon as it can.
    fn stop(&self) -> &Stop;

    /// Work begins: `total` pieces of `what`, `done` of which were done before.
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

/// Watches nothing and never stops a job.
#[derive(Debug, Clone, Default)]
pub struct Unwatched(Stop);

impl Watch for Unwatched {
    fn stop(&self) -> &Stop {
        &self.0
    }
}
