//! Noise models: how measured values scatter around the simulated ones.

mod correlated;
mod draws;
mod likelihood;
mod made;
mod robust;
mod rule;
mod scale;
mod student;
#[cfg(test)]
mod tests;

pub(crate) use draws::NoiseDraws;
pub use draws::{NoiseDraw, NoiseQuantity, NoiseShape, ShapeSummary, SigmaSummary};
pub use likelihood::Likelihood;
pub use scale::DistanceScale;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How measured values scatter around the simulated ones.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Noise {
    /// Normal with unknown standard deviation, sigma^2 ~ Inverse-Gamma(nu0/2, nu0 s0^2/2), integrated out.
    Inferred {
        /// Prior degrees of freedom.
        nu0: f64,
        /// Prior scale of sigma, in the unit of the observations.
        s0: f64,
    },
    /// Normal and alike near each other: an independent part beside an Ornstein-Uhlenbeck process, of covariance
    /// `sigma^2 (w [i = j] + (1 - w) exp(-|s_i - s_j|/l))`. sigma^2 as in [`Noise::Inferred`]; the correlation length l is
    /// log-uniform over 1 to 100 % of the range of s, the white share w has density w^(-2/3)/3 over (0, 1).
    /// All three are integrated out. With fewer than three different s there is no correlation to be seen, and the errors are
    /// those of [`Noise::Inferred`].
    Correlated {
        /// Prior degrees of freedom.
        nu0: f64,
        /// Prior scale of sigma, in the unit of the observations.
        s0: f64,
        /// What s is; by the rule of [`DistanceScale::of`] where it is not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        scale: Option<DistanceScale>,
        /// Number of quadrature nodes over l and over w; by the number of observations where it is not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        nodes: Option<[usize; 2]>,
    },
    /// Normal with outliers: `0.995 N(0, sigma^2) + 0.005 N(0, (10 sigma)^2)`, independent of each other. sigma^2 as in
    /// [`Noise::Inferred`], integrated out.
    Robust {
        /// Prior degrees of freedom.
        nu0: f64,
        /// Prior scale of sigma, in the unit of the observations.
        s0: f64,
    },
    /// Normal with known standard deviation.
    Fixed {
        /// The standard deviation.
        sigma: FixedSigma,
    },
    /// GrainLearning's tuning: sigma is chosen so that a wished-for effective sample size appears, and the
    /// proposals are not corrected for. The result is *not a posterior*; kept for comparison.
    EssTarget {
        /// Wished-for effective sample size as a share of an iteration's samples.
        share: f64,
    },
}

impl Default for Noise {
    fn default() -> Self {
        Self::Inferred { nu0: 4.0, s0: 0.05 }
    }
}

impl Noise {
    /// Correlated errors with the default prior, scale and nodes.
    pub fn correlated() -> Self {
        Self::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes: None }
    }

    /// The model with the scale that it takes for observations at `control`.
    pub fn at(self, control: &[f64]) -> Self {
        match self {
            Self::Correlated { nu0, s0, scale: None, nodes } => {
                Self::Correlated { nu0, s0, scale: Some(DistanceScale::of(control)), nodes }
            }
            other => other,
        }
    }

    /// The same expectation of sigma with correlated errors; none where sigma is not one number for all observations, or
    /// correlation is there already.
    pub fn with_correlation(&self) -> Option<Self> {
        let (nu0, s0) = match *self {
            Self::Inferred { nu0, s0 } | Self::Robust { nu0, s0 } => (nu0, s0),
            Self::Fixed { sigma: FixedSigma::Absolute(sigma) } => (4.0, sigma),
            _ => return None,
        };
        Some(Self::Correlated { nu0, s0, scale: None, nodes: None })
    }

    /// Name of the kind, as in files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Inferred { .. } => "inferred",
            Self::Correlated { .. } => "correlated",
            Self::Robust { .. } => "robust",
            Self::Fixed { .. } => "fixed",
            Self::EssTarget { .. } => "ess-target",
        }
    }

    /// Whether errors near each other may be alike.
    pub fn is_correlated(&self) -> bool {
        matches!(self, Self::Correlated { .. })
    }

    /// Whether sigma is tuned for an effective sample size, and the result is no posterior.
    pub fn is_tuned(&self) -> bool {
        matches!(self, Self::EssTarget { .. })
    }

    /// Errors with outliers and the default prior.
    pub fn robust() -> Self {
        Self::Robust { nu0: 4.0, s0: 0.05 }
    }
}

/// A known noise standard deviation.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FixedSigma {
    /// The same for all observations, in their unit.
    Absolute(f64),
    /// A share of each measured value.
    Relative(f64),
    /// One per observation: [`Observations::with_sigma`](crate::Observations::with_sigma).
    PerPoint,
}

/// Why a noise model was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum NoiseError {
    /// A number that must be positive.
    #[error("noise {field} is {value}; it must be positive and finite")]
    NotPositive {
        /// Field of the noise model.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number of the prior of sigma that cannot be computed with.
    #[error(
        "noise {field} is {value:e}; it must be between {:e} and {:e}", range[0], range[1]
    )]
    OutOfRange {
        /// Field of the noise model.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        range: [f64; 2],
    },
    /// A prior of sigma that the sum over sigma of robust noise cannot follow.
    #[error(
        "robust noise with nu0 = {nu0:e}, s0 = {s0:e} and {rows} observations takes too many values of sigma; give an s0 of about the scatter that is expected, and nu0 below ten thousand"
    )]
    TooManySigmas {
        /// Degrees of freedom of the prior.
        nu0: f64,
        /// Scale of the prior.
        s0: f64,
        /// Number of observations.
        rows: usize,
    },
    /// A share outside (0, 1).
    #[error("noise share is {value}; it must lie between 0 and 1, both excluded")]
    Share {
        /// Its value.
        value: f64,
    },
    /// Relative noise of a zero measurement.
    #[error(
        "observation {index} is zero, so noise relative to it is zero too; give absolute noise or one sigma per point"
    )]
    RelativeToZero {
        /// Observation, from 0.
        index: usize,
    },
    /// Per-point noise without a noise column.
    #[error("noise per point needs a standard deviation for each observation; none were given")]
    NoColumn,
    /// Distances in the logarithm of a negative number.
    #[error(
        "control value {control} of observation {index} has no logarithm; measure distances of correlated noise in the control variable itself (scale linear)"
    )]
    LogOfNegative {
        /// Observation, from 0.
        index: usize,
        /// Its control value.
        control: f64,
    },
    /// A number of quadrature nodes.
    #[error("correlated noise has {nodes} quadrature nodes over its {field}; give 1 to 64")]
    Nodes {
        /// What they are nodes of.
        field: &'static str,
        /// Their number.
        nodes: usize,
    },
    /// Correlated noise of very many observations.
    #[error(
        "correlated noise of {observations} observations takes too much memory; give at most {most}, or another noise model"
    )]
    TooManyCorrelated {
        /// Number of observations.
        observations: usize,
        /// Most.
        most: usize,
    },
    /// Curves that are not kept whole.
    #[error(
        "correlated and robust noise need every curve whole, {numbers} numbers here; give fewer simulations or observations, up to 6e7 in product"
    )]
    CurvesNotKept {
        /// Simulations times observations.
        numbers: usize,
    },
    /// Tuned noise of one of several groups.
    #[error(
        "the noise of group {group} is to be tuned, which is done for one group of observations only; give inferred or fixed noise"
    )]
    TunedGroup {
        /// Name of the group.
        group: String,
    },
    /// The noise model of one of several groups.
    #[error("group {group}: {error}")]
    OfGroup {
        /// Name of the group.
        group: String,
        /// The problem.
        error: Box<NoiseError>,
    },
}

impl NoiseError {
    /// Says which group it is about.
    pub(crate) fn of_group(self, group: &str) -> Self {
        Self::OfGroup { group: group.to_owned(), error: Box::new(self) }
    }
}
