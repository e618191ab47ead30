//! What the numbers of a comparison mean, in words.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::report::{Comparison, Entry};
use crate::number::significant;

/// Evidence against a model whose Bayes factor to the best one is 1 to K: the scale of R.E. Kass and A.E. Raftery,
/// "Bayes factors", J. Am. Stat. Assoc. 90 (1995) 773, after H. Jeffreys, "Theory of Probability" (1961).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strength {
    /// 2 ln K = 0: the best one itself.
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
    #[must_use]
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

/// What the data support, and how strongly.
pub(super) fn in_words(comparison: &Comparison) -> Vec<String> {
    let Some(best) = comparison.best() else { return Vec::new() };
    let rivals: Vec<&Entry> =
        comparison.entries.iter().filter(|entry| entry.kinetics != best.kinetics).collect();
    let Some(second) = rivals.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
    else {
        return Vec::new();
    };
    let mut words = Vec::new();
    let close: Vec<&str> = rivals
        .iter()
        .filter(|entry| entry.strength <= Strength::BareMention)
        .map(|entry| entry.kinetics.as_str())
        .collect();
    words.push(if close.is_empty() {
        format!(
            "The data support {}: {} evidence against the next best, {} (Bayes factor {}).",
            best.kinetics,
            second.strength,
            second.kinetics,
            bayes_factor(-second.log_bayes_factor),
        )
    } else {
        format!(
            "The data do not decide between {} and {} (Bayes factors below 3).",
            best.kinetics,
            close.join(", "),
        )
    });
    let excluded: Vec<&str> = rivals
        .iter()
        .filter(|entry| entry.strength == Strength::VeryStrong)
        .map(|entry| entry.kinetics.as_str())
        .collect();
    if !excluded.is_empty() {
        words.push(format!("Very strong evidence against {}.", excluded.join(", ")));
    }
    if let Some(predictor) = comparison
        .entries
        .iter()
        .max_by(|a, b| a.leave_one_out.ln_density.total_cmp(&b.leave_one_out.ln_density))
    {
        words.push(if predictor.kinetics == best.kinetics {
            format!("{} also predicts left-out observations best.", best.kinetics)
        } else {
            let clear = -best.leave_one_out_difference > 2.0 * best.leave_one_out_difference_spread;
            format!(
                "{} predicts left-out observations better than {}, by {} ± {}: {}.",
                predictor.kinetics,
                best.kinetics,
                significant(-best.leave_one_out_difference, 2),
                significant(best.leave_one_out_difference_spread, 2),
                if clear {
                    "the two criteria disagree, and neither should be quoted alone"
                } else {
                    "within what other data could reverse"
                },
            )
        });
    }
    words
}

/// A Bayes factor as a person reads it.
pub(super) fn bayes_factor(log: f64) -> String {
    if log > 11.5 {
        format!("10^{:.0}", log / std::f64::consts::LN_10)
    } else {
        significant(log.exp(), 2)
    }
}

/// Where the prior or the method decides.
pub(super) fn warnings(comparison: &Comparison) -> Vec<String> {
    let mut warnings = Vec::new();
    let Some(best) = comparison.best() else { return warnings };
    for entry in &comparison.entries {
        if !entry.trusted {
            warnings.push(format!(
                "{}: its posterior is not to be trusted (effective sample size {:.0}, k-hat {:.2}); run more simulations with \
                 --samples",
                entry.kinetics, entry.ess, entry.khat,
            ));
        }
        if entry.kinetics == best.kinetics {
            continue;
        }
        let difference = -entry.log_bayes_factor;
        let error = entry.log_evidence_se.hypot(best.log_evidence_se);
        if difference < 3.0 * error {
            warnings.push(format!(
                "{} against {}: the evidences differ by {}, no more than their Monte Carlo error {} allows to tell",
                best.kinetics,
                entry.kinetics,
                significant(difference, 2),
                significant(error, 2),
            ));
        }
        // Lindley: a prior ten times wider in an informed parameter that one of the two has and the other
        // has not costs it ln 10, whatever the data say.
        let extra = entry.informed_parameters.abs_diff(best.informed_parameters);
        let reach = std::f64::consts::LN_10 * extra as f64;
        if extra > 0 && difference < reach {
            warnings.push(format!(
                "{} against {}: the prior decides: they differ in {extra} informed parameter{}, and a prior one decade wider or \
                 narrower in each moves ln K by {}, more than the {} between them (Lindley's paradox)",
                best.kinetics,
                entry.kinetics,
                if extra == 1 { "" } else { "s" },
                significant(reach, 2),
                significant(difference, 2),
            ));
        }
    }
    if !best.residuals_independent && best.residual_lag1 > 0.0 {
        let share = (1.0 - best.residual_lag1) / (1.0 + best.residual_lag1);
        warnings.push(format!(
            "the likelihood takes the {} observations for independent, but neighbouring residuals are alike even under {} \
             (lag-1 correlation {:.2}): they are worth about {:.0}, and the logarithms of the Bayes factors, roughly, {:.0} % of \
             what stands here",
            comparison.observations,
            best.kinetics,
            best.residual_lag1,
            share * comparison.observations as f64,
            100.0 * share,
        ));
    }
    if !comparison.with_phi()
        && comparison
            .final_contact_ratio_reason
            .as_deref()
            .is_some_and(|why| why.contains("measured"))
    {
        warnings.push(format!(
            "the final contact ratio {} was read off the data that it helps to fit, for every kinetics alike; --phi \
             calibrates it instead",
            significant(comparison.final_contact_ratio, 3),
        ));
    }
    warnings
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
