//! How far work is, shown in Python.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use campaign::Stop;
use pyo3::prelude::*;
use workbench::watch::Watch;

/// Work that is done, to be shown on another thread.
#[derive(Default)]
pub(crate) struct Watching {
    stop: Stop,
    done: AtomicU64,
    news: Mutex<News>,
}

/// What has not been shown yet.
#[derive(Default)]
struct News {
    work: (u64, String),
    notes: Vec<(bool, String)>,
}

impl Watching {
    /// Asks the work to end.
    pub(crate) fn cancel(&self) {
        self.stop.cancel();
    }

    fn news(&self) -> std::sync::MutexGuard<'_, News> {
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells `progress` what is new: `show(done, total, what)`, `note(text)`, `warn(text)`.
    pub(crate) fn show(&self, progress: &Bound<'_, PyAny>) -> PyResult<()> {
        let (total, what, notes) = {
            let mut news = self.news();
            (news.work.0, news.work.1.clone(), std::mem::take(&mut news.notes))
        };
        progress.call_method1("show", (self.done.load(Ordering::Relaxed), total, what))?;
        for (warning, text) in notes {
            progress.call_method1(if warning { "warn" } else { "note" }, (text,))?;
        }
        Ok(())
    }
}

impl Watch for Watching {
    fn stop(&self) -> &Stop {
        &self.stop
    }

    fn begin(&self, total: u64, done: u64, what: &'static str) {
        let mut news = self.news();
        self.done.store(done, Ordering::Relaxed);
        news.work = (total, what.to_owned());
    }

    fn advance(&self) {
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn note(&self, message: &str) {
        self.news().notes.push((false, message.to_owned()));
    }

    fn warn(&self, message: &str) {
        self.news().notes.push((true, message.to_owned()));
    }
}
