//! Bayesian calibration of simulators.

#[doc(hidden)]
pub mod bench_support;
mod calibrate;
mod density;
mod em;
mod error;
mod estimate;
mod map_search;
mod marginal;
mod mixture;
mod noise;
pub mod normal;
mod observations;
mod path;
mod pool;
mod posterior;
mod predictive;
mod prior;
mod problem;
pub mod psis;
pub mod quadrature;
pub mod reference;
mod residuals;
mod sampler;
mod settings;
mod simulator;
mod sobol;
mod stream;
mod summary;
mod target;
mod warning;

pub use calibrate::{Observer, calibrate};
pub use density::{DensitySummary, sample_density};
pub use error::CalibrateError;
pub use noise::{FixedSigma, Likelihood, Noise, NoiseError};
pub use observations::{ObservationError, Observations};
pub use posterior::{
    BandPoint, ComponentRecord, Counters, Draw, EffectiveSampleSize, Evidence, Failure, Interval,
    MapPoint, MixtureRecord, Moments, ParameterSummary, PathParameter, PathPoint, Posterior,
    Residuals, Sample, SigmaSummary, StageRecord, StopReason,
};
pub use predictive::predictive_band;
pub use prior::{Coordinate, Prior, PriorError, PriorSpec};
pub use problem::{Parameter, Problem};
pub use settings::Settings;
pub use simulator::{FnSimulator, SimError, Simulator};
pub use target::Target;
pub use warning::Warning;
