//! Prior distributions, and the normal score in which calibration works.
//!
//! With F the prior's distribution function, `z = Phi^-1(F(theta))` turns every prior into a
//! standard normal: the support is unbounded and no sample is ever clamped or rejected at a bound.

use crate::normal::{self, LN_SQRT_2PI, Tails};
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_10;
use thiserror::Error;

/// A prior as a user writes it; [`Prior::new`] checks it.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PriorSpec {
    /// Constant density between two bounds.
    Uniform {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Constant density of the logarithm between two positive bounds.
    LogUniform {
        /// Lower bound, positive.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Normal.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sd: f64,
    },
    /// log10 of the parameter is normal.
    LogNormal {
        /// Median of the parameter, positive.
        median: f64,
        /// Standard deviation of log10 of the parameter (decades).
        sd_log10: f64,
    },
    /// Normal, conditioned to lie between two bounds.
    TruncatedNormal {
        /// Mean of the normal before truncation.
        mean: f64,
        /// Standard deviation of the normal before truncation.
        sd: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

/// The coordinate in which a prior is plain, and in which results are summarised first.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinate {
    /// The parameter itself.
    Linear,
    /// log10 of the parameter.
    Log10,
}

impl Coordinate {
    /// The coordinate of a parameter value.
    pub fn of(self, theta: f64) -> f64 {
        match self {
            Self::Linear => theta,
            Self::Log10 => theta.log10(),
        }
    }

    /// The parameter value at a coordinate.
    pub fn theta(self, coordinate: f64) -> f64 {
        match self {
            Self::Linear => coordinate,
            Self::Log10 => 10f64.powf(coordinate),
        }
    }
}

/// Why a prior was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PriorError {
    /// NaN or infinity.
    #[error("{field} is {value}; it must be finite")]
    NotFinite {
        /// Field of the prior.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Zero or negative where only positive values make sense.
    #[error("{field} is {value}; it must be positive")]
    NotPositive {
        /// Field of the prior.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Bounds out of order.
    #[error("lower bound {lower} is not below the upper bound {upper}; swap or separate them")]
    Bounds {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// Truncated so far out that nothing is left of the normal.
    #[error(
        "the normal of mean {mean} and sd {sd} has no probability between {lower} and {upper}; move the mean or widen the bounds"
    )]
    NoMass {
        /// Mean before truncation.
        mean: f64,
        /// Standard deviation before truncation.
        sd: f64,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

/// A checked prior.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "PriorSpec", into = "PriorSpec")]
pub struct Prior {
    spec: PriorSpec,
    kernel: Kernel,
}

/// Constants of the evaluation, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kernel {
    /// theta (or its logarithm) is uniform.
    Flat { log: bool, from: f64, to: f64, lower: f64, upper: f64 },
    /// theta (or its natural logarithm) is normal.
    Normal { log: bool, centre: f64, sd: f64 },
    /// Normal between two bounds: tail areas of the bounds and the mass between.
    Truncated { mean: f64, sd: f64, lower: f64, upper: f64, below: f64, above: f64, mass: f64 },
}

impl TryFrom<PriorSpec> for Prior {
    type Error = PriorError;

    fn try_from(spec: PriorSpec) -> Result<Self, PriorError> {
        Self::new(spec)
    }
}

impl From<Prior> for PriorSpec {
    fn from(prior: Prior) -> Self {
        prior.spec
    }
}

fn finite(field: &'static str, value: f64) -> Result<(), PriorError> {
    if value.is_finite() { Ok(()) } else { Err(PriorError::NotFinite { field, value }) }
}

fn positive(field: &'static str, value: f64) -> Result<(), PriorError> {
    finite(field, value)?;
    if value > 0.0 { Ok(()) } else { Err(PriorError::NotPositive { field, value }) }
}

fn ordered(lower: f64, upper: f64) -> Result<(), PriorError> {
    finite("lower", lower)?;
    finite("upper", upper)?;
    if lower < upper && (upper - lower).is_finite() {
        Ok(())
    } else {
        Err(PriorError::Bounds { lower, upper })
    }
}

impl Prior {
    /// Checks a specification.
    ///
    /// # Errors
    /// Bounds out of order, a scale that is not positive, numbers that are not finite, or a truncation without mass.
    pub fn new(spec: PriorSpec) -> Result<Self, PriorError> {
        let kernel = match spec {
            PriorSpec::Uniform { lower, upper } => {
                ordered(lower, upper)?;
                Kernel::Flat { log: false, from: lower, to: upper, lower, upper }
            }
            PriorSpec::LogUniform { lower, upper } => {
                positive("lower", lower)?;
                positive("upper", upper)?;
                ordered(lower, upper)?;
                Kernel::Flat { log: true, from: lower.ln(), to: upper.ln(), lower, upper }
            }
            PriorSpec::Normal { mean, sd } => {
                finite("mean", mean)?;
                positive("sd", sd)?;
                Kernel::Normal { log: false, centre: mean, sd }
            }
            PriorSpec::LogNormal { median, sd_log10 } => {
                positive("median", median)?;
                positive("sd_log10", sd_log10)?;
                Kernel::Normal { log: true, centre: median.ln(), sd: sd_log10 * LN_10 }
            }
            PriorSpec::TruncatedNormal { mean, sd, lower, upper } => {
                finite("mean", mean)?;
                positive("sd", sd)?;
                ordered(lower, upper)?;
                let (a, b) = ((lower - mean) / sd, (upper - mean) / sd);
                let (below, above) = (normal::cdf(a), normal::cdf(-b));
                let mass = if a > 0.0 {
                    normal::cdf(-a) - above
                } else if b < 0.0 {
                    normal::cdf(b) - below
                } else {
                    1.0 - below - above
                };
                if mass < f64::MIN_POSITIVE {
                    return Err(PriorError::NoMass { mean, sd, lower, upper });
                }
                Kernel::Truncated { mean, sd, lower, upper, below, above, mass }
            }
        };
        Ok(Self { spec, kernel })
    }

    /// The specification this prior was made from.
    pub fn spec(&self) -> &PriorSpec {
        &self.spec
    }

    /// The coordinate in which the prior is plain.
    pub fn coordinate(&self) -> Coordinate {
        match self.kernel {
            Kernel::Flat { log: true, .. } | Kernel::Normal { log: true, .. } => Coordinate::Log10,
            _ => Coordinate::Linear,
        }
    }

    /// The parameter value at a normal score: the inverse of [`Prior::to_z`], within the bounds.
    pub fn from_z(&self, z: f64) -> f64 {
        match self.kernel {
            Kernel::Normal { log, centre, sd } => {
                let x = centre + sd * z;
                if log { x.exp() } else { x }
            }
            _ => self.at(normal::tails(z)),
        }
    }

    /// The parameter value with these prior tail areas.
    pub fn at(&self, tails: Tails) -> f64 {
        match self.kernel {
            Kernel::Flat { log, from, to, lower, upper } => {
                let x = if tails.below <= tails.above {
                    from + (to - from) * tails.below
                } else {
                    to - (to - from) * tails.above
                };
                (if log { x.exp() } else { x }).clamp(lower, upper)
            }
            Kernel::Normal { .. } => self.from_z(normal::quantile_of(tails)),
            Kernel::Truncated { mean, sd, lower, upper, below, above, mass } => {
                let inner =
                    Tails { below: below + tails.below * mass, above: above + tails.above * mass };
                (mean + sd * normal::quantile_of(inner)).clamp(lower, upper)
            }
        }
    }

    /// The parameter value below which a share `p` of the prior lies.
    pub fn quantile(&self, p: f64) -> f64 {
        self.at(Tails { below: p, above: 1.0 - p })
    }

    /// Both prior tail areas of a parameter value: F(theta) and 1 - F(theta), each to its own relative precision.
    pub fn tails(&self, theta: f64) -> Tails {
        match self.kernel {
            Kernel::Flat { log, lower, upper, .. } => {
                if theta <= lower {
                    return Tails { below: 0.0, above: 1.0 };
                }
                if theta >= upper {
                    return Tails { below: 1.0, above: 0.0 };
                }
                if log {
                    // ln of a ratio near one keeps its digits as ln(1 + x).
                    let width = (upper / lower).ln();
                    let from_below = ((theta - lower) / lower).ln_1p() / width;
                    let from_above = -((theta - upper) / upper).ln_1p() / width;
                    Tails { below: from_below, above: from_above }
                } else {
                    let width = upper - lower;
                    Tails { below: (theta - lower) / width, above: (upper - theta) / width }
                }
            }
            Kernel::Normal { .. } => normal::tails(self.to_z(theta)),
            Kernel::Truncated { mean, sd, lower, upper, below, above, mass } => {
                if theta <= lower {
                    return Tails { below: 0.0, above: 1.0 };
                }
                if theta >= upper {
                    return Tails { below: 1.0, above: 0.0 };
                }
                let t = (theta - mean) / sd;
                let (lo, hi) = (normal::cdf(t), normal::cdf(-t));
                let (a, b) = ((lower - mean) / sd, (upper - mean) / sd);
                // Differences are taken on the side on which the areas are small.
                let from_below = if a > 0.0 { normal::cdf(-a) - hi } else { lo - below };
                let from_above = if b < 0.0 { normal::cdf(b) - lo } else { hi - above };
                Tails {
                    below: (from_below / mass).clamp(0.0, 1.0),
                    above: (from_above / mass).clamp(0.0, 1.0),
                }
            }
        }
    }

    /// The normal score of a parameter value; infinite at and beyond a bound.
    pub fn to_z(&self, theta: f64) -> f64 {
        match self.kernel {
            Kernel::Normal { log, centre, sd } => {
                let x = if log { theta.ln() } else { theta };
                (x - centre) / sd
            }
            _ => normal::quantile_of(self.tails(theta)),
        }
    }

    /// Log of the prior density with respect to theta; minus infinity outside the support.
    pub fn ln_density(&self, theta: f64) -> f64 {
        match self.kernel {
            Kernel::Flat { log, from, to, lower, upper } => {
                if !(lower..=upper).contains(&theta) {
                    f64::NEG_INFINITY
                } else {
                    -(to - from).ln() - if log { theta.ln() } else { 0.0 }
                }
            }
            Kernel::Normal { log, centre, sd } => {
                if log && theta <= 0.0 {
                    return f64::NEG_INFINITY;
                }
                let x = if log { theta.ln() } else { theta };
                normal::ln_density((x - centre) / sd) - sd.ln() - if log { x } else { 0.0 }
            }
            Kernel::Truncated { mean, sd, lower, upper, mass, .. } => {
                if !(lower..=upper).contains(&theta) {
                    f64::NEG_INFINITY
                } else {
                    normal::ln_density((theta - mean) / sd) - sd.ln() - mass.ln()
                }
            }
        }
    }

    /// Log of the prior density with respect to [`Prior::coordinate`].
    pub fn ln_density_in_coordinate(&self, theta: f64) -> f64 {
        match self.coordinate() {
            Coordinate::Linear => self.ln_density(theta),
            Coordinate::Log10 => self.ln_density(theta) + (theta * LN_10).ln(),
        }
    }

    /// The coordinate of a parameter value.
    pub fn to_coordinate(&self, theta: f64) -> f64 {
        self.coordinate().of(theta)
    }

    /// Bounds of the support, infinite where there are none.
    pub fn support(&self) -> (f64, f64) {
        match self.kernel {
            Kernel::Flat { lower, upper, .. } | Kernel::Truncated { lower, upper, .. } => {
                (lower, upper)
            }
            Kernel::Normal { log: true, .. } => (0.0, f64::INFINITY),
            Kernel::Normal { log: false, .. } => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// Mean in the coordinate.
    pub fn mean(&self) -> f64 {
        match self.kernel {
            Kernel::Flat { log, from, to, .. } => 0.5 * (from + to) / if log { LN_10 } else { 1.0 },
            Kernel::Normal { log, centre, .. } => centre / if log { LN_10 } else { 1.0 },
            Kernel::Truncated { mean, sd, lower, upper, mass, .. } => {
                let density = |t: f64| (normal::ln_density(t) - mass.ln()).exp();
                mean + sd * (density((lower - mean) / sd) - density((upper - mean) / sd))
            }
        }
    }

    /// Standard deviation in the coordinate.
    pub fn sd(&self) -> f64 {
        match self.kernel {
            Kernel::Flat { log, from, to, .. } => {
                (to - from) / 12f64.sqrt() / if log { LN_10 } else { 1.0 }
            }
            Kernel::Normal { log, sd, .. } => sd / if log { LN_10 } else { 1.0 },
            Kernel::Truncated { .. } => {
                // The closed form cancels when the truncation is far out; the quantile integral does not.
                let points = 4096;
                let (mut sum, mut squares) = (0.0, 0.0);
                let centre = self.mean();
                for i in 0..points {
                    let p = (f64::from(i) + 0.5) / f64::from(points);
                    let x = self.quantile(p) - centre;
                    sum += x;
                    squares += x * x;
                }
                let n = f64::from(points);
                (squares / n - (sum / n).powi(2)).max(0.0).sqrt()
            }
        }
    }

    /// Differential entropy of the prior in the coordinate, in nats.
    pub fn entropy(&self) -> f64 {
        let log10_scale = |log: bool| if log { LN_10.ln() } else { 0.0 };
        match self.kernel {
            Kernel::Flat { log, from, to, .. } => (to - from).ln() - log10_scale(log),
            Kernel::Normal { log, sd, .. } => 0.5 + LN_SQRT_2PI + sd.ln() - log10_scale(log),
            Kernel::Truncated { .. } => {
                let points = 4096;
                (0..points)
                    .map(|i| {
                        -self.ln_density(self.quantile((f64::from(i) + 0.5) / f64::from(points)))
                    })
                    .sum::<f64>()
                    / f64::from(points)
            }
        }
    }
}
