//! Many curves side by side.

use super::Verlet;
use super::clock::Clock;
use super::pair::{Pair, Scheme};
use crate::kinetics::{RateCoefficients, WithLaw, with_law};
use crate::lanes::{F64x8, Lanes, WIDTH};
use crate::{Kinetic, Kinetics, PairScene, Sintering, SolveError, SolveReport, SolverSettings};
use std::marker::PhantomData;

/// Contact ratios of many parameter vectors by the Verlet solver, eight at a time in the lanes of the
/// processor's vectors; the same bits as one by one.
///
/// `contact_ratio` has a row of `times_s.len()` places for each of `sinterings`. A lane whose curve
/// has ended takes the next one. Each curve has its own result.
///
/// # Errors
///
/// A [`SolveError`] for settings, times or a buffer that would fail every curve.
pub fn verlet_batch(
    scene: &PairScene,
    kinetics: Kinetics,
    sinterings: &[Sintering],
    settings: &SolverSettings,
    times_s: &[f64],
    contact_ratio: &mut [f64],
) -> Result<Vec<Result<SolveReport, SolveError>>, SolveError> {
    struct Work<'a> {
        scene: &'a PairScene,
        sinterings: &'a [Sintering],
        solver: Verlet,
        times_s: &'a [f64],
        contact_ratio: &'a mut [f64],
    }
    impl WithLaw for Work<'_> {
        type Output = Vec<Result<SolveReport, SolveError>>;
        fn run<K: Kinetic>(self) -> Self::Output {
            pulp::Arch::new().dispatch(InLanes::<K>(self, PhantomData))
        }
    }
    /// As a closure the work would be called through a function of the narrow instructions.
    struct InLanes<'a, K>(Work<'a>, PhantomData<K>);
    impl<K: Kinetic> pulp::NullaryFnOnce for InLanes<'_, K> {
        type Output = Vec<Result<SolveReport, SolveError>>;
        #[inline(always)]
        fn call(self) -> Self::Output {
            let Work { scene, sinterings, solver, times_s, contact_ratio } = self.0;
            run_lanes::<K>(scene, sinterings, &solver, times_s, contact_ratio)
        }
    }
    crate::solvers::entry::check_times(times_s)?;
    let places = sinterings.len() * times_s.len();
    if contact_ratio.len() != places {
        return Err(SolveError::OutputLength { out: contact_ratio.len(), times: places });
    }
    let solver = Verlet::new(scene, settings)?;
    Ok(with_law(kinetics, Work { scene, sinterings, solver, times_s, contact_ratio }))
}

/// A curve on its way through a lane.
struct Curve<'a> {
    index: usize,
    clock: Clock<'a>,
}

#[inline(always)]
fn run_lanes<K: Kinetic>(
    scene: &PairScene,
    sinterings: &[Sintering],
    solver: &Verlet,
    times_s: &[f64],
    contact_ratio: &mut [f64],
) -> Vec<Result<SolveReport, SolveError>> {
    let mut results: Vec<_> = sinterings.iter().map(|_| Err(SolveError::NoTimes)).collect();
    let mut waiting = sinterings.iter().enumerate();
    let start = Pair::start(scene, solver.from_contact);
    let mut pairs = Pair::splat(&start);
    let step_s = F64x8::splat(solver.step_s());
    let mut coefficients = RateCoefficients::splat(&RateCoefficients::NONE);
    let mut lanes: [Option<Curve<'_>>; WIDTH] = [const { None }; WIDTH];
    loop {
        for (i, lane) in lanes.iter_mut().enumerate() {
            while lane.is_none() {
                let Some((index, sintering)) = waiting.next() else { break };
                match K::new(scene, sintering) {
                    Ok(law) => {
                        let scheme = Scheme::new(scene, solver.step_s(), &law.coefficients());
                        let mut pair = start;
                        scheme.set_off::<K>(solver.step_s(), &mut pair);
                        coefficients.set_lane(i, &scheme.coefficients);
                        pairs.set_lane(i, &pair);
                        *lane = Some(Curve {
                            index,
                            clock: Clock::new(&solver.stepping, scene, times_s),
                        });
                    }
                    Err(error) => results[index] = Err(error),
                }
            }
        }
        let Some(steps) =
            lanes.iter().flatten().filter_map(|curve| curve.clock.steps_to_event()).min()
        else {
            return results;
        };
        let scheme = Scheme::<F64x8>::new(scene, solver.step_s(), &coefficients);
        for _ in 0..steps {
            scheme.step::<K>(step_s, &mut pairs);
        }
        for (i, lane) in lanes.iter_mut().enumerate() {
            let Some(curve) = lane else { continue };
            let row = &mut contact_ratio[curve.index * times_s.len()..][..times_s.len()];
            let outcome = curve.clock.event(steps, &pairs.lane(i), &mut |index, x: f64, _| {
                row[index] = Lanes::max(x, 0.0).sqrt();
            });
            match outcome {
                Ok(()) if curve.clock.steps_to_event().is_some() => continue,
                Ok(()) => results[curve.index] = Ok(curve.clock.report()),
                Err(error) => results[curve.index] = Err(error),
            }
            // The lane runs on, unobserved, until it is taken again.
            *lane = None;
        }
    }
}
