//! Long work on a thread of its own, while the caller's thread answers for Python.
//!
//! The work never takes Python's lock. What it needs of Python, values of a simulator that is a Python function, it asks the
//! caller's thread for, which is the one that gets Ctrl-C: a `KeyboardInterrupt` is raised there at once, in the midst of
//! the function too, and the work is told to stop.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use smc_calib::{SimError, Simulator};

use crate::failures::RunFailed;
use crate::watching::Watching;

/// How long the caller's thread waits before it looks for Ctrl-C and shows how far the work is.
const LOOK: Duration = Duration::from_millis(50);

/// Values and fates of some parameter sets.
struct Answer {
    values: Vec<f64>,
    results: Vec<Result<(), SimError>>,
}

/// What the work tells the caller's thread.
enum Told<T> {
    Ask { first: usize, thetas: Vec<f64>, answer: SyncSender<Answer> },
    Done(T),
}

/// A simulator that is called on the thread of the one who began the work.
pub(crate) struct Asking<T> {
    parameters: usize,
    observables: usize,
    ask: Sender<Told<T>>,
}

impl<T: Send> Simulator for Asking<T> {
    fn parameters(&self) -> usize {
        self.parameters
    }

    fn observables(&self) -> usize {
        self.observables
    }

    fn simulate(&self, _: &[f64], _: &mut [f64]) -> Result<(), SimError> {
        Err(SimError::fatal("a Python function is called for samples alone"))
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let rows = thetas.len() / self.parameters;
        let (answer, answered) = sync_channel(1);
        let asked = self.ask.send(Told::Ask { first, thetas: thetas.to_vec(), answer });
        match asked.ok().and_then(|()| answered.recv().ok()) {
            Some(Answer { values, results }) if values.len() == outputs.len() => {
                outputs.copy_from_slice(&values);
                results
            }
            // The caller's thread has gone on: it was interrupted.
            _ => vec![Err(SimError::Interrupted); rows],
        }
    }
}

/// Does work that calls no Python function.
pub(crate) fn work<T: Send>(
    py: Python<'_>,
    progress: &Bound<'_, PyAny>,
    job: impl FnOnce(&Watching) -> T + Send,
) -> PyResult<T> {
    drive(py, (0, 0, None), progress, |watching, _| job(watching))
}

/// Does work with a simulator that is a Python callable: `function(first, thetas)` with the number of the first sample and the
/// rows of parameters as bytes of doubles, gives the values as such bytes and `{row: cause}` of those that failed.
pub(crate) fn drive<T: Send>(
    py: Python<'_>,
    (parameters, observables, function): (usize, usize, Option<&Bound<'_, PyAny>>),
    progress: &Bound<'_, PyAny>,
    job: impl FnOnce(&Watching, &Asking<T>) -> T + Send,
) -> PyResult<T> {
    let watching = Watching::default();
    let (ask, told) = channel();
    let told = Mutex::new(told);
    std::thread::scope(|scope| {
        let (seen, asking) = (&watching, Asking { parameters, observables, ask: ask.clone() });
        let thread = scope.spawn(move || {
            let found = job(seen, &asking);
            // Where the caller's thread was interrupted nobody waits for it.
            let _ = ask.send(Told::Done(found));
        });
        let done = answer(py, (function, observables), progress, (&watching, &told));
        if done.is_err() {
            watching.cancel();
            // A question that comes now, or waits, has no one to answer it.
            drop(told);
        }
        let ended = py.detach(|| thread.join());
        match (done, ended) {
            (Ok(_), Err(_)) => Err(died()),
            (done, _) => done,
        }
    })
}

fn died() -> PyErr {
    RunFailed::new_err(
        "the calibration ended by a fault of its own, which it should not; what it printed tells where",
    )
}

/// Answers the work until it is done.
fn answer<T: Send>(
    py: Python<'_>,
    (function, observables): (Option<&Bound<'_, PyAny>>, usize),
    progress: &Bound<'_, PyAny>,
    (watching, told): (&Watching, &Mutex<Receiver<Told<T>>>),
) -> PyResult<T> {
    loop {
        let next =
            py.detach(|| told.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
        py.check_signals()?;
        watching.show(progress)?;
        match next {
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(died()),
            Ok(Told::Done(found)) => return Ok(found),
            Ok(Told::Ask { first, thetas, answer }) => {
                let Some(function) = function else { return Err(died()) };
                let found = call(py, function, (first, &thetas), observables)?;
                let _ = answer.send(found);
            }
        }
    }
}

fn call(
    py: Python<'_>,
    function: &Bound<'_, PyAny>,
    (first, thetas): (usize, &[f64]),
    observables: usize,
) -> PyResult<Answer> {
    let (values, failures): (Vec<u8>, Vec<(usize, String)>) =
        function.call1((first, bytes(py, thetas)))?.extract()?;
    let values = doubles(&values);
    let rows = values.len() / observables.max(1);
    let mut results = vec![Ok(()); rows];
    for (row, cause) in failures {
        if let Some(result) = results.get_mut(row) {
            *result = Err(SimError::recoverable(cause));
        }
    }
    Ok(Answer { values, results })
}

/// Numbers as the bytes that `numpy.frombuffer` reads.
pub(crate) fn bytes<'py>(py: Python<'py>, numbers: &[f64]) -> Bound<'py, PyBytes> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_ne_bytes()).collect();
    PyBytes::new(py, &bytes)
}

/// Numbers from the bytes of an array of doubles.
pub(crate) fn doubles(bytes: &[u8]) -> Vec<f64> {
    let (numbers, _) = bytes.as_chunks::<8>();
    numbers.iter().map(|number| f64::from_ne_bytes(*number)).collect()
}
