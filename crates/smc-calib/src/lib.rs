//! Bayesian calibration of simulators.

mod calibrate;
mod error;
mod noise;
pub mod normal;
mod observations;
mod posterior;
mod prior;
mod problem;
mod settings;
mod simulator;
mod warning;

pub use calibrate::{Observer, calibrate};
pub use error::CalibrateError;
pub use noise::{FixedSigma, Likelihood, Noise, NoiseError};
pub use observations::{ObservationError, Observations};
pub use posterior::{
    BandPoint, ComponentRecord, Counters, Draw, EffectiveSampleSize, Evidence, Failure, Interval,
    MapPoint, MixtureRecord, Moments, ParameterSummary, PathParameter, PathPoint, Posterior,
    Residuals, Sample, SigmaSummary, StageRecord, StopReason,
};
pub use prior::{Coordinate, Prior, PriorError, PriorSpec};
pub use problem::{Parameter, Problem};
pub use settings::Settings;
pub use simulator::{FnSimulator, SimError, Simulator};
pub use warning::Warning;
