//! Reasons to be careful with experiments that are calibrated together.

use std::fmt;

use serde::Serialize;
use smc_calib::PredictiveCheck;

use super::section;
use crate::number::{significant, with_error};
use crate::record::ObservableRecord;

/// A reason to be careful with a joint calibration that its sampler does not see.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum OfJoint {
    /// Measurements farther from the curves of the posterior than its noise puts them.
    NotReplicated { observable: String, rmse: f64, as_far: f64, counted: f64 },
}

impl OfJoint {
    /// Probability of replicated data as far off below which measurements contradict the model.
    pub(crate) const CONTRADICTED: f64 = 0.01;
}

/// A standard error of a probability that is worth no word.
const UNSAID: f64 = 0.05;

/// Number of independent replicated data sets that a probability was counted over: those of one sample of the posterior share its curve.
pub(crate) fn counted(check: &PredictiveCheck, ess: f64) -> f64 {
    ess.min(check.replicated as f64).max(1.0)
}

/// The probability of replicated data as far off, counted over `n` of them, in words: with its standard error where that is above 0.05
/// or a third of it; where it is all or none of them, with the bound 3/n of 95 % probability.
pub(crate) fn as_far_in_words(as_far: f64, n: f64) -> String {
    let size = 10f64.powf((3.0 / n).log10().floor());
    let bound = ((3.0 / n / size).ceil() * size).min(1.0);
    let se = (as_far * (1.0 - as_far) / n).sqrt();
    if as_far <= 0.0 {
        format!("p < {}", significant(bound, 1))
    } else if as_far >= 1.0 {
        let decimals = (-size.log10()).round().max(1.0) as usize;
        format!("p > {:.decimals$}", 1.0 - bound)
    } else if se > UNSAID || se > as_far / 3.0 {
        format!("p = {} ± {}", with_error(as_far, se, 2), with_error(se, se, 2))
    } else {
        format!("p = {}", significant(as_far, 2))
    }
}

/// What to say of an observable all of whose replicated data are farther off than the measurements, with a noise that was stated.
pub(crate) fn noise_too_large(found: &ObservableRecord) -> Option<&'static str> {
    let is_stated = found.sigma.is_none_or(|sigma| sigma.fixed);
    let is_far = found.check.is_some_and(|check| 1.0 - check.as_far < OfJoint::CONTRADICTED);
    (is_stated && is_far).then_some("the stated noise is larger than the scatter")
}

impl fmt::Display for OfJoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::NotReplicated { observable, rmse, as_far, counted } = self;
        write!(
            f,
            "{observable}: its measurements contradict what is calibrated together, or the noise: data made with its errors are as far from their curves with {} only (RMSE {}); calibrate it alone and see whether it is met then{}",
            as_far_in_words(*as_far, *counted),
            significant(*rmse, 2),
            section(self)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probability_is_said_as_far_as_it_is_known() {
        let checked = |replicated| PredictiveCheck { as_far: 0.5, as_alike: 0.5, replicated };
        let few = counted(&checked(4000), 30.0);
        let many = counted(&checked(4000), 1e5);
        assert_eq!([few, many], [30.0, 4000.0]);
        for (as_far, few_words, many_words) in [
            (0.0, "p < 0.1", "p < 8e-4"),
            (0.0005, "p = 0.0005 ± 0.0041", "p = 0.00050 ± 0.00035"),
            (0.003, "p = 0.0030 ± 0.0100", "p = 0.0030"),
            (0.43, "p = 0.430 ± 0.090", "p = 0.43"),
            (1.0, "p > 0.9", "p > 0.9992"),
        ] {
            let words = [few, many].map(|n| as_far_in_words(as_far, n));
            assert_eq!(words, [few_words, many_words], "{as_far}");
        }
    }
}
