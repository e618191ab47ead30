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
