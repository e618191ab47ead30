//! The integrator, piece by piece.

use differential_equations::methods::ImplicitRungeKutta;
use differential_equations::ode::{ODE as _, OrdinaryNumericalMethod};
use differential_equations::status::Status;
use thiserror::Error;

use super::system::{Piece, State, System};

/// An error of a reference.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub(crate) enum ReferenceError {
    /// The motion leaves the elastic branch of the contact law, on which alone it is integrated.
    #[error("the motion leaves the elastic branch at t = {time_s} s: compare another case")]
    OtherBranch {
        /// Time \[s\].
        time_s: f64,
    },
    /// The integrator used all the steps it was allowed.
    #[error(
        "more than {max_steps} steps before t = {time_s} s: allow more, or compare another case"
    )]
    WorkLimit {
        /// The limit.
        max_steps: u64,
        /// Time reached \[s\].
        time_s: f64,
    },
    /// The integrator failed.
    #[error("Radau failed at t = {time_s} s: {cause}")]
    Integrator {
        /// Time \[s\].
        time_s: f64,
        /// Its message.
        cause: String,
    },
    /// The result still moves at the tightest tolerance.
    #[error("a/R still moves by {movement:e} at the tightest tolerance, {wanted:e} is wanted")]
    StillMoves {
        /// Largest change of a/R over the last two tightenings.
        movement: f64,
        /// Largest change wanted.
        wanted: f64,
    },
}

/// The tightest relative tolerance that the integrator takes.
const TIGHTEST: f64 = 1.1e-11;

/// The step taken for the one that the integrator wants: about as long, and half of that.
///
/// Steps are powers of the square root of two: version 0.7 of the integrator goes on with matrices of the
/// old step where a step grows by less than a fifth and then changes, and takes Newton iterations for
/// converged that are not.
const STEPS: [fn(f64) -> f64; 2] = [|h| rounded(h), |h| rounded(0.5 * h)];

fn rounded(step: f64) -> f64 {
    (0.5 * (2.0 * step.log2()).floor()).exp2()
}

/// Share of the tolerance at which Newton's iteration ends: near the least that rounding allows at the
/// tightest tolerance.
const NEWTON_TOLERANCE: f64 = 3e-5;

/// A run of the integrator over one curve.
pub(super) struct Run {
    system: System,
    tolerance: f64,
    max_steps: u64,
    steps: u64,
    last_step: f64,
    newton_tolerance: f64,
}

impl Run {
    pub(super) fn new(system: System, tolerance: f64, max_steps: u64) -> Self {
        Self {
            system,
            tolerance,
            max_steps,
            steps: 0,
            last_step: 0.0,
            newton_tolerance: NEWTON_TOLERANCE,
        }
    }

    /// Steps so far.
    pub(super) fn steps(&self) -> u64 {
        self.steps
    }

    pub(super) fn overlap(&self, state: &State) -> f64 {
        self.system.overlap(state)
    }

    /// From one time to a later one, over as many pieces as there are.
    pub(super) fn to(
        &mut self,
        mut state: State,
        mut now: f64,
        until: f64,
    ) -> Result<State, ReferenceError> {
        while now < until {
            let (time, reached, ended) = self.piece(state, now, until)?;
            (now, state) = (time, reached);
            if ended {
                self.system.piece = self.system.next_piece(&state);
                if self.system.piece == Piece::Coalesced {
                    state[2] = self.system.end_plastic;
                }
                self.last_step = 0.0;
            }
        }
        Ok(state)
    }

    /// One piece, up to its end (third) or to `until`.
    fn piece(
        &mut self,
        from: State,
        now: f64,
        until: f64,
    ) -> Result<(f64, State, bool), ReferenceError> {
        let [before, last] = self.advance((now, from), until, true)?;
        if self.system.until_end_of_piece(&last.1) <= 0.0 {
            let (time, state) = self.end_of_piece(before, last)?;
            return Ok((time, state, true));
        }
        Ok((last.0, last.1, false))
    }

    /// The end of the piece between two points, by the Illinois rule on runs from the first.
    fn end_of_piece(
        &mut self,
        from: (f64, State),
        to: (f64, State),
    ) -> Result<(f64, State), ReferenceError> {
        let value = |state: &State| self.system.until_end_of_piece(state);
        let (mut low, mut high) = ((from.0, value(&from.1)), (to.0, value(&to.1)));
        let mut best = to;
        for _ in 0..60 {
            let time = (high.0 * low.1 - low.0 * high.1) / (low.1 - high.1);
            if !(time > low.0 && time < high.0) || high.0 - low.0 <= 4e-16 * high.0 {
                break;
            }
            let [_, at] = self.advance(from, time, false)?;
            best = at;
            let miss = self.system.until_end_of_piece(&at.1);
            if miss.abs() <= 1e-15 {
                break;
            }
            if miss > 0.0 {
                low = (time, miss);
                high.1 *= 0.5;
            } else {
                high = (time, miss);
                low.1 *= 0.5;
            }
        }
        Ok(best)
    }

    /// The last two points of a run to `until`, or to the first step behind the end of the piece.
    fn advance(
        &mut self,
        from: (f64, State),
        until: f64,
        stops: bool,
    ) -> Result<[(f64, State); 2], ReferenceError> {
        let mut at = from;
        let mut radau = self.stepper(at, until, None)?;
        let mut refused = 0;
        loop {
            let (now, state) = at;
            let last = now + radau.h() >= until;
            if last && radau.h() != until - now {
                // Anew: the matrices belong to the step.
                radau = self.stepper(at, until, Some(until - now))?;
            }
            let step = radau.h();
            if self.steps >= self.max_steps {
                let time_s = now * self.system.time_unit_s;
                return Err(ReferenceError::WorkLimit { max_steps: self.max_steps, time_s });
            }
            if !(step > 0.0 && now + step > now) {
                return Err(self.failed(now, "the step vanished"));
            }
            self.steps += 1;
            let outcome = radau.step(&self.system);
            let is_finite = radau.y().iter().all(|y| y.is_finite());
            if outcome.is_err() || !is_finite {
                // It takes an estimate that is not a number for a small one.
                radau = self.stepper(at, until, Some(0.1 * step))?;
                continue;
            }
            if matches!(radau.status(), Status::RejectedStep) {
                refused += 1;
                if refused > 200 {
                    return Err(self.failed(now, "200 steps refused in a row"));
                }
                // Anew: it keeps a Jacobian that Newton's method does not converge with. And it may be
                // asked for more than rounding allows.
                self.newton_tolerance = if refused >= 2 { 1e-3 } else { NEWTON_TOLERANCE };
                radau = self.stepper(at, until, Some(0.4 * step))?;
                self.newton_tolerance = NEWTON_TOLERANCE;
                continue;
            }
            refused = 0;
            if !last {
                self.last_step = step;
            }
            at = (if last { until } else { radau.t() }, *radau.y());
            if stops && !self.system.is_elastic(&at.1) {
                return Err(ReferenceError::OtherBranch { time_s: at.0 * self.system.time_unit_s });
            }
            if last || (stops && self.system.until_end_of_piece(&at.1) <= 0.0) {
                return Ok([(now, state), at]);
            }
        }
    }

    fn stepper(
        &self,
        (now, state): (f64, State),
        until: f64,
        step: Option<f64>,
    ) -> Result<impl OrdinaryNumericalMethod<f64, State> + use<>, ReferenceError> {
        let mut slope = [0.0; 3];
        self.system.diff(now, &state, &mut slope);
        let first = step.unwrap_or_else(|| {
            if self.last_step > 0.0 {
                return self.last_step;
            }
            let scale = |i: usize| {
                let size = state[i].abs() + 1e-6;
                if slope[i] == 0.0 { f64::INFINITY } else { size / slope[i].abs() }
            };
            1e-4 * scale(0).min(scale(1)).min(scale(2))
        });
        let first = first.min(until - now);
        // It computes with 0.1 rtol^(2/3) of what it is given, and the absolute tolerance alike.
        let given = (10.0 * self.tolerance.max(TIGHTEST)).powf(1.5);
        let mut radau = ImplicitRungeKutta::radau5().rtol(given).atol(1e-3 * given).h0(first);
        radau.max_steps = usize::MAX;
        radau.newton_tol = self.newton_tolerance;
        radau
            .init(&self.system, now, until, &state)
            .map_err(|error| self.failed(now, &format!("{error:?}")))?;
        radau.set_status(Status::Solving);
        radau.filter = STEPS[self.halvings()];
        Ok(radau)
    }

    /// Whether the step is halved to be more precise than the integrator can be told to be.
    fn halvings(&self) -> usize {
        usize::from(self.tolerance < 0.5 * TIGHTEST)
    }

    fn failed(&self, now: f64, cause: &str) -> ReferenceError {
        let time_s = now * self.system.time_unit_s;
        ReferenceError::Integrator { time_s, cause: cause.to_owned() }
    }
}
