//! Cost of a step of a bed: particle steps per second, contacts per particle, bytes per particle.
//!
//! Under `valgrind --tool=callgrind`, two runs of different numbers of steps give the instructions per particle
//! step: `crates/studies/bed/instructions.sh` makes the table.

use std::io::Write as _;
use std::time::Instant;

use dem_core::{Kinetics, PairSpec, SolverKind, SolverSettings, paper, simulate};
use workbench::error::{Failure, RunError};

use super::lammps;
use super::packing::{SINTERING, Scene};
use crate::args::BedCostArgs;
use crate::seeds::threads;
use crate::timing::Clock;

pub(crate) fn run(args: &BedCostArgs) -> Result<(), Failure> {
    let line = match &args.lammps {
        Some(folder) => return Ok(lammps::write(args, folder)?),
        None if args.scene == "pair-solver" => pair_solver(args.steps)?,
        None => threads(args.threads)?.install(|| measured(args))?,
    };
    writeln!(std::io::stdout().lock(), "{line}")?;
    Ok(())
}

fn measured(args: &BedCostArgs) -> Result<String, RunError> {
    let BedCostArgs { scene, particles, steps, threads, .. } = args;
    let mut bed = Scene(scene).bed(*particles).map_err(RunError::new)?;
    bed.advance(20).map_err(RunError::new)?;
    let start = Instant::now();
    let (processor_s, ran) = Clock::Process.measure(|| bed.advance(*steps));
    let wall_s = start.elapsed().as_secs_f64();
    ran.map_err(RunError::new)?;
    let n = bed.particles().len();
    let particle_steps = n as f64 * *steps as f64;
    Ok(format!(
        "{scene} N {n} threads {threads}: {:.3e} particle steps/s, {:.3e} per second of a core, {:.2} contacts, {} bytes per particle, {:?}",
        particle_steps / wall_s,
        particle_steps / processor_s,
        bed.sample().coordination,
        bed.memory_bytes() / n,
        bed.work(),
    ))
}

/// The same pair through the solver for pairs.
fn pair_solver(steps: u64) -> Result<String, RunError> {
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build().map_err(RunError::new)?;
    let settings = SolverSettings::of(SolverKind::Verlet);
    let end_s = steps as f64 * settings.step_over_collision_time * scene.collision_time_s();
    let curve = simulate(&scene, Kinetics::ThreeStage, &SINTERING, &settings, &[end_s])
        .map_err(RunError::new)?;
    Ok(format!("pair-solver: {:?}", curve.contact_ratio))
}
