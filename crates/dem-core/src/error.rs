//! Errors of a pair scene and of its run.

use thiserror::Error;

/// A scene that cannot be built; every message names the field, its value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A field of the [`PairSpec`](crate::PairSpec) is outside its range.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field as it is called in [`PairSpec`](crate::PairSpec) or [`Powder`](crate::Powder).
        field: &'static str,
        /// Its value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// The pair starts at or beyond its final contact ratio.
    #[error(
        "final_contact_ratio = {final_contact_ratio}: the adhesive contact already starts at {start_contact_ratio}; \
         choose a larger final contact ratio, a stiffer powder or a smaller surface tension"
    )]
    StartsCoalesced {
        /// The stated final contact ratio phi.
        final_contact_ratio: f64,
        /// The contact ratio at t = 0.
        start_contact_ratio: f64,
    },
    /// The unloading stiffness grows so fast that the adhesive equilibrium is not unique.
    #[error(
        "k2_max_over_k1 = {k2_max_over_k1} with final_contact_ratio = {final_contact_ratio} and adhesion_over_k1_radius \
         = {adhesion_over_k1_radius}: the equilibrium overlap would not grow with the plastic overlap; \
         lower k2_max_over_k1 or adhesion_over_k1_radius"
    )]
    FoldedEquilibrium {
        /// Largest unloading stiffness over loading stiffness.
        k2_max_over_k1: f64,
        /// Final contact ratio.
        final_contact_ratio: f64,
        /// Adhesive force over `K1 R`.
        adhesion_over_k1_radius: f64,
    },
}

/// A run that cannot be made or finished.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A sintering parameter or a solver setting is outside its range.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field as it is called in [`Sintering`](crate::Sintering) or [`SolverSettings`](crate::SolverSettings).
        field: &'static str,
        /// Its value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// The parameters are each in range, but what follows from them does not fit into a number.
    #[error("{quantity} = {value} from these parameters cannot be computed with: {remedy}")]
    Derived {
        /// The quantity that left the range.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// There is no observation time.
    #[error("times_s is empty: give at least one observation time")]
    NoTimes,
    /// An observation time is not a finite number at or after zero.
    #[error("times_s[{index}] = {value}: an observation time must be finite and not negative")]
    Time {
        /// Its place.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Observation times go backwards.
    #[error("times_s[{index}] = {value} comes before times_s[{}] = {previous}: sort the observation times", index - 1)]
    UnsortedTimes {
        /// Place of the time that is too early.
        index: usize,
        /// Its value.
        value: f64,
        /// The time before it.
        previous: f64,
    },
    /// The buffer for the answer has another length than the times.
    #[error("out has {out} places for {times} observation times: make them equal")]
    OutputLength {
        /// Number of places.
        out: usize,
        /// Number of times.
        times: usize,
    },
    /// The time step is not stable.
    #[error(
        "step_over_collision_time = {step_over_collision_time} is a step of {step_s} s, at or above the stability limit \
         2 sqrt(m_eff/K2max) = {limit_s} s: lower it below {}",
        step_over_collision_time * limit_s / step_s
    )]
    UnstableStep {
        /// The setting.
        step_over_collision_time: f64,
        /// The step it gives.
        step_s: f64,
        /// Largest stable step \[s\].
        limit_s: f64,
    },
    /// The run used all the work it was allowed.
    #[error(
        "the {solver} solver stopped at t = {reached_s} s after max_work = {max_work} steps, before the last observation at \
         {last_s} s: raise max_work, or choose the closed-form solver"
    )]
    WorkLimit {
        /// Name of the solver.
        solver: &'static str,
        /// The limit.
        max_work: u64,
        /// Time reached.
        reached_s: f64,
        /// Time wanted.
        last_s: f64,
    },
}

impl SolveError {
    /// Whether another parameter vector may succeed where this one failed.
    ///
    /// True for errors that depend on the parameters or on the work they need; false for
    /// times, buffers and settings, which are the same for every parameter vector.
    #[must_use]
    pub fn is_recoverable(&self) -> bool {
        match self {
            Self::Field { field, .. } => matches!(*field, "c1" | "tau_s" | "delta_c" | "lambda"),
            Self::Derived { .. } | Self::WorkLimit { .. } => true,
            _ => false,
        }
    }
}
