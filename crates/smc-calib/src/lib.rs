//! Bayesian calibration of simulators: recursive Bayes over a measured curve, sampled by iteratively refined
//! Gaussian-mixture proposals whose weights make the answer right.
//!
//! ```
//! use smc_calib::{FnSimulator, Noise, Observations, Parameter, Prior, PriorSpec, Problem, Settings, calibrate};
//!
//! // y = exp(-t / tau), measured at four times.
//! let times = [0.5, 1.0, 2.0, 4.0];
//! let simulator = FnSimulator::new(1, 4, move |theta: &[f64], out: &mut [f64]| {
//!     for (o, t) in out.iter_mut().zip(times) {
//!         *o = (-t / theta[0]).exp();
//!     }
//!     Ok(())
//! });
//! let problem = Problem {
//!     simulator: &simulator,
//!     parameters: vec![Parameter::new("tau", "s", Prior::new(PriorSpec::LogUniform { lower: 0.1, upper: 100.0 })?)],
//!     observations: Observations::new(times.to_vec(), vec![0.78, 0.61, 0.36, 0.14])?,
//!     noise: Noise::Inferred { nu0: 4.0, s0: 0.02 },
//! };
//! let posterior = calibrate(&problem, &Settings { samples: 2048, ..Settings::default() }, &mut ())?;
//! let tau = posterior.parameters[0].in_si.eti95;
//! assert!(tau.lower < 2.0 && 2.0 < tau.upper && posterior.khat < 0.7);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// Loops over matrix rows and columns read like the formulas they compute.
#![allow(clippy::needless_range_loop)]

#[doc(hidden)]
pub mod bench_support;
mod calibrate;
mod cholesky;
mod control;
mod density;
mod design;
mod em;
mod error;
mod estimate;
mod gaussian_process;
mod joint;
mod lanes;
mod leave_one_out;
mod map_search;
mod marginal;
mod mixture;
mod neighbours;
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

pub use calibrate::{Observer, calibrate, calibrate_joint};
pub use density::{DensitySummary, sample_density, sample_density_in};
pub use design::calibrate_design;
pub use error::CalibrateError;
pub use joint::{Group, JointProblem};
pub use leave_one_out::{LeaveOneOut, LeaveOneOutPoint, leave_one_out, leave_one_out_of};
pub use noise::{FixedSigma, Likelihood, Noise, NoiseError};
pub use observations::{ObservationError, Observations};
pub use posterior::{
    BandPoint, Counters, Draw, EffectiveSampleSize, Evidence, Failure, GroupSummary, Interval,
    MapPoint, Moments, ParameterSummary, PathParameter, PathPoint, Posterior, Residuals, Sample,
    SigmaSummary, StopReason,
};
pub use predictive::{predictive_band, predictive_band_of_group};
pub use prior::{Coordinate, Prior, PriorError, PriorSpec};
pub use problem::{Parameter, Problem};
pub use settings::Settings;
pub use simulator::{FnSimulator, SimError, Simulator};
pub use stage::{ComponentRecord, MixtureRecord, StageRecord};
pub use target::Target;
pub use trust::{Concern, Trust, Verdict};
