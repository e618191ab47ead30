//! Force balance at every instant, integrated with error control.

mod dormand_prince;
mod lag;

use super::{PairRun, PairSolver, SolveReport, SolverKind, SolverSettings, StopReason};
use crate::heat::Pace;
use crate::kinetics::RateCoefficients;
use crate::{ContactLaw, Kinetic, SolveError};
use dormand_prince::Step;

/// Integrates the plastic overlap of a pair without inertia,
/// `d(delta0)/dt = rate(delta) (d delta0/d delta)_eq` with `delta` from force balance, by the
/// embedded Runge-Kutta pair of Dormand and Prince with dense output.
///
/// The bend of the rate at the knee and the end at phi are located on the dense output and never
/// stepped over: each smooth piece of the rate is integrated separately, in its own time. The
/// singular start of zipping needs no care beyond small first steps: relative to the time since the
/// start they grow geometrically.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuasiStatic {
    tolerance: f64,
    max_work: u64,
}

/// Share of the tolerance that one step may use. Zipping forgets errors (its rate falls
/// with the overlap) and stretching adds them up over few steps.
const STEP_SHARE: f64 = 0.5;

/// Factor on the embedded error estimate, and the largest relative growth of the overlap in one step. On the power law of zipping the embedded estimate is up to ten times too small
/// for steps of that length (`dx/dt = x^(-5/2)`, 8 %), and a hundred times for steps three times as long.
const CAUTION: f64 = 10.0;
const TAIL_SHARE: f64 = 0.08;

/// Largest ratio of a step to the one before.
const LARGEST_GROWTH: f64 = 5.0;

impl QuasiStatic {
    /// # Errors
    ///
    /// [`SolveError::Field`] for a tolerance outside 1e-12 to 0.1.
    pub fn new(settings: &SolverSettings) -> Result<Self, SolveError> {
        let tolerance = settings.tolerance;
        if !(1e-12..=0.1).contains(&tolerance) {
            return Err(SolveError::Field {
                field: "tolerance",
                value: tolerance,
                remedy: "choose an error of a/R from 1e-12 to 0.1",
            });
        }
        Ok(Self { tolerance, max_work: settings.max_work })
    }

    /// Whether errors are small enough, and the ratio of a step that would meet them to this one.
    fn verdict(&self, error: f64, dense: f64) -> (bool, f64) {
        let (tolerance, step_tolerance) = (self.tolerance, STEP_SHARE * self.tolerance);
        let accepted = error <= step_tolerance && dense <= tolerance; // not so where NaN
        let growth = if error > 0.0 || dense > 0.0 {
            0.9 * (step_tolerance / error).powf(0.2).min((tolerance / dense).sqrt().sqrt())
        } else {
            LARGEST_GROWTH
        };
        (accepted, growth)
    }

    /// Runs the pair; `observe` is given index, overlap and plastic overlap of each time in turn.
    fn run<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        observe: &mut impl FnMut(usize, f64, f64),
    ) -> Result<SolveReport, SolveError> {
        let PairRun { scene, law, pace, times_s } = *run;
        let contact = scene.law();
        let mut run = Run {
            contact,
            pace,
            solver: *self,
            coefficients: law.coefficients(),
            times_s,
            observed: 0,
            observe,
            now_s: pace.time(law.rest_s()).unwrap_or(f64::INFINITY),
            overlap: scene.x0(),
            plastic_overlap: contact.equilibrium_plastic_overlap(scene.x0()),
            step_errors: 0.0,
            dense_error: 0.0,
            steps: 0,
            evaluations: 0,
        };
        while run.next_time_s().is_some_and(|time| time < run.now_s) {
            run.observe_present();
        }
        let end = scene.final_overlap();
        let switch = run.coefficients.switch;
        let mut ended = true;
        if K::HAS_SWITCH && run.overlap < switch {
            let (numerator, denominator) = K::rate_after_switch(&run.coefficients, switch);
            let speed_after =
                if switch < end { numerator / denominator * 0.5 / switch.sqrt() } else { 0.0 };
            ended =
                run.piece(switch.min(end), speed_after, TAIL_SHARE, K::rate_before_switch::<f64>)?;
        }
        if ended && run.overlap < end {
            // A limit that the law only approaches counts as reached within a thousandth of the tolerance.
            let near_limit = law.limit_overlap() - 1e-3 * self.tolerance;
            if run.overlap < near_limit {
                ended = run.piece(
                    end.min(near_limit),
                    0.0,
                    f64::INFINITY,
                    K::rate_after_switch::<f64>,
                )?;
            }
            if ended {
                run.rest_at(end.min(law.limit_overlap()).max(run.overlap));
            }
        }
        while run.next_time_s().is_some() {
            run.observe_present();
        }
        let overlap = run.overlap;
        Ok(SolveReport {
            kind: SolverKind::QuasiStatic,
            steps: run.steps,
            force_evaluations: run.evaluations,
            error_estimate: Some(run.step_errors + run.dense_error),
            stop: if ended { StopReason::Coalesced } else { StopReason::LastObservation },
            quasi_static_lag: (!P::VARIES).then(|| lag::estimate(scene, law, overlap)),
        })
    }
}

/// A run under way.
struct Run<'a, F, P> {
    contact: &'a ContactLaw,
    pace: P,
    solver: QuasiStatic,
    coefficients: RateCoefficients<f64>,
    times_s: &'a [f64],
    /// Number of times already observed.
    observed: usize,
    observe: &'a mut F,
    now_s: f64,
    overlap: f64,
    plastic_overlap: f64,
    /// Sum of the local error estimates of the steps, in a/R.
    step_errors: f64,
    /// Largest error estimate inside a step, in a/R.
    dense_error: f64,
    steps: u64,
    evaluations: u64,
}

impl<F: FnMut(usize, f64, f64), P: Pace> Run<'_, F, P> {
    fn next_time_s(&self) -> Option<f64> {
        self.times_s.get(self.observed).copied()
    }

    fn observe_present(&mut self) {
        (self.observe)(self.observed, self.overlap, self.plastic_overlap);
        self.observed += 1;
    }

    fn rest_at(&mut self, overlap: f64) {
        self.overlap = overlap;
        self.plastic_overlap = self.contact.equilibrium_plastic_overlap(overlap);
    }

    /// Refuses a step beyond the work limit, and one too short to add to the time.
    fn check_step(&self, since_s: f64, step_s: f64, last_s: f64) -> Result<(), SolveError> {
        if self.steps >= self.solver.max_work {
            return Err(SolveError::WorkLimit {
                solver: "quasi-static",
                max_work: self.solver.max_work,
                reached_s: self.now_s + since_s,
                last_s,
            });
        }
        if since_s + step_s == since_s && since_s < last_s - self.now_s {
            return Err(SolveError::Derived {
                quantity: "step [s]",
                value: step_s,
                remedy: "the growth is too fast or too slow for the observation times",
            });
        }
        Ok(())
    }

    /// Length of the step from `p` that ends at `until_plastic`, from a first estimate by the dense output: two
    /// shorter steps refine it to their own order.
    fn crossing_s(
        &mut self,
        slope: &impl Fn(f64, f64) -> f64,
        (p, start_slope): (f64, f64),
        mut taken_s: f64,
        until_plastic: f64,
    ) -> f64 {
        for _ in 0..2 {
            let shorter = Step::take(slope, p, start_slope, taken_s);
            taken_s += (until_plastic - shorter.end()) / shorter.end_slope();
            self.evaluations += 6;
        }
        taken_s
    }

    /// Observes within a step of a piece, up to `until_s` after the start of the step.
    fn observe_step(
        &mut self,
        step: &Step,
        (since_s, step_s): (f64, f64),
        until_s: f64,
        until_plastic: f64,
    ) {
        while let Some(time) = self.next_time_s() {
            let ahead_s = time - self.now_s - since_s;
            if ahead_s > until_s {
                break;
            }
            let at = if step_s > 0.0 { (ahead_s / step_s).clamp(0.0, 1.0) } else { 0.0 };
            // Growth never turns; the dense output may, within its error.
            let p = step.at(at).min(until_plastic).max(self.plastic_overlap);
            self.plastic_overlap = p;
            self.overlap = self.contact.equilibrium_overlap(p);
            self.observe_present();
        }
    }

    /// Integrates one smooth piece of the rate up to the overlap `until`; returns false where the last
    /// observation comes first.
    ///
    /// `speed_after` is `d(a/R)/dt` beyond `until`: an error of the time at which slow zipping ends is
    /// an error of a/R as large as fast stretching makes it. `tail_share` limits the growth of the
    /// overlap in one step.
    fn piece(
        &mut self,
        until: f64,
        speed_after: f64,
        tail_share: f64,
        rate: impl Fn(&RateCoefficients<f64>, f64) -> (f64, f64),
    ) -> Result<bool, SolveError> {
        let Some(&last_s) = self.times_s.last() else { return Ok(false) };
        let (contact, coefficients) = (*self.contact, self.coefficients);
        let stiffening = contact.stiffening();
        // At the reference; the pace scales it.
        let slope = |p: f64| {
            // x = p + alpha/kappa and dp/dX = 1/(1 - q alpha/kappa^2); the pair in equilibrium is
            // below the fluid branch.
            let kappa = 1.0 + stiffening * p;
            let elastic = contact.adhesion / kappa;
            let (numerator, denominator) = rate(&coefficients, p + elastic);
            numerator / (denominator * (1.0 - stiffening * elastic / kappa))
        };
        let until_plastic = contact.equilibrium_plastic_overlap(until);
        // Time since the start of the piece: where pieces differ in speed, now_s is too coarse.
        let mut since_s = 0.0;
        let left_s = last_s - self.now_s;
        let mut p = self.plastic_overlap;
        self.pace.seek(self.now_s);
        let mut start_slope = self.pace.scaled(self.now_s, slope(p));
        self.evaluations += 1;
        let mut step_s = (0.02 * self.overlap / start_slope).min(left_s);
        while self.next_time_s().is_some() {
            let stretch_s = self.pace.until_s() - self.now_s - since_s;
            if self.pace.is_frozen() || since_s + stretch_s <= since_s {
                since_s = self.wait_out(p, since_s);
                start_slope = self.pace.scaled(self.now_s + since_s, slope(p));
                step_s =
                    (0.02 * contact.equilibrium_overlap(p) / start_slope).min(left_s - since_s);
                continue;
            }
            step_s = step_s.min(stretch_s);
            self.check_step(since_s, step_s, last_s)?;
            let (pace, from_s) = (self.pace, self.now_s + since_s);
            let scaled_slope = |at_s: f64, p: f64| pace.scaled(from_s + at_s, slope(p));
            let step = Step::take(&scaled_slope, p, start_slope, step_s);
            self.steps += 1;
            self.evaluations += 6;
            let speed = pace.scaled(from_s + step_s, speed_after);
            let (error, dense) = self.errors(&step, p, speed);
            let (accepted, growth) = self.solver.verdict(error, dense);
            if !accepted {
                step_s *= if growth.is_finite() { growth.clamp(0.1, 0.9) } else { 0.1 };
                continue;
            }
            self.step_errors += error;
            self.dense_error = self.dense_error.max(dense);
            let crosses = step.end() >= until_plastic;
            let taken_s = if crosses {
                let first = step.crossing(until_plastic) * step_s;
                self.crossing_s(&scaled_slope, (p, start_slope), first, until_plastic)
                    .clamp(0.0, step_s)
            } else {
                step_s
            };
            // The last step ends on the last time only up to rounding.
            let is_last = !crosses && since_s + step_s >= left_s;
            let until_s = if is_last { f64::INFINITY } else { taken_s };
            self.observe_step(&step, (since_s, step_s), until_s, until_plastic);
            if crosses {
                self.now_s += since_s + taken_s;
                self.rest_at(until);
                return Ok(true);
            }
            since_s += step_s;
            p = step.end();
            start_slope = step.end_slope();
            step_s = (step_s * growth.clamp(0.2, LARGEST_GROWTH))
                .min(tail_share * contact.equilibrium_overlap(p) / start_slope)
                .min(left_s - since_s);
        }
        Ok(false)
    }

    /// Errors of a step from `p`, at its end and inside it, in a/R; `speed_after` as in [`piece`](Self::piece), at the end of the step.
    fn errors(&self, step: &Step, p: f64, speed_after: f64) -> (f64, f64) {
        // da/R = dx/(2 a/R), and dx/dp is at most 1; what is below rounding is no error.
        let in_ratio = 0.5 / self.contact.equilibrium_overlap(p).sqrt();
        let seen = |error: f64| if error <= 1e-15 * p { 0.0 } else { error };
        let later = (speed_after / step.end_slope()).min(f64::MAX);
        (seen(CAUTION * step.error) * in_ratio.max(later), seen(step.dense_error()) * in_ratio)
    }

    /// Waits at `p` to the end of a frozen stretch, or of one that has ended, and goes to the next; returns the time since
    /// the start of the piece.
    fn wait_out(&mut self, p: f64, since_s: f64) -> f64 {
        let until_s = self.pace.until_s();
        self.plastic_overlap = p;
        self.overlap = self.contact.equilibrium_overlap(p);
        while self.next_time_s().is_some_and(|time_s| time_s <= until_s) {
            self.observe_present();
        }
        self.pace.next_stretch();
        since_s.max(until_s - self.now_s)
    }
}

impl PairSolver for QuasiStatic {
    fn contact_ratios<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        contact_ratio: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        let (end, phi) = (run.scene.final_overlap(), run.scene.final_contact_ratio());
        self.run(run, &mut |index, x: f64, _| {
            contact_ratio[index] = if x >= end { phi } else { x.sqrt() };
        })
    }

    fn overlaps<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        overlap: &mut [f64],
        plastic_overlap: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        self.run(run, &mut |index, x, p| {
            overlap[index] = x;
            plastic_overlap[index] = p;
        })
    }
}
