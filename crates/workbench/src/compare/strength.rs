//! Words for Bayes factors.

use std::fmt;

use serde::Serialize;

use crate::number::significant;

/// Evidence against a model whose Bayes factor to the best one is 1 to K: the scale of R.E. Kass and A.E. Raftery,
/// "Bayes factors", J. Am. Stat. Assoc. 90 (1995) 773, after H. Jeffreys, "Theory of Probability" (1961).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strength {
    /// 2 ln K = 0: the best kinetics itself.
    None,
    /// 2 ln K below 2 (K below 3).
    BareMention,
    /// 2 ln K from 2 to 6 (K from 3 to 20).
    Positive,
    /// 2 ln K from 6 to 10 (K from 20 to 150).
    Strong,
    /// 2 ln K above 10 (K above 150).
    VeryStrong,
}

impl Strength {
    /// Of a positive log Bayes factor.
    pub fn of(log_bayes_factor: f64) -> Self {
        match 2.0 * log_bayes_factor {
            x if x <= 0.0 => Self::None,
            x if x < 2.0 => Self::BareMention,
            x if x < 6.0 => Self::Positive,
            x if x <= 10.0 => Self::Strong,
            _ => Self::VeryStrong,
        }
    }
}

impl fmt::Display for Strength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::None => "best",
            Self::BareMention => "not worth more than a bare mention",
            Self::Positive => "positive",
            Self::Strong => "strong",
            Self::VeryStrong => "very strong",
        })
    }
}

/// A Bayes factor of a logarithm, rounded.
pub(super) fn bayes_factor(log: f64) -> String {
    if log > 11.5 {
        format!("10^{:.0}", log / std::f64::consts::LN_10)
    } else {
        significant(log.exp(), 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_that_of_kass_and_raftery() {
        let of = |factor: f64| Strength::of(factor.ln());
        assert_eq!(of(1.0), Strength::None);
        assert_eq!(of(2.5), Strength::BareMention);
        assert_eq!(of(3.5), Strength::Positive);
        assert_eq!(of(19.0), Strength::Positive);
        assert_eq!(of(25.0), Strength::Strong);
        assert_eq!(of(140.0), Strength::Strong);
        assert_eq!(of(160.0), Strength::VeryStrong);
    }

    #[test]
    fn large_bayes_factors_are_powers_of_ten() {
        assert_eq!(bayes_factor(12.0f64.ln()), "12");
        assert_eq!(bayes_factor(1e30f64.ln()), "10^30");
    }
}
