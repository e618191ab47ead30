//! The beds of all draws, several at a time.
//!
//! Each thread takes one bed after the other and computes it alone: with more draws than threads that wastes nothing, and
//! the bits of a bed do not depend on it. The phases before the heat are the same for all draws (unless phi was
//! calibrated) and are computed once. A bed that is finished is kept in a file, and found again by the same plan.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Sender;

use dem_core::Sintering;
use dem_core::bed::{BedError, Growing, Run, Scene, SceneFile, SinteringTable};
use dem_core::heat::Heat;

use super::agreement::no_volume;
use super::curve::{Curve, Moment, Target};
use super::draws::Draw;
use crate::error::Failure;
use crate::input::scene_file::{self, SceneInput};
use crate::output::pool;
use crate::output::work_folder::{WorkFolder, fingerprint};
use crate::pair::draws::PairDraws;
use crate::pair::parameter::ParameterName;
use crate::watch::Watch;
use crate::worker::Worker;

/// Relative density at which a bed is full and its run ends.
const FULL: f64 = 1.0;

/// The beds that are wanted.
pub(super) struct Wanted<'a> {
    pub(super) input: &'a SceneInput,
    pub(super) sintering: &'a SinteringTable,
    pub(super) calibrated: &'a PairDraws,
    pub(super) draws: &'a [Draw],
    pub(super) target: Target,
    /// Everything that a bed depends on, the draw apart.
    pub(super) plan: &'a str,
}

/// The file of a draw's bed.
pub(super) fn file_name(draw: &Draw) -> String {
    format!("draw-{:06}.csv", draw.row)
}

impl Wanted<'_> {
    /// The bed of a draw as a file.
    pub(super) fn file(&self, draw: &Draw, curve: &Curve) -> String {
        curve.file(&self.belongs_to(draw))
    }

    fn belongs_to(&self, draw: &Draw) -> String {
        format!("densify {:016x}, draw {}", fingerprint(self.plan), draw.row)
    }

    /// The beds of all draws, in their order: those of earlier work, in the work folder or in the folder `published`,
    /// and the others.
    pub(super) fn beds(
        &self,
        published: &Path,
        work: &WorkFolder,
        threads: rayon::ThreadPool,
        watch: &dyn Watch,
    ) -> Result<Vec<Result<Curve, BedError>>, Failure> {
        let mut curves: Vec<Option<Result<Curve, BedError>>> =
            self.draws.iter().map(|draw| self.kept(draw, published, work).map(Ok)).collect();
        let kept = curves.iter().flatten().count();
        if kept > 0 {
            let all = self.draws.len();
            watch.note(&format!("the beds of {kept} of {all} draws are there already"));
        }
        let missing: Vec<Bed> = (0..curves.len())
            .filter(|&draw| curves[draw].is_none())
            .map(|draw| self.bed(draw))
            .collect();
        if !missing.is_empty() {
            let computed = self.compute(missing, &mut curves, work, threads, watch);
            watch.end();
            computed?;
        }
        let curves: Vec<Result<Curve, BedError>> = curves.into_iter().flatten().collect();
        match curves.first() {
            Some(Err(error)) if curves.iter().all(Result::is_err) => Err(scene_file::failed(
                &self.input.place,
                error,
                Some("the beds of all draws failed; this is the first of them"),
            )),
            _ => Ok(curves),
        }
    }

    fn kept(&self, draw: &Draw, published: &Path, work: &WorkFolder) -> Option<Curve> {
        let name = file_name(draw);
        let text = work.get(&name).or_else(|| fs::read(published.join(&name)).ok())?;
        Curve::parse(&String::from_utf8(text).ok()?, &self.belongs_to(draw))
    }

    fn bed(&self, draw: usize) -> Bed {
        let chosen = &self.draws[draw];
        let (growing, phi) = self.growing(chosen);
        Bed { draw, growing, phi, heat: chosen.heat.clone() }
    }

    /// How the contacts of a draw grow, and its final contact ratio where that was calibrated.
    pub(super) fn growing(&self, draw: &Draw) -> (Growing, Option<f64>) {
        let table = self.sintering;
        let scene =
            Sintering { c1: table.c1, tau_s: table.tau_s, delta_c: table.delta_c, lambda: 0.0 };
        let growing = Growing {
            kinetics: self.calibrated.pair.kinetics,
            sintering: self.calibrated.sintering(draw.row, scene),
            calibrated_radius_m: self.calibrated.pair.powder.radius_m,
        };
        (growing, self.calibrated.value(ParameterName::Phi, draw.row))
    }

    fn compute(
        &self,
        missing: Vec<Bed>,
        curves: &mut [Option<Result<Curve, BedError>>],
        work: &WorkFolder,
        threads: rayon::ThreadPool,
        watch: &dyn Watch,
    ) -> Result<(), Failure> {
        let phases = &self.input.file.phases;
        let per_bed: usize =
            phases.iter().skip_while(|phase| !phase.heated).map(|phase| phase.outputs + 1).sum();
        let count = missing.len();
        watch.begin((count * per_bed) as u64, 0, "observations");
        watch.now("placing the particles");
        let scene = self.input.file.clone();
        let worker = Worker::start(move |send| compute(&scene, missing, threads, send));
        let mut done = 0;
        while done < count {
            match worker.next(watch)? {
                None => {
                    let kept = curves.iter().flatten().count();
                    return Err(Failure::Paused(format!(
                        "interrupted; the beds of {kept} of {} draws are kept, and the same command goes on with the others",
                        self.draws.len()
                    )));
                }
                Some(Message::NoScene(error)) => {
                    return Err(scene_file::failed(&self.input.place, &error, None));
                }
                Some(Message::Ready { has_density }) => {
                    if matches!(self.target, Target::RelativeDensity(_)) && !has_density {
                        return Err(no_volume(self.input).into());
                    }
                }
                Some(Message::Observed) => watch.advance(),
                Some(Message::Done(draw, curve)) => {
                    done += 1;
                    // A bed that was full ends before the scene does.
                    (curve.moments.len()..per_bed).for_each(|_| watch.advance());
                    watch.now(&format!("{done} of {count} beds"));
                    let chosen = &self.draws[draw];
                    work.put(&file_name(chosen), self.file(chosen, &curve).as_bytes())?;
                    curves[draw] = Some(Ok(curve));
                }
                Some(Message::Failed(draw, error)) => {
                    done += 1;
                    curves[draw] = Some(Err(error));
                }
            }
        }
        Ok(())
    }
}

/// A bed to compute.
#[derive(Debug, Clone, PartialEq)]
struct Bed {
    /// Place of the draw among those that were chosen.
    draw: usize,
    /// How its contacts grow.
    growing: Growing,
    /// Its final contact ratio, where that was calibrated.
    phi: Option<f64>,
    /// Its heat; none at the temperature of its parameters.
    heat: Option<Heat>,
}

/// Messages of the threads.
#[derive(Debug)]
enum Message {
    /// The scene could not be built, or not brought to its heated phase; nothing else comes.
    NoScene(BedError),
    /// The particles are in their places.
    Ready {
        /// Whether the bed has a volume, and with it a relative density.
        has_density: bool,
    },
    /// Another observation of a bed.
    Observed,
    /// The bed of a draw.
    Done(usize, Curve),
    /// A bed that could not be computed to its end.
    Failed(usize, BedError),
}

/// Computes beds on so many threads, until all are done or nobody listens any more.
fn compute(file: &SceneFile, beds: Vec<Bed>, threads: rayon::ThreadPool, send: &Sender<Message>) {
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
                let Ok(alone) = pool(Some(1)) else { return };
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
    if let Some(heat) = &bed.heat {
        run.set_heat(heat.clone())?;
    }
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
    curve.close(run.series(), heated_from_s);
    Ok(curve)
}
