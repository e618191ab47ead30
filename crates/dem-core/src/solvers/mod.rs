//! The three solvers of the pair scene, behind one trait.

mod choice;
mod closed_form;
mod entry;
mod quasi_static;
mod verlet;

pub use choice::{SolverChoice, choose_solver};
pub use closed_form::ClosedForm;
pub use entry::{contact_ratios, heated_contact_ratios, simulate, simulate_heated};
pub use quasi_static::QuasiStatic;
pub use verlet::{Verlet, verlet_batch};

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::heat::Pace;
use crate::kinetics::UnknownName;
use crate::{Kinetic, PairScene, SolveError};

/// A pair with its law of growth, its pace and its observation times.
///
/// The times are sorted, finite and not negative: [`simulate`] and [`contact_ratios`] have checked it.
#[derive(Debug, Clone, Copy)]
pub struct PairRun<'a, K, P> {
    /// The pair.
    pub scene: &'a PairScene,
    /// Its law of growth.
    pub law: &'a K,
    /// The mobility over time: [`Isothermal`](crate::heat::Isothermal), or that of a heat.
    pub pace: P,
    /// Observation times \[s\].
    pub times_s: &'a [f64],
}

/// A way to solve the pair scene, for any growth law and any heat. Slices are as long as the times.
pub trait PairSolver {
    /// Contact ratios at the times; the hot path.
    ///
    /// # Errors
    ///
    /// A [`SolveError`] for a setting out of range or for a run that takes more work than allowed.
    fn contact_ratios<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        contact_ratio: &mut [f64],
    ) -> Result<SolveReport, SolveError>;

    /// Overlaps and plastic overlaps at the times, in radii.
    ///
    /// # Errors
    ///
    /// Same as [`contact_ratios`](Self::contact_ratios).
    fn overlaps<K: Kinetic, P: Pace>(
        &self,
        run: &PairRun<'_, K, P>,
        overlap: &mut [f64],
        plastic_overlap: &mut [f64],
    ) -> Result<SolveReport, SolveError>;
}

/// The solvers by name; serialised as that [name](Self::name).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum SolverKind {
    /// The full discrete-element run: Newton's law by velocity Verlet.
    Verlet,
    /// Force balance at every instant, integrated with error control.
    QuasiStatic,
    /// The quasi-static limit, exact.
    #[default]
    ClosedForm,
}

impl SolverKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Verlet, Self::QuasiStatic, Self::ClosedForm];

    /// The name a user types.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Verlet => "verlet",
            Self::QuasiStatic => "quasi-static",
            Self::ClosedForm => "closed-form",
        }
    }
}

impl fmt::Display for SolverKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for SolverKind {
    type Err = UnknownName;

    fn from_str(value: &str) -> Result<Self, UnknownName> {
        Self::ALL.into_iter().find(|kind| kind.name() == value).ok_or_else(|| UnknownName {
            what: "solver",
            value: value.to_owned(),
            choices: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// A solver and its settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// The solver.
    pub kind: SolverKind,
    /// Largest error of a/R wanted of the quasi-static solver, 1e-12 to 0.1; 1e-6 because measured
    /// contact ratios have three digits.
    pub tolerance: f64,
    /// Step of the Verlet solver over the [collision time](PairScene::collision_time_s); 0.02 as is
    /// usual with this contact law.
    pub step_over_collision_time: f64,
    /// Whether the Verlet solver starts at first contact, delta = 0, as the paper's run did, instead
    /// of at rest in the adhesive contact.
    pub from_contact: bool,
    /// Whether the Verlet solver ends its run where the pair is fully coalesced and at rest. Nothing
    /// happens after that: off only to measure what it saves.
    pub stop_when_coalesced: bool,
    /// Largest number of steps of one run.
    pub max_work: u64,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            kind: SolverKind::default(),
            tolerance: 1e-6,
            step_over_collision_time: 0.02,
            from_contact: false,
            stop_when_coalesced: true,
            max_work: 1_000_000_000,
        }
    }
}

impl SolverSettings {
    /// The defaults for a solver.
    #[must_use]
    pub fn of(kind: SolverKind) -> Self {
        Self { kind, ..Self::default() }
    }
}

/// Reason for the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The last observation was reached.
    LastObservation,
    /// The pair had fully coalesced and come to rest before the last observation.
    Coalesced,
}

/// The range in which the quasi-static limit holds, by order of magnitude.
///
/// Inertia lets the pair lag by about `sqrt(2 m_eff x R/fa)`, the time that the adhesive force needs
/// to pull it through its overlap. The limit holds where that is short against the time scale
/// `x/(dx/dt)` of the growth. The ratio of the two falls as the neck grows, so that the limit holds
/// from some contact ratio on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuasiStaticLag {
    /// Lag at the last observation \[s\].
    pub lag_s: f64,
    /// Time scale `x/(dx/dt)` of the growth there \[s\]; infinite where it has ended.
    pub time_scale_s: f64,
    /// Contact ratio from which the lag is below a hundredth of the time scale; `None` where that
    /// does not come before coalescence.
    pub holds_from_contact_ratio: Option<f64>,
    /// Time at which that contact ratio is reached \[s\].
    pub holds_from_s: Option<f64>,
}

/// Work, error and end of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolveReport {
    /// The solver that ran.
    pub kind: SolverKind,
    /// Steps taken (with those that were rejected).
    pub steps: u64,
    /// Evaluations of the contact law, or of the growth law where there is no force.
    pub force_evaluations: u64,
    /// Estimated largest error of a/R at the observations, where the solver has one.
    pub error_estimate: Option<f64>,
    /// Reason for its end.
    pub stop: StopReason,
    /// The range in which the quasi-static limit holds; from the quasi-static solver without heat only.
    pub quasi_static_lag: Option<QuasiStaticLag>,
}

/// A neck growth curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The observation times \[s\].
    pub time_s: Vec<f64>,
    /// Overlap delta \[m\].
    pub overlap_m: Vec<f64>,
    /// Plastic overlap delta0 \[m\].
    pub plastic_overlap_m: Vec<f64>,
    /// Contact ratio a/R.
    pub contact_ratio: Vec<f64>,
    /// Work, error and end of the run.
    pub report: SolveReport,
}
