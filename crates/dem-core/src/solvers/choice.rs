//! The choice of a solver.

use super::{SolverKind, closed_form::ROUNDING};
use crate::{Kinetics, PairScene};

/// A solver and the reason for it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SolverChoice {
    /// The solver.
    pub kind: SolverKind,
    /// One sentence for the user.
    pub reason: String,
}

/// The cheapest solver that is within `tolerance` (largest error of a/R against the quasi-static
/// limit) for this scene and these kinetics.
///
/// All kinetics have an exact solution, so that for the pair scene this is the closed form. A
/// user who wants the run with inertia and step asks for `verlet`.
#[must_use]
pub fn choose_solver(_scene: &PairScene, kinetics: Kinetics, tolerance: f64) -> SolverChoice {
    let reason = if tolerance >= ROUNDING {
        format!(
            "closed-form: the {kinetics} kinetics have an exact solution for a pair, within {ROUNDING:.0e} of the \
             quasi-static a/R where {tolerance:.0e} is asked, and nothing is cheaper"
        )
    } else {
        format!(
            "closed-form: no solver is within {tolerance:.0e} of the quasi-static a/R, and the exact solution of the \
             {kinetics} kinetics, within {ROUNDING:.0e} by rounding, is the nearest"
        )
    };
    SolverChoice { kind: SolverKind::ClosedForm, reason }
}
