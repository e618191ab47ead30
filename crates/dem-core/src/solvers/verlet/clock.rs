//! Steps of a curve from observation to observation, and the reason for its end.

use super::pair::Pair;
use crate::solvers::{SolveReport, SolverKind, StopReason};
use crate::{PairScene, SolveError};

/// The time step and where a run ends before its last observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stepping {
    pub(super) step_s: f64,
    pub(super) stop_when_coalesced: bool,
    pub(super) max_work: u64,
}

/// Counts the steps of one curve from observation to observation.
#[derive(Debug, Clone)]
pub(super) struct Clock<'a> {
    stepping: Stepping,
    times_s: &'a [f64],
    observed: usize,
    steps: u64,
    stop: Option<StopReason>,
    final_overlap: f64,
    end_plastic: f64,
    /// h omega, the scale of a drift at rest.
    phase: f64,
}

/// Steps after which a run looks again whether the pair is at rest, fully coalesced.
const LOOK_EVERY: u64 = 256;

/// Distance from full coalescence, in radii, below which the pair is coalesced.
const AT_REST: f64 = 1e-12;

impl<'a> Clock<'a> {
    pub(super) fn new(stepping: &Stepping, scene: &PairScene, times_s: &'a [f64]) -> Self {
        let final_overlap = scene.final_overlap();
        Self {
            stepping: *stepping,
            times_s,
            observed: 0,
            steps: 0,
            stop: None,
            final_overlap,
            end_plastic: scene.law().equilibrium_plastic_overlap(final_overlap),
            phase: stepping.step_s * (scene.k1_n_per_m() / scene.effective_mass_kg()).sqrt(),
        }
    }

    /// Steps until the next event (an observation, a look for rest, the work limit); `None` when the run is over.
    pub(super) fn steps_to_event(&self) -> Option<u64> {
        let &time_s = self.times_s.get(self.observed)?;
        // First step at or after the time; saturates, and the work limit comes first.
        let observation = (time_s / self.stepping.step_s).ceil() as u64;
        let look = (self.steps / LOOK_EVERY + 1) * LOOK_EVERY;
        let work = self.stepping.max_work.max(self.steps);
        Some(observation.max(self.steps).min(look).min(work) - self.steps)
    }

    /// Handles the event after that many steps.
    pub(super) fn event(
        &mut self,
        steps: u64,
        pair: &Pair<f64>,
        observe: &mut impl FnMut(usize, f64, f64),
    ) -> Result<(), SolveError> {
        self.steps += steps;
        let step_s = self.stepping.step_s;
        while let Some(&time_s) = self.times_s.get(self.observed) {
            let behind = self.steps as f64 - time_s / step_s;
            if behind < 0.0 {
                break;
            }
            let (x, p) = pair.at((1.0 - behind).clamp(0.0, 1.0));
            observe(self.observed, x, p);
            self.observed += 1;
        }
        let Some(last_s) = self.times_s.last().filter(|_| self.observed < self.times_s.len())
        else {
            self.stop = Some(StopReason::LastObservation);
            return Ok(());
        };
        let rests = self.stepping.stop_when_coalesced
            && pair.plastic >= self.end_plastic
            && (pair.overlap - self.final_overlap).abs() < AT_REST
            && pair.drift.abs() < AT_REST * self.phase;
        if rests && self.steps.is_multiple_of(LOOK_EVERY) {
            self.stop = Some(StopReason::Coalesced);
            for index in self.observed..self.times_s.len() {
                observe(index, self.final_overlap, self.end_plastic);
            }
            self.observed = self.times_s.len();
        } else if self.steps >= self.stepping.max_work {
            return Err(SolveError::WorkLimit {
                solver: "verlet",
                max_work: self.stepping.max_work,
                reached_s: self.steps as f64 * step_s,
                last_s: *last_s,
            });
        }
        Ok(())
    }

    pub(super) fn report(&self) -> SolveReport {
        SolveReport {
            kind: SolverKind::Verlet,
            steps: self.steps,
            force_evaluations: self.steps,
            error_estimate: None,
            stop: self.stop.unwrap_or(StopReason::LastObservation),
            quasi_static_lag: None,
        }
    }
}
