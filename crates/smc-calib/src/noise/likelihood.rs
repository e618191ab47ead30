//! The likelihood of a curve, and recursive Bayes over its observations.

use super::correlated::Correlated;
use super::robust::Robust;
use super::student::student_constants;
use super::{FixedSigma, Noise, NoiseError};
use crate::Observations;
use crate::normal::LN_SQRT_2PI;
use statrs::function::gamma::ln_gamma;

/// The likelihood of a simulated curve under a checked noise model.
#[derive(Clone, Debug, PartialEq)]
pub struct Likelihood {
    pub(super) values: Vec<f64>,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// nu0, nu0 s0^2, the constant of the joint density and of that of every prefix of the observations.
    Inferred { nu0: f64, sum0: f64, constant: f64, prefix: Vec<f64> },
    /// 1/sigma per observation and the constant.
    Fixed { inverse_sigma: Vec<f64>, constant: f64 },
    /// Sum of squares only.
    Tuned,
    /// Errors that are alike near each other.
    Correlated(Correlated),
    /// Errors with outliers.
    Robust(Robust),
}

impl Likelihood {
    /// Checks a noise model against the observations.
    ///
    /// # Errors
    /// Numbers that are not positive, per-point noise that was not given, or distances that cannot be measured.
    pub fn new(noise: &Noise, observations: &Observations) -> Result<Self, NoiseError> {
        let values = observations.values().to_vec();
        let kind = match noise {
            Noise::Inferred { nu0, s0 } => inferred(*nu0, *s0, &values)?,
            Noise::Fixed { sigma } => fixed(sigma, observations)?,
            Noise::EssTarget { share } => {
                if !(*share > 0.0 && *share < 1.0) {
                    return Err(NoiseError::Share { value: *share });
                }
                Kind::Tuned
            }
            Noise::Correlated { nu0, s0, scale, nodes } => {
                let sum0 = prior_sum(*nu0, *s0)?;
                match Correlated::new([*nu0, sum0], *scale, *nodes, observations)? {
                    Some(model) => Kind::Correlated(model),
                    None => inferred(*nu0, *s0, &values)?,
                }
            }
            Noise::Robust { nu0, s0 } => {
                prior_sum(*nu0, *s0)?;
                Kind::Robust(Robust::new(*nu0, *s0, observations)?)
            }
        };
        Ok(Self { values, kind })
    }

    /// Log likelihood of the whole curve.
    ///
    /// # Formula
    /// correlated and robust: see their modules; inferred: `ln Gamma((nu0+m)/2) - ln Gamma(nu0/2) - (m/2) ln(pi nu0 s0^2) - (nu0+m)/2 ln(1 + S/(nu0 s0^2))`,
    /// S the sum of squared residuals; fixed: `-sum (r/sigma)^2/2 - sum ln(sigma sqrt(2 pi))`;
    /// ess-target: `-S/2`, to be divided by the tuned sigma^2.
    pub fn ln_joint(&self, outputs: &[f64]) -> f64 {
        match &self.kind {
            Kind::Inferred { nu0, sum0, constant, .. } => {
                let s = self.sum_of_squares(outputs);
                constant - 0.5 * (nu0 + self.values.len() as f64) * (s / sum0).ln_1p()
            }
            Kind::Fixed { inverse_sigma, constant } => {
                let s: f64 = outputs
                    .iter()
                    .zip(&self.values)
                    .zip(inverse_sigma)
                    .map(|((o, y), w)| ((y - o) * w).powi(2))
                    .sum();
                constant - 0.5 * s
            }
            Kind::Tuned => -0.5 * self.sum_of_squares(outputs),
            Kind::Correlated(model) => model.ln_joint(&self.values, outputs),
            Kind::Robust(model) => model.ln_joint(&self.values, outputs),
        }
    }

    /// Recursive Bayes: calls `visit(k, ln p(y_k | y_1..y_{k-1}, theta))` for every observation in order.
    ///
    /// With `inferred` noise each factor is the Student-t predictive density of the conjugate update
    /// `nu <- nu + 1`, `nu s^2 <- nu s^2 + r^2`.
    pub fn recursion(&self, outputs: &[f64], mut visit: impl FnMut(usize, f64)) {
        match &self.kind {
            Kind::Inferred { nu0, sum0, .. } => {
                let (mut nu, mut sum) = (*nu0, *sum0);
                // ln Gamma((nu+1)/2) - ln Gamma(nu/2), advanced two steps at a time.
                let mut ratio = [gamma_ratio(nu), gamma_ratio(nu + 1.0)];
                for (k, (o, y)) in outputs.iter().zip(&self.values).enumerate() {
                    let r2 = (y - o) * (y - o);
                    let ln = ratio[k % 2]
                        - 0.5 * (std::f64::consts::PI * sum).ln()
                        - 0.5 * (nu + 1.0) * (r2 / sum).ln_1p();
                    visit(k, ln);
                    ratio[k % 2] += ((nu + 1.0) / nu).ln();
                    nu += 1.0;
                    sum += r2;
                }
            }
            Kind::Fixed { inverse_sigma, .. } => {
                for (k, ((o, y), w)) in
                    outputs.iter().zip(&self.values).zip(inverse_sigma).enumerate()
                {
                    visit(k, w.ln() - LN_SQRT_2PI - 0.5 * ((y - o) * w).powi(2));
                }
            }
            Kind::Tuned => {
                for (k, (o, y)) in outputs.iter().zip(&self.values).enumerate() {
                    visit(k, -0.5 * (y - o) * (y - o));
                }
            }
            Kind::Correlated(_) | Kind::Robust(_) => {
                let mut cumulative = vec![0.0; self.values.len()];
                self.ln_cumulative(outputs, &mut cumulative);
                let mut before = 0.0;
                for (k, ln) in cumulative.into_iter().enumerate() {
                    visit(k, ln - before);
                    before = ln;
                }
            }
        }
    }

    /// Log likelihood of the first 1, 2, .. observations: the running sums of [`Likelihood::recursion`], from
    /// the joint density of each prefix (one logarithm per observation in place of three).
    pub fn ln_cumulative(&self, outputs: &[f64], cumulative: &mut [f64]) {
        match &self.kind {
            Kind::Inferred { nu0, sum0, prefix, .. } => {
                let (mut s, mut nu) = (0.0, *nu0);
                for (((o, y), c), out) in
                    outputs.iter().zip(&self.values).zip(prefix).zip(cumulative)
                {
                    s += (y - o) * (y - o);
                    nu += 1.0;
                    *out = c - 0.5 * nu * (1.0 + s / sum0).ln();
                }
            }
            Kind::Correlated(model) => model.ln_cumulative(&self.values, outputs, cumulative),
            Kind::Robust(model) => model.ln_cumulative(&self.values, outputs, cumulative),
            Kind::Fixed { .. } | Kind::Tuned => {
                let mut sum = 0.0;
                self.recursion(outputs, |k, ln| {
                    sum += ln;
                    cumulative[k] = sum;
                });
            }
        }
    }

    /// Sum of squared residuals that belongs to a joint log likelihood of inferred noise.
    pub(crate) fn sum_of_squares_at(&self, ln_joint: f64) -> Option<f64> {
        match &self.kind {
            Kind::Inferred { nu0, sum0, constant, .. } => {
                let nu = nu0 + self.values.len() as f64;
                Some((sum0 * ((constant - ln_joint) * 2.0 / nu).exp_m1()).max(0.0))
            }
            _ => None,
        }
    }

    /// Sum of squared residuals.
    pub fn sum_of_squares(&self, outputs: &[f64]) -> f64 {
        outputs.iter().zip(&self.values).map(|(o, y)| (y - o) * (y - o)).sum()
    }

    /// Observed minus simulated.
    pub(super) fn residuals(&self, outputs: &[f64]) -> Vec<f64> {
        self.values.iter().zip(outputs).map(|(y, o)| y - o).collect()
    }

    /// Observed values.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Degrees of freedom and sum of squares `(nu0, nu0 s0^2)` of inferred noise.
    pub fn inferred(&self) -> Option<(f64, f64)> {
        match self.kind {
            Kind::Inferred { nu0, sum0, .. } => Some((nu0, sum0)),
            _ => None,
        }
    }

    /// The standard deviation where it is known and the same for all observations.
    pub fn common_sigma(&self) -> Option<f64> {
        match &self.kind {
            Kind::Fixed { inverse_sigma, .. }
                if inverse_sigma.iter().all(|w| *w == inverse_sigma[0]) =>
            {
                Some(1.0 / inverse_sigma[0])
            }
            _ => None,
        }
    }

    /// Known standard deviation of observation `index`.
    pub fn fixed_sigma(&self, index: usize) -> Option<f64> {
        match &self.kind {
            Kind::Fixed { inverse_sigma, .. } => Some(1.0 / inverse_sigma[index]),
            _ => None,
        }
    }
}

/// A number of a noise model that must be positive.
fn positive(field: &'static str, value: f64) -> Result<(), NoiseError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(NoiseError::NotPositive { field, value })
    }
}

/// `nu0 s0^2`, checked.
fn prior_sum(nu0: f64, s0: f64) -> Result<f64, NoiseError> {
    for (field, value, range) in [("nu0", nu0, [1e-6, 1e9]), ("s0", s0, [1e-150, 1e150])] {
        positive(field, value)?;
        if !(range[0]..=range[1]).contains(&value) {
            return Err(NoiseError::OutOfRange { field, value, range });
        }
    }
    Ok(nu0 * s0 * s0)
}

fn inferred(nu0: f64, s0: f64, values: &[f64]) -> Result<Kind, NoiseError> {
    let sum0 = prior_sum(nu0, s0)?;
    let m = values.len() as f64;
    // Multivariate Student t: nu0 degrees of freedom, scale s0 in every direction.
    let constant = ln_gamma(0.5 * (nu0 + m))
        - ln_gamma(0.5 * nu0)
        - 0.5 * m * (std::f64::consts::PI * sum0).ln();
    let prefix = student_constants(nu0, sum0, values.len());
    Ok(Kind::Inferred { nu0, sum0, constant, prefix })
}

fn fixed(sigma: &FixedSigma, observations: &Observations) -> Result<Kind, NoiseError> {
    let values = observations.values();
    let sigma = match sigma {
        FixedSigma::Absolute(s) => {
            positive("sigma", *s)?;
            vec![*s; values.len()]
        }
        FixedSigma::Relative(share) => {
            positive("relative sigma", *share)?;
            if let Some(index) = values.iter().position(|v| *v == 0.0) {
                return Err(NoiseError::RelativeToZero { index });
            }
            values.iter().map(|v| share * v.abs()).collect()
        }
        FixedSigma::PerPoint => observations.sigma().ok_or(NoiseError::NoColumn)?.to_vec(),
    };
    let constant = -sigma.iter().map(|s| s.ln() + LN_SQRT_2PI).sum::<f64>();
    Ok(Kind::Fixed { inverse_sigma: sigma.iter().map(|s| 1.0 / s).collect(), constant })
}

fn gamma_ratio(nu: f64) -> f64 {
    ln_gamma(0.5 * (nu + 1.0)) - ln_gamma(0.5 * nu)
}
