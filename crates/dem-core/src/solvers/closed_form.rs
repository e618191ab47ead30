//! The quasi-static limit, exact.

use super::{PairRun, PairSolver, SolveReport, SolverKind, StopReason};
use crate::heat::Pace;
use crate::{Kinetic, SolveError};

/// The exact solution of each growth law (see [`kinetics`](crate::kinetics)), with the plastic overlap
/// from force balance. It has no step and no settings, and allocates nothing but the reduced times under a heat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClosedForm;

impl PairSolver for ClosedForm {
    #[inline]
    fn contact_ratios<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        contact_ratio: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        run.law.contact_ratios(&run.pace.reduced_times(run.times_s), contact_ratio);
        let coalesced =
            contact_ratio.last().is_some_and(|&last| last >= run.scene.final_overlap().sqrt());
        Ok(SolveReport {
            kind: SolverKind::ClosedForm,
            steps: 0,
            force_evaluations: 0,
            error_estimate: Some(ROUNDING),
            stop: if coalesced { StopReason::Coalesced } else { StopReason::LastObservation },
            quasi_static_lag: None,
        })
    }

    fn overlaps<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        overlap: &mut [f64],
        plastic_overlap: &mut [f64],
    ) -> Result<SolveReport, SolveError> {
        let report = self.contact_ratios(run, overlap)?;
        let scene = run.scene;
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
