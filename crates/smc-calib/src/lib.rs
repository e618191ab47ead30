#![doc = include_str!("../README.md")]
// Loops over matrix rows and columns read like the formulas they compute.
#![allow(clippy::needless_range_loop)]

mod bfgs;
mod calibrate;
mod cholesky;
mod cloud;
mod control;
mod density;
mod design;
mod draw;
mod draws;
mod em;
mod error;
mod estimate;
mod failing;
mod first_proposal;
mod gaussian_process;
mod joint;
mod lanes;
mod leave_one_out;
mod map_search;
mod marginal;
mod mixture;
mod neighbours;
mod nelder_mead;
mod noise;
mod noise_summary;
pub mod normal;
mod observations;
mod parts;
mod path;
mod pool;
pub mod population;
mod posterior;
mod predicted;
mod predictive;
mod prior;
mod problem;
pub mod psis;
pub mod quadrature;
pub mod reference;
mod replicated;
mod residuals;
mod reweight;
mod sampler;
pub mod sbc;
mod settings;
mod simulator;
mod small_budget;
mod sobol;
mod stage;
mod stream;
mod summary;
mod surrogate;
mod target;
pub mod trust;
mod weighted;

pub use calibrate::{calibrate, calibrate_joint};
pub use density::{DensitySummary, sample_density, sample_density_in};
pub use design::calibrate_design;
pub use draw::{Draw, Point, distinct};
pub use error::CalibrateError;
pub use estimate::MovedBy;
pub use first_proposal::FirstProposal;
pub use joint::{Group, JointProblem};
pub use leave_one_out::{LeaveOneOut, LeaveOneOutPoint, leave_one_out, leave_one_out_of};
pub use noise::{
    DistanceScale, FixedSigma, Likelihood, Noise, NoiseDraw, NoiseError, NoiseQuantity, NoiseShape,
    ShapeSummary, SigmaSummary,
};
pub use observations::{ObservationError, Observations};
pub use posterior::{
    BandPoint, Counters, Evidence, Failing, FailingPlace, Failure, GroupSummary, Interval,
    MapPoint, Moments, ParameterSummary, PathParameter, PathPoint, Posterior, PredictiveCheck,
    Residuals, Sample, StopReason,
};
pub use predicted::{Simulations, predicted_outputs};
pub use predictive::{predictive_band, predictive_band_of_group};
pub use prior::{Coordinate, Prior, PriorError, PriorSpec};
pub use problem::{Parameter, Problem};
pub use reweight::{Reweighted, reweighted};
pub use settings::Settings;
pub use simulator::{FnSimulator, SimError, Simulator};
pub use stage::{ComponentRecord, MixtureRecord, Observer, StageRecord};
pub use target::Target;
pub use trust::{Concern, Trust, Verdict};
pub use weighted::{EffectiveSampleSize, Weighted};
