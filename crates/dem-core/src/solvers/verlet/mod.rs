//! The full discrete-element run of the pair.

mod batch;
mod clock;
mod pair;

pub use batch::verlet_batch;

use super::{PairRun, PairSolver, SolveReport, SolverSettings};
use crate::heat::Pace;
use crate::{Kinetic, PairScene, SolveError};
use clock::{Clock, Stepping};
use pair::{Pair, Scheme};

/// Newton's law for the relative coordinate of the pair, by velocity Verlet, with the plastic overlap
/// integrated implicitly within each step: the scheme is written out in `pair.rs` of this module.
///
/// Second order in the step where the step resolves the relaxation of the contact,
/// `alpha/(kappa rate)`; about order 1.5 over the singular start of zipping, where no step does
/// (1e-4 of a/R for PS at 0.02 t_c); of first order in the one step across the bend of the rate at the
/// knee. The rate is driven by the whole contact force without adhesion,
/// damping included.
///
/// # Bounds of a step
///
/// Inertia lets the overlap swing about its equilibrium, at most as far beyond phi^2 as it started below: a/R
/// stays below `sqrt(2) phi`, and nothing is clamped. The plastic overlap falls only
///
/// - on the cohesive branch;
/// - in a rebound. Zipping that is faster than the particles can follow lets them fall towards each other with
///   all of fa, so that they arrive at the knee with at most `v = sqrt(2 fa phi^2 R/m_eff)`. There growth all but
///   stops, the contact takes up the momentum as a spring, and in the swing back it pulls with at most
///   `K2 v/omega2`, that is `sqrt(kappa 2 phi^2/alpha)` times fa, for `pi/omega2 = pi/(omega sqrt(kappa))`. Stretching runs
///   backwards meanwhile: delta0 falls by at most `(R/tau_s) G (pi/omega) sqrt(2 phi^2/alpha)` in each swing, `omega^2 = K1/m_eff`;
/// - after a first step far longer than the relaxation of the contact. There the implicit update, linear in the
///   plastic overlap, overshoots by at most `q x0/(1 - q x0)` of x0, `q = (K2max/K1 - 1)/phi^2`: 0.6 % of x0 for full
///   coalescence.
///
/// # Speed
///
/// A single curve waits for its own last step. From one new plastic overlap to the next the chain of
/// dependent operations is 13 additions or multiplications, the square root and the division of the
/// zipping rate, and two comparisons: with 3 cycles for each of the first, 20 and 13 for the others,
/// about 75 cycles, which is 25 ns at 3 GHz; 26 ns are measured. Only other curves can fill the
/// wait: [`verlet_batch`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verlet {
    stepping: Stepping,
    from_contact: bool,
}

impl Verlet {
    /// # Errors
    ///
    /// [`SolveError::UnstableStep`] for a step at or above `2 sqrt(m_eff/K2max)`,
    /// [`SolveError::Field`] for one that is not positive.
    pub fn new(scene: &PairScene, settings: &SolverSettings) -> Result<Self, SolveError> {
        let step_over_collision_time = settings.step_over_collision_time;
        if !(1e-9..f64::INFINITY).contains(&step_over_collision_time) {
            return Err(SolveError::Field {
                field: "step_over_collision_time",
                value: step_over_collision_time,
                remedy: "use a positive step, 1e-9 or more; 0.02 is usual",
            });
        }
        let (step_s, limit_s) =
            (step_over_collision_time * scene.collision_time_s(), scene.step_limit_s());
        if step_s >= limit_s {
            return Err(SolveError::UnstableStep { step_over_collision_time, step_s, limit_s });
        }
        Ok(Self {
            stepping: Stepping {
                step_s,
                stop_when_coalesced: settings.stop_when_coalesced,
                max_work: settings.max_work,
            },
            from_contact: settings.from_contact,
        })
    }

    /// The time step \[s\].
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.stepping.step_s
    }

    fn run<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        observe: &mut impl FnMut(usize, f64, f64),
    ) -> Result<SolveReport, SolveError> {
        let PairRun { scene, law, mut pace, times_s } = *run;
        let step_s = self.step_s();
        let scheme = Scheme::<f64>::new(scene, step_s, &law.coefficients());
        let mut pair = Pair::start(scene, self.from_contact);
        let mut made = 0u64;
        // The step in reduced time, by m at its middle.
        let mut growing_s = |made: u64| {
            let middle_s = if P::VARIES { (made as f64 + 0.5) * step_s } else { 0.0 };
            pace.seek(middle_s);
            pace.scaled(middle_s, step_s)
        };
        scheme.set_off::<K>(growing_s(made), &mut pair);
        let mut clock = Clock::new(&self.stepping, scene, times_s);
        while let Some(steps) = clock.steps_to_event() {
            for _ in 0..steps {
                scheme.step::<K>(growing_s(made), &mut pair);
                made += 1;
            }
            clock.event(steps, &pair, observe)?;
        }
        Ok(clock.report())
    }
}

impl PairSolver for Verlet {
    fn contact_ratios<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        contact_ratio: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        self.run(run, &mut |index, x: f64, _| {
            contact_ratio[index] = x.max(0.0).sqrt();
        })
    }

    fn overlaps<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        overlap: &mut [f64],
        plastic_overlap: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        self.run(run, &mut |index, x, p| {
            overlap[index] = x.max(0.0);
            plastic_overlap[index] = p;
        })
    }
}
