//! Ctrl-C and termination: the run ends, removes what it has begun to write, and exits with 130.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Once, OnceLock};

use crate::error::Failure;

static ASKED: AtomicBool = AtomicBool::new(false);
static LISTENING: Once = Once::new();
static ACTION: OnceLock<Box<dyn Fn() + Send + Sync>> = OnceLock::new();

/// Takes over Ctrl-C, termination and hang-up from here on: the first asks the run to end, a second ends the
/// program at once.
pub fn listen() {
    LISTENING.call_once(|| {
        // Without a handler the signals end the program as they always do, and only the hidden folder of a run
        // that was being written is left.
        let _ = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            if let Some(action) = ACTION.get() {
                action();
            }
        });
    });
}

/// As [`listen`], and calls `action` at the first request. Only the first action of a process counts.
pub fn listen_with(action: impl Fn() + Send + Sync + 'static) {
    let _ = ACTION.set(Box::new(action));
    listen();
}

/// Whether the user has asked the run to end.
#[must_use]
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Ends the run where the user has asked for it.
///
/// # Errors
///
/// [`Failure::Interrupted`].
pub fn check() -> Result<(), Failure> {
    if asked() { Err(Failure::Interrupted) } else { Ok(()) }
}
