//! The run of a scene, in a thread of its own: what it hands over is written to the work folder and shown as progress.

use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use dem_core::bed::{BedError, Run, Sample, Scene, write_vtk};
use dem_core::heat::Heat;
use figures::BedFigure;

use super::picture::bed_figure;
use crate::error::Failure;
use crate::input::scene_file::{self, SceneInput};
use crate::number::significant;
use crate::output::work_folder::WorkFolder;
use crate::watch::Watch;
use crate::worker::Worker;

/// A checkpoint is written at observations at least so far apart.
const CHECKPOINT_EVERY: Duration = Duration::from_millis(300);
const CHECKPOINT: &str = "checkpoint";

/// Messages of the working thread.
enum Message {
    /// The packing was made: the bed at the start, and the number of observations taken over from earlier work.
    Placed { start: BedFigure, observed: usize },
    /// An observation, with the files of this moment.
    Observed { sample: Sample, checkpoint: Option<Vec<u8>>, vtk: Option<Vec<u8>>, number: usize },
    /// The run has ended.
    Done(Box<Run>),
    /// The run has failed.
    Failed(BedError),
}

/// A run that has ended.
pub(super) struct Computed {
    pub(super) run: Run,
    /// The bed at the start.
    pub(super) first: BedFigure,
}

/// Number of observations of a scene.
fn observations(input: &SceneInput) -> usize {
    input.file.phases.iter().map(|phase| phase.outputs + 1).sum()
}

/// The VTK file of an observation.
pub(super) fn vtk_name(number: usize) -> String {
    format!("bed-{number:05}.vtk")
}

/// Runs the scene from its start, or from the checkpoint in the work folder, to its end.
pub(super) fn compute(
    (input, heat): (&SceneInput, &Option<Heat>),
    vtk: bool,
    work: &WorkFolder,
    threads: rayon::ThreadPool,
    watch: &dyn Watch,
) -> Result<Computed, Failure> {
    let engine =
        Engine { input: input.clone(), heat: heat.clone(), checkpoint: work.get(CHECKPOINT), vtk };
    let worker = Worker::start(move |send| threads.install(|| engine.work(send)));
    let total = observations(input);
    watch.begin(total as u64, 0, "observations");
    watch.now("placing the particles");
    let mut first = BedFigure::default();
    let mut kept = None;
    while let Some(message) = worker.next(watch)? {
        match message {
            Message::Placed { start, observed } => {
                first = start;
                watch.begin(total as u64, observed as u64, "observations");
                if observed > 0 {
                    watch.note(&format!("going on after {observed} of {total} observations"));
                    kept = Some(observed);
                }
            }
            Message::Observed { sample, checkpoint, vtk, number } => {
                if let Some(bytes) = vtk {
                    work.put(&vtk_name(number), &bytes)?;
                }
                if let Some(bytes) = checkpoint {
                    work.put(CHECKPOINT, &bytes)?;
                    kept = Some(number + 1);
                }
                watch.advance();
                watch.now(&format!(
                    "t = {} s, a/R {}",
                    significant(sample.time_s, 3),
                    significant(sample.mean_contact_ratio, 3)
                ));
            }
            Message::Done(run) => {
                // A run that ends where necks meet makes fewer observations than the scene has.
                (run.series().samples.len()..total).for_each(|_| watch.advance());
                return Ok(Computed { run: *run, first });
            }
            Message::Failed(error) => {
                // Any other remedy makes another scene, which begins anew.
                let limited = matches!(error, BedError::WorkLimit { .. });
                let kept = kept.filter(|_| limited).map(|observed| in_words(observed, total));
                return Err(scene_file::failed(&input.place, &error, kept.as_deref()));
            }
        }
    }
    let kept = kept.map_or_else(|| "nothing was computed yet".to_owned(), |k| in_words(k, total));
    Err(Failure::Paused(format!("interrupted; {kept}")))
}

fn in_words(observed: usize, total: usize) -> String {
    format!("{observed} of {total} observations are kept, and the same command goes on from there")
}

/// Work of the computing thread.
struct Engine {
    input: SceneInput,
    heat: Option<Heat>,
    checkpoint: Option<Vec<u8>>,
    vtk: bool,
}

impl Engine {
    fn work(&self, send: &Sender<Message>) {
        let last = match self.through(send) {
            Ok(run) => Message::Done(Box::new(run)),
            Err(error) => Message::Failed(error),
        };
        // Nobody listens once the user has interrupted.
        let _ = send.send(last);
    }

    fn through(&self, send: &Sender<Message>) -> Result<Run, BedError> {
        let scene: Scene = self.input.file.build()?;
        let scene = match &self.heat {
            Some(heat) => scene.with_heat(heat.clone()),
            None => scene,
        };
        // Without a checkpoint that can be read, the run starts again.
        let resumed = self.checkpoint.as_ref().and_then(|bytes| scene.resume(bytes).ok());
        let mut run = resumed.unwrap_or_else(|| scene.start());
        let start = bed_figure(scene.bed(), &self.input.file.name);
        let _ = send.send(Message::Placed { start, observed: run.series().samples.len() });
        let mut stored = Instant::now();
        while let Some(progress) = run.advance()? {
            let checkpoint = (stored.elapsed() >= CHECKPOINT_EVERY).then(|| {
                stored = Instant::now();
                run.checkpoint()
            });
            let vtk = self.vtk.then(|| {
                let mut bytes = Vec::new();
                // Writing to memory cannot fail.
                let _ = write_vtk(run.bed(), &mut bytes);
                bytes
            });
            let number = run.series().samples.len() - 1;
            let sample = progress.sample;
            if send.send(Message::Observed { sample, checkpoint, vtk, number }).is_err() {
                break;
            }
        }
        Ok(run)
    }
}
