//! A thread that computes while its caller writes files, shows progress and listens for a request to stop.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use crate::error::RunError;
use crate::watch::Watch;

/// How often the caller looks whether it is asked to stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A thread that hands over messages.
///
/// It is never joined: what is on disk is whole at any moment, and an interruption need not wait for it. It ends at the
/// first message that nobody takes.
pub(crate) struct Worker<T> {
    receive: Receiver<T>,
}

impl<T: Send + 'static> Worker<T> {
    /// Starts a thread that sends its messages where it is told.
    pub(crate) fn start(work: impl FnOnce(&Sender<T>) + Send + 'static) -> Self {
        let (send, receive) = channel();
        let _ = std::thread::spawn(move || work(&send));
        Self { receive }
    }

    /// The next message; none once the job is asked to stop.
    pub(crate) fn next(&self, watch: &dyn Watch) -> Result<Option<T>, RunError> {
        while !watch.stop().asked() {
            match self.receive.recv_timeout(LOOK_EVERY) {
                Ok(message) => return Ok(Some(message)),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(RunError::new("the simulation ended without a result"));
                }
            }
        }
        Ok(None)
    }
}
