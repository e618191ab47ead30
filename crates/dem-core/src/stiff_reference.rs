//! References for tests and benchmarks, by somebody else's integrator: Radau IIA of fifth order with
//! adaptive steps (E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, section IV.8), from the
//! crate `differential-equations`. Only with the feature `stiff-reference`.
//!
//! They share no code with the solvers: the rates are written out from the equations as they are
//! printed. Two limits are told apart:
//!
//! - [`Equations::Motion`], Newton's law with the plastic overlap, in the elastic branch. Against it a
//!   Verlet run shows the error of its time step;
//! - [`Equations::ForceBalance`], the quasi-static limit, which is what is calibrated. Against it
//!   every solver shows its whole error, inertia of the soft contact included.
//!
//! Where the right-hand side bends (knee, full coalescence) the place is found to rounding and the
//! integration starts anew. [`settled`] tightens the tolerance until the result stops moving.

use std::f64::consts::PI;

use differential_equations::linalg::Matrix;
use differential_equations::methods::ImplicitRungeKutta;
use differential_equations::ode::{ODE, OrdinaryNumericalMethod};
use differential_equations::status::Status;
use thiserror::Error;

use crate::{Kinetics, PairScene, Sintering};

/// What is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Equations {
    /// Newton's law for the overlap, and the growth of the plastic overlap.
    Motion,
    /// Force balance at every instant.
    ForceBalance,
}

/// Why there is no reference.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The motion leaves the elastic branch of the contact law, on which alone it is integrated.
    #[error("the motion leaves the elastic branch at t = {time_s} s: compare another case")]
    OtherBranch {
        /// When \[s\].
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
        /// When \[s\].
        time_s: f64,
        /// What it said.
        cause: String,
    },
    /// The result still moves at the tightest tolerance.
    #[error("a/R still moves by {movement:e} at the tightest tolerance, {wanted:e} is wanted")]
    StillMoves {
        /// Largest change of a/R over the last two tightenings.
        movement: f64,
        /// What was wanted.
        wanted: f64,
    },
}

/// A reference curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// Contact ratio at the times.
    pub contact_ratio: Vec<f64>,
    /// Largest change of a/R over the last two tightenings of the tolerance.
    pub movement: f64,
    /// Steps of the last run.
    pub steps: u64,
}

/// The curve with tolerances from 1e-6 down to 1e-12, until a/R moves by less than `wanted` twice
/// running.
///
/// # Errors
///
/// [`ReferenceError`], also where it never settles.
pub fn settled(
    equations: Equations,
    scene: &PairScene,
    kinetics: Kinetics,
    sintering: &Sintering,
    times_s: &[f64],
    wanted: f64,
    max_steps: u64,
) -> Result<Reference, ReferenceError> {
    let run =
        |tolerance| integrate(equations, scene, kinetics, sintering, times_s, tolerance, max_steps);
    let (mut before, _) = run(1e-6)?;
    let (mut movement, mut last) = (f64::INFINITY, f64::INFINITY);
    for tolerance in [1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12] {
        let (contact_ratio, steps) = run(tolerance)?;
        let moved =
            contact_ratio.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Twice: once may be luck.
        movement = last.max(moved);
        if movement < wanted {
            return Ok(Reference { contact_ratio, movement, steps });
        }
        (before, last) = (contact_ratio, moved);
    }
    Err(ReferenceError::StillMoves { movement, wanted })
}

/// Contact ratios at sorted times with one relative tolerance per step, and the number of steps.
///
/// The integrator takes no tolerance below 1e-11; below that it is made to take half the step it would,
/// which at fifth order divides the error by 32.
///
/// # Errors
///
/// [`ReferenceError`].
pub fn integrate(
    equations: Equations,
    scene: &PairScene,
    kinetics: Kinetics,
    sintering: &Sintering,
    times_s: &[f64],
    tolerance: f64,
    max_steps: u64,
) -> Result<(Vec<f64>, u64), ReferenceError> {
    let system = System::new(equations, scene, kinetics, sintering);
    let mut run = Run {
        system,
        tolerance,
        max_steps,
        steps: 0,
        last_step: 0.0,
        newton_tolerance: NEWTON_TOLERANCE,
    };
    let mut state = system.start();
    let mut now = system.rest;
    let mut contact_ratio = Vec::with_capacity(times_s.len());
    for &time_s in times_s {
        let until = time_s / system.time_unit_s;
        if until > now {
            state = run.to(state, now, until)?;
            now = until;
        }
        contact_ratio.push(run.system.overlap(&state).max(0.0).sqrt());
    }
    Ok((contact_ratio, run.steps))
}

/// Which smooth right-hand side holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Piece {
    Zipping,
    Stretching,
    Coalesced,
}

/// `[x, dx/dtau, p]` for the motion, `[x (unused), 0, p]` for force balance; `tau = t/time_unit_s`.
type State = [f64; 3];

#[derive(Debug, Clone, Copy)]
struct System {
    equations: Equations,
    piece: Piece,
    time_unit_s: f64,
    adhesion: f64,
    /// `K2' R/K1`.
    slope: f64,
    end: f64,
    /// Plastic overlap of the coalesced pair in equilibrium.
    end_plastic: f64,
    start: f64,
    switch: f64,
    cohesion: f64,
    /// `(K1/m) T^2` and `(gamma_n/m) T` with T the unit of time.
    frequency_squared: f64,
    damping: f64,
    /// `(2/7) B T` and `T/tau_s`.
    zipping: f64,
    stretching: f64,
    at_constant_volume: bool,
    /// How long the regime map rests at its start, in units of time.
    rest: f64,
}

impl System {
    fn new(equations: Equations, scene: &PairScene, kinetics: Kinetics, s: &Sintering) -> Self {
        let law = scene.law();
        let (r, gamma) = (scene.radius_m(), scene.powder().surface_tension_n_per_m);
        let b = 63.0 * PI.powi(3) / 16.0 * (s.delta_c / r).powi(2) * (2.0 * s.c1 * gamma / r);
        let end = scene.final_contact_ratio().powi(2);
        let start = scene.x0();
        let switch = match kinetics {
            Kinetics::Frenkel | Kinetics::Pokluda => 0.0,
            Kinetics::ThreeStage | Kinetics::ThreeStagePokluda => {
                (63.0 * PI.powi(3)).powf(0.4) * (s.delta_c / (8.0 * r)).powf(0.8)
            }
            Kinetics::RegimeMap => (b * s.tau_s).powf(0.4),
        };
        let time_unit_s = match equations {
            Equations::Motion => (scene.effective_mass_kg() / scene.k1_n_per_m()).sqrt(),
            Equations::ForceBalance if switch > start => start.powf(3.5) / b,
            Equations::ForceBalance => s.tau_s,
        };
        let slope = (law.k2_max - 1.0) / end;
        // p + alpha/(1 + slope p) = x: p^2 slope + p (1 - slope x) - (x - alpha) = 0, by Newton.
        let plastic = |x: f64| {
            let mut p = x - law.adhesion / law.k2_max;
            for _ in 0..60 {
                let kappa = 1.0 + slope * p;
                p -=
                    (p + law.adhesion / kappa - x) / (1.0 - slope * law.adhesion / (kappa * kappa));
            }
            p
        };
        // The map in explicit time leaves x0 when the first of its branches gets there.
        let rest_s = if kinetics == Kinetics::RegimeMap && equations == Equations::ForceBalance {
            (start.powf(3.5) / b).min(start * s.tau_s)
        } else {
            0.0
        };
        Self {
            equations,
            piece: if start < switch { Piece::Zipping } else { Piece::Stretching },
            time_unit_s,
            adhesion: law.adhesion,
            slope,
            end,
            end_plastic: plastic(end),
            start,
            switch,
            cohesion: law.kc,
            frequency_squared: scene.k1_n_per_m() / scene.effective_mass_kg()
                * time_unit_s
                * time_unit_s,
            damping: scene.dissipation_kg_per_s() / scene.effective_mass_kg() * time_unit_s,
            zipping: 2.0 / 7.0 * b * time_unit_s,
            stretching: time_unit_s / s.tau_s,
            at_constant_volume: matches!(kinetics, Kinetics::Pokluda | Kinetics::ThreeStagePokluda),
            rest: rest_s / time_unit_s,
        }
    }

    fn start(&self) -> State {
        let mut p = self.start;
        for _ in 0..60 {
            let kappa = 1.0 + self.slope * p;
            let miss = p + self.adhesion / kappa - self.start;
            p -= miss / (1.0 - self.slope * self.adhesion / (kappa * kappa));
        }
        [self.start, 0.0, p]
    }

    fn overlap(&self, &[x, _, p]: &State) -> f64 {
        match (self.equations, self.piece) {
            (Equations::Motion, _) => x,
            (Equations::ForceBalance, Piece::Coalesced) => self.end,
            (Equations::ForceBalance, _) => p + self.adhesion / (1.0 + self.slope * p),
        }
    }

    /// `dx/dtau` of the growth law.
    fn rate(&self, overlap: f64) -> f64 {
        let x = overlap.max(self.start);
        match self.piece {
            Piece::Zipping => self.zipping * x.powf(-2.5),
            Piece::Stretching if self.at_constant_volume => self.stretching * constant_volume(x),
            Piece::Stretching => self.stretching,
            Piece::Coalesced => 0.0,
        }
    }

    /// What changes its sign where the present piece ends, positive before.
    fn until_end_of_piece(&self, state: &State) -> f64 {
        let end = self.end_plastic - state[2];
        match self.piece {
            Piece::Zipping => end.min(self.switch - self.overlap(state)),
            // With inertia a rebound leads back below the switch.
            Piece::Stretching
                if self.switch > self.start && self.equations == Equations::Motion =>
            {
                end.min(self.overlap(state) - self.switch)
            }
            Piece::Stretching => end,
            Piece::Coalesced => 1.0,
        }
    }

    fn next_piece(&self, state: &State) -> Piece {
        // The end and the switch are found to rounding; the nearer one was met.
        let to_switch = (self.switch - self.overlap(state)).abs();
        if to_switch > (self.end_plastic - state[2]).abs() {
            return Piece::Coalesced;
        }
        match self.piece {
            Piece::Zipping => Piece::Stretching,
            Piece::Stretching if self.equations == Equations::Motion => Piece::Zipping,
            _ => Piece::Coalesced,
        }
    }

    /// Whether the motion is on the elastic branch of the law.
    fn is_elastic(&self, &[x, _, p]: &State) -> bool {
        let force = (1.0 + self.slope * p) * (x - p);
        self.equations == Equations::ForceBalance
            || (x >= 0.0 && x - p <= 1.0 / self.slope && force >= -self.cohesion * x)
    }
}

/// `tau_s dx/dt` at constant volume, by the angle as Pokluda et al. published it.
fn constant_volume(x: f64) -> f64 {
    let mut t = x.sqrt().min(1.5);
    let (mut low, mut high) = (0.0, PI / 2.0);
    let mut slope = 0.0;
    for _ in 0..60 {
        let c = t.cos();
        let overlap = (t.sin() * (4.0 / ((1.0 + c).powi(2) * (2.0 - c))).cbrt()).powi(2);
        // d ln(x)/d theta = 2 [cot + (2/3) sin/(1 + c) - (1/3) sin/(2 - c)]
        slope = 2.0 * (c / t.sin() + 2.0 / 3.0 * t.sin() / (1.0 + c) - t.sin() / (3.0 * (2.0 - c)));
        if overlap < x {
            low = t
        } else {
            high = t
        }
        let newton = t - (overlap / x).ln() / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let change = (next - t).abs();
        t = next;
        if change <= 1e-16 {
            break;
        }
    }
    let c = t.cos();
    let turning =
        2f64.powf(-5.0 / 3.0) * c * t.sin() * (2.0 - c).cbrt() / ((1.0 - c) * (1.0 + c).cbrt());
    x * slope * turning
}

impl ODE<f64, State> for System {
    fn diff(&self, _t: f64, &[x, v, p]: &State, slope: &mut State) {
        let kappa = 1.0 + self.slope * p;
        let equilibrium = 1.0 / (1.0 - self.slope * self.adhesion / (kappa * kappa));
        match self.equations {
            Equations::ForceBalance => {
                *slope = [0.0, 0.0, self.rate(p + self.adhesion / kappa) * equilibrium];
            }
            Equations::Motion => {
                let elastic = kappa * (x - p);
                let dissipated = self.damping * v / self.frequency_squared;
                slope[0] = v;
                slope[1] = self.frequency_squared * (self.adhesion - elastic - dissipated);
                slope[2] = (elastic + dissipated) / self.adhesion * self.rate(x) * equilibrium;
            }
        }
    }

    /// By differences relative to each component.
    fn jacobian(&self, t: f64, state: &State, jacobian: &mut Matrix<f64>) {
        let mut here = [0.0; 3];
        self.diff(t, state, &mut here);
        for column in 0..3 {
            let change =
                1e-8 * if column == 1 { state[1].abs().max(1e-6) } else { state[column].abs() };
            let mut there = *state;
            there[column] += change;
            let change = there[column] - state[column];
            let mut slope = [0.0; 3];
            self.diff(t, &there, &mut slope);
            for row in 0..3 {
                jacobian[(row, column)] = (slope[row] - here[row]) / change;
            }
        }
    }
}

/// The tightest relative tolerance that the integrator takes.
const TIGHTEST: f64 = 1.1e-11;

/// What becomes of the step that the integrator wants, as it is and halved.
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

struct Run {
    system: System,
    tolerance: f64,
    max_steps: u64,
    steps: u64,
    last_step: f64,
    newton_tolerance: f64,
}

impl Run {
    /// From one time to a later one, over as many pieces as there are.
    fn to(&mut self, mut state: State, mut now: f64, until: f64) -> Result<State, ReferenceError> {
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
