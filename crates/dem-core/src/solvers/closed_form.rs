//! The quasi-static limit, exact.

use super::{PairSolver, SolveReport, SolverKind, StopReason};
use crate::{Kinetic, PairScene, SolveError};

/// The exact solution of each growth law (see [`kinetics`](crate::kinetics)), with the plastic overlap
/// from force balance. It has no step and no settings, and allocates nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClosedForm;

impl PairSolver for ClosedForm {
    #[inline]
    fn contact_ratios<K: Kinetic>(
        &self,
        scene: &PairScene,
        law: &K,
        times_s: &[f64],
        contact_ratio: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        law.contact_ratios(times_s, contact_ratio);
        let coalesced =
            contact_ratio.last().is_some_and(|&last| last >= scene.final_overlap().sqrt());
        Ok(SolveReport {
            kind: SolverKind::ClosedForm,
            steps: 0,
            force_evaluations: 0,
            error_estimate: Some(ROUNDING),
            stop: if coalesced { StopReason::Coalesced } else { StopReason::LastObservation },
            quasi_static_lag: None,
        })
    }

    fn overlaps<K: Kinetic>(
        &self,
        scene: &PairScene,
        law: &K,
        times_s: &[f64],
        overlap: &mut [f64],
        plastic_overlap: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        let report = self.contact_ratios(scene, law, times_s, overlap)?;
        let last = scene.final_overlap().sqrt();
        for (x, p) in overlap.iter_mut().zip(plastic_overlap) {
            // Squaring must not lead below the start or past the end by rounding.
            *x = if *x == last { scene.final_overlap() } else { (*x * *x).max(scene.x0()) };
            *p = scene.law().equilibrium_plastic_overlap(*x);
        }
        Ok(report)
    }
}

/// Error of a/R by rounding.
pub(super) const ROUNDING: f64 = 1e-13;
