//! The beds of all draws, several at a time.
//!
//! Each thread takes one bed after the other and computes it alone: with more draws than threads that wastes nothing, and
//! the bits of a bed do not depend on it. What the phases before the heat leave is the same for all draws (unless phi
//! was calibrated) and is computed once.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Sender;

use dem_core::bed::{BedError, Growing, Run, Scene, SceneFile};

use super::curve::{Curve, Moment};
use crate::run;

/// Relative density at which a bed is full and its run ends.
const FULL: f64 = 1.0;

/// A bed to compute.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bed {
    /// Place of the draw among those that were chosen.
    pub(super) draw: usize,
    /// How its contacts grow.
    pub(super) growing: Growing,
    /// Its final contact ratio, where that was calibrated.
    pub(super) phi: Option<f64>,
}

/// What the threads say.
#[derive(Debug)]
pub(super) enum Message {
    /// The scene could not be built, or not brought to its heated phase; nothing else comes.
    NoScene(BedError),
    /// The particles are in their places.
    Ready {
        /// Whether the bed has a volume, and with it a relative density.
        has_density: bool,
    },
    /// Another observation of some bed.
    Observed,
    /// The bed of a draw.
    Done(usize, Curve),
    /// A bed that could not be computed to its end.
    Failed(usize, BedError),
}

/// Computes beds on so many threads, until all are done or nobody listens any more.
pub(super) fn compute(
    file: &SceneFile,
    beds: Vec<Bed>,
    threads: rayon::ThreadPool,
    send: &Sender<Message>,
) {
    let prepared = threads.install(|| prepare(file, &beds));
    let (scene, settled) = match prepared {
        Ok(prepared) => prepared,
        Err(error) => {
            let _ = send.send(Message::NoScene(error));
            return;
        }
    };
    let has_density = scene.bed().bed_volume_m3().is_some();
    if send.send(Message::Ready { has_density }).is_err() {
        return;
    }
    let count = threads.current_num_threads().min(beds.len());
    drop(threads);
    let (scene, settled, beds) = (Arc::new(scene), Arc::new(settled), Arc::new(beds));
    let next = Arc::new(AtomicUsize::new(0));
    let workers: Vec<_> = (0..count)
        .map(|_| {
            let (scene, settled, beds) = (scene.clone(), settled.clone(), beds.clone());
            let (next, send) = (next.clone(), send.clone());
            std::thread::spawn(move || {
                let Ok(alone) = run::pool(Some(1)) else { return };
                while let Some(bed) = beds.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let computed = alone.install(|| one(&scene, &settled, bed, &send));
                    let message = match computed {
                        Ok(curve) => Message::Done(bed.draw, curve),
                        Err(error) => Message::Failed(bed.draw, error),
                    };
                    if send.send(message).is_err() {
                        return;
                    }
                }
            })
        })
        .collect();
    for worker in workers {
        // A thread that panicked is missed by whoever counts the beds.
        let _ = worker.join();
    }
}

/// The scene, and its run up to the heat.
fn prepare(file: &SceneFile, beds: &[Bed]) -> Result<(Scene, Run), BedError> {
    let scene = file.build()?;
    let mut run = scene.start();
    if beds.iter().any(|bed| bed.phi.is_none()) {
        settle(&mut run)?;
    }
    Ok((scene, run))
}

fn settle(run: &mut Run) -> Result<(), BedError> {
    while run.next_phase().is_some_and(|phase| !phase.heated) {
        run.advance()?;
    }
    Ok(())
}

fn one(scene: &Scene, settled: &Run, bed: &Bed, send: &Sender<Message>) -> Result<Curve, BedError> {
    let mut run = match bed.phi {
        None => settled.clone(),
        Some(phi) => {
            let mut run = scene.clone().with_final_contact_ratio(phi)?.start();
            settle(&mut run)?;
            run
        }
    };
    run.set_growing(bed.growing)?;
    let heated_from_s = run.bed().time_s();
    let mut curve = Curve::default();
    while let Some(progress) = run.advance()? {
        curve.moments.push(Moment::of(&progress.sample, heated_from_s));
        // Nobody listens once the user has interrupted; the process ends by itself then.
        let _ = send.send(Message::Observed);
        if progress.sample.relative_density >= FULL {
            break;
        }
    }
    curve.error_estimate = run.series().quasi_static.error_estimate;
    Ok(curve)
}
