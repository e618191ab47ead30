//! Reference curves of the pair for tests and studies: Radau IIA of fifth order with adaptive steps (E. Hairer,
//! G. Wanner, *Solving Ordinary Differential Equations II*, section IV.8), from the crate `differential-equations`.
//!
//! They share no code with the solvers of `dem-core`: the rates are written out from the equations as
//! printed. Two limits are told apart:
//!
//! - [`Equations::Motion`], Newton's law with the plastic overlap, in the elastic branch. Against it a
//!   Verlet run shows the error of its time step;
//! - [`Equations::ForceBalance`], the quasi-static limit, which is what is calibrated. Against it
//!   every solver shows its whole error, inertia of the soft contact included.
//!
//! Where the right-hand side bends (knee, full coalescence) the place is found to rounding and the
//! integration starts anew. [`Problem::settled`] tightens the tolerance until the result stops moving.

mod radau;
mod system;

pub(crate) use radau::ReferenceError;
pub(crate) use system::{Equations, Problem};

use radau::Run;
use system::System;

/// A reference curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Reference {
    /// Contact ratio at the times.
    pub(crate) contact_ratio: Vec<f64>,
    /// Largest change of a/R over the last two tightenings of the tolerance.
    pub(crate) movement: f64,
    /// Steps of the last run.
    pub(crate) steps: u64,
}

impl Problem<'_> {
    /// The curve with tolerances from 1e-6 down to 1e-12, until a/R moves by less than `wanted` twice
    /// running.
    ///
    /// # Errors
    ///
    /// [`ReferenceError`], also where it never settles.
    pub(crate) fn settled(&self, wanted: f64, max_steps: u64) -> Result<Reference, ReferenceError> {
        let (mut before, _) = self.integrate(1e-6, max_steps)?;
        let (mut movement, mut last) = (f64::INFINITY, f64::INFINITY);
        for tolerance in [1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12] {
            let (contact_ratio, steps) = self.integrate(tolerance, max_steps)?;
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

    /// Contact ratios at the times with one relative tolerance per step, and the number of steps.
    ///
    /// The integrator takes no tolerance below 1e-11; below that it takes half of each step it would,
    /// which at fifth order divides the error by 32.
    ///
    /// # Errors
    ///
    /// [`ReferenceError`].
    pub(crate) fn integrate(
        &self,
        tolerance: f64,
        max_steps: u64,
    ) -> Result<(Vec<f64>, u64), ReferenceError> {
        let system = System::new(self);
        let mut run = Run::new(system, tolerance, max_steps);
        let mut state = system.start();
        let mut now = system.rest;
        let mut contact_ratio = Vec::with_capacity(self.times_s.len());
        for &time_s in self.times_s {
            let until = time_s / system.time_unit_s;
            if until > now {
                state = run.to(state, now, until)?;
                now = until;
            }
            contact_ratio.push(run.overlap(&state).max(0.0).sqrt());
        }
        Ok((contact_ratio, run.steps()))
    }
}
