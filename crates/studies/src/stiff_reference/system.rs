//! The equations of the pair, written out from the paper.

use std::f64::consts::PI;

use dem_core::{Kinetics, PairScene, Sintering};
use differential_equations::linalg::Matrix;
use differential_equations::ode::ODE;

/// The equations that are integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Equations {
    /// Newton's law for the overlap, and the growth of the plastic overlap.
    Motion,
    /// Force balance at every instant.
    ForceBalance,
}

/// A curve to be computed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Problem<'a> {
    /// The equations.
    pub(crate) equations: Equations,
    /// The pair.
    pub(crate) scene: &'a PairScene,
    /// The growth law.
    pub(crate) kinetics: Kinetics,
    /// Its parameters.
    pub(crate) sintering: &'a Sintering,
    /// Times of the observations \[s\], sorted.
    pub(crate) times_s: &'a [f64],
}

/// The pieces of the curve on which the right-hand side is smooth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Piece {
    Zipping,
    Stretching,
    Coalesced,
}

/// `[x, dx/dtau, p]` for the motion, `[x (unused), 0, p]` for force balance; `tau = t/time_unit_s`.
pub(super) type State = [f64; 3];

#[derive(Debug, Clone, Copy)]
pub(super) struct System {
    equations: Equations,
    pub(super) piece: Piece,
    pub(super) time_unit_s: f64,
    adhesion: f64,
    /// `K2' R/K1`.
    slope: f64,
    end: f64,
    /// Plastic overlap of the coalesced pair in equilibrium.
    pub(super) end_plastic: f64,
    start: f64,
    switch: f64,
    cohesion: f64,
    /// `(K1/m) T^2` and `(gamma_n/m) T` with T the unit of time.
    frequency_squared: f64,
    damping: f64,
    /// `(2/7) B T` and `T/tau_s`.
    zipping: f64,
    stretching: f64,
    /// Whether stretching keeps the volume, and the relaxation time over tau_s.
    at_constant_volume: Option<f64>,
    /// Rest of the regime map at its start, in units of time.
    pub(super) rest: f64,
}

impl System {
    pub(super) fn new(problem: &Problem<'_>) -> Self {
        let &Problem { equations, scene, kinetics, sintering: s, .. } = problem;
        let law = scene.law();
        let (r, gamma) = (scene.radius_m(), scene.powder().surface_tension_n_per_m);
        let b = 63.0 * PI.powi(3) / 16.0 * (s.delta_c / r).powi(2) * (2.0 * s.c1 * gamma / r);
        let end = scene.final_contact_ratio().powi(2);
        let start = scene.x0();
        let switch = match kinetics {
            Kinetics::Frenkel | Kinetics::Pokluda | Kinetics::Bellehumeur => 0.0,
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
            at_constant_volume: match kinetics {
                Kinetics::Pokluda | Kinetics::ThreeStagePokluda => Some(0.0),
                Kinetics::Bellehumeur => Some(s.lambda / s.tau_s),
                _ => None,
            },
            rest: rest_s / time_unit_s,
        }
    }

    pub(super) fn start(&self) -> State {
        let mut p = self.start;
        for _ in 0..60 {
            let kappa = 1.0 + self.slope * p;
            let miss = p + self.adhesion / kappa - self.start;
            p -= miss / (1.0 - self.slope * self.adhesion / (kappa * kappa));
        }
        [self.start, 0.0, p]
    }

    pub(super) fn overlap(&self, &[x, _, p]: &State) -> f64 {
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
            Piece::Stretching => {
                self.stretching
                    * self.at_constant_volume.map_or(1.0, |lambda| constant_volume(x, lambda))
            }
            Piece::Coalesced => 0.0,
        }
    }

    /// A quantity that falls through zero where the present piece ends.
    pub(super) fn until_end_of_piece(&self, state: &State) -> f64 {
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

    pub(super) fn next_piece(&self, state: &State) -> Piece {
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
    pub(super) fn is_elastic(&self, &[x, _, p]: &State) -> bool {
        let force = (1.0 + self.slope * p) * (x - p);
        self.equations == Equations::ForceBalance
            || (x >= 0.0 && x - p <= 1.0 / self.slope && force >= -self.cohesion * x)
    }
}

/// `tau_s dx/dt` at constant volume, by the angle as Pokluda et al. and, with a relaxation time in tau_s, Bellehumeur et al.
/// published it.
fn constant_volume(x: f64, lambda: f64) -> f64 {
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
    let k1 = t.sin() / ((1.0 + c) * (2.0 - c));
    let k2 = 2f64.powf(-5.0 / 3.0) * c * t.sin()
        / ((1.0 + c).powf(4.0 / 3.0) * (2.0 - c).powf(5.0 / 3.0));
    let squared = 8.0 * (lambda * k1).powi(2);
    let linear = 2.0 * lambda * k1 + k1 * k1 / k2;
    let turning = 2.0 / (linear + (linear * linear + 4.0 * squared).sqrt());
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
