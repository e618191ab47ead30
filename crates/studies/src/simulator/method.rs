//! The solvers with their controls, and the references they are held against.

use crate::stiff_reference::{Equations, Problem, Reference, ReferenceError};
use dem_core::{Kinetics, Sintering, SolverKind, SolverSettings};

use crate::pair::{Pair, verlet};

/// Steps that a reference may take.
pub(super) const MOST_STEPS: u64 = 5_000_000;

/// A solver with a control.
pub(super) struct Method {
    pub(super) settings: SolverSettings,
    /// The control in words.
    pub(super) control: String,
}

/// Closed form, quasi-static solver at tolerances from 1e-2 to 1e-12, Verlet at steps over the collision time.
pub(super) fn all(steps: &[f64]) -> Vec<Method> {
    let mut methods = vec![Method { settings: SolverSettings::default(), control: String::new() }];
    methods.extend((2..=12).map(|digits| {
        let tolerance = 10f64.powi(-digits);
        let settings = SolverSettings { tolerance, ..SolverSettings::of(SolverKind::QuasiStatic) };
        Method { settings, control: format!("tolerance {tolerance:.0e}") }
    }));
    methods.extend(
        steps
            .iter()
            .map(|&step| Method { settings: verlet(step), control: format!("step {step} t_c") }),
    );
    methods
}

/// The settled reference: for the force balance to 1e-9, for the motion to 1e-8, or a hundred times that.
pub(super) fn reference(
    pair: &Pair,
    equations: Equations,
    sintering: &Sintering,
) -> Result<Reference, ReferenceError> {
    let wanted = match equations {
        Equations::Motion => 1e-8,
        Equations::ForceBalance => 1e-9,
    };
    let problem = Problem {
        equations,
        scene: &pair.scene,
        kinetics: Kinetics::ThreeStage,
        sintering,
        times_s: &pair.times_s,
    };
    problem.settled(wanted, MOST_STEPS).or_else(|_| problem.settled(100.0 * wanted, MOST_STEPS))
}

/// Largest difference of two curves.
pub(super) fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
