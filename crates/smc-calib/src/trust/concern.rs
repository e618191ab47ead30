//! Reasons to be careful with a result.

use super::limits::{KHAT_LIMIT, UNINFORMED_BITS, khat_in_words};
use crate::posterior::FailingPlace;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The remedy of what more simulations mend.
const MORE: &str = "run more simulations";

/// A reason to be careful with a result.
///
/// [`Concern::what`] says what is wrong and by how much, [`Concern::meaning`] what that means for the result,
/// [`Concern::remedy`] what to do; `Display` says all three.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Concern {
    /// Weights were tuned, not derived: not a posterior.
    NotAPosterior,
    /// Too few effective samples.
    FewEffectiveSamples {
        /// Effective sample size.
        ess: f64,
        /// Effective samples wished for.
        wished: f64,
        /// Independent draws by which means, medians and evidence are known, where they are enough.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        by_errors: Option<f64>,
        /// Whether draws are of a process, not of the samples.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        drawn: bool,
    },
    /// The mean of a parameter is known, its standard deviation or its 95 % interval much less well.
    IntervalNotKnown {
        /// Parameter.
        parameter: String,
        /// Standard error of its standard deviation, over that.
        sd: f64,
        /// Standard error of the lower end, over the standard deviation.
        lower: f64,
        /// That of the upper end.
        upper: f64,
    },
    /// Heavy-tailed importance weights.
    HighKhat {
        /// Parameter, or none for the weights themselves.
        parameter: Option<String>,
        /// Pareto shape.
        khat: f64,
        /// Share of the weights or the moments in the tail.
        #[serde(default)]
        tail_share: f64,
    },
    /// Evidence from all samples and from the final proposal alone differ by more than three standard errors.
    EvidenceDisagrees {
        /// From all samples.
        pooled: f64,
        /// From the final proposal alone.
        frozen: f64,
        /// Standard error of the difference.
        se: f64,
    },
    /// Means, standard deviations and correlations are of samples that were moved to moments known better than by their weights.
    SamplesMoved {
        /// Largest difference of a mean of the samples where they are, in posterior standard deviations.
        mean: f64,
        /// Largest relative difference of a standard deviation.
        sd: f64,
        /// Largest difference of a correlation.
        correlation: f64,
    },
    /// Budget too small for the result wished for.
    BudgetTooSmall {
        /// Simulations done.
        simulations: usize,
        /// Signs of it.
        reason: String,
    },
    /// The data hardly moved this parameter.
    NotInformed {
        /// Parameter.
        parameter: String,
        /// Information gained, in bits.
        bits: f64,
    },
    /// The posterior has two groups of samples with hardly anything between them.
    TwoModes {
        /// Parameter that tells them apart best.
        parameter: String,
        /// Median of that parameter in each group, in SI.
        centres: [f64; 2],
        /// Share of the posterior in each group.
        shares: [f64; 2],
    },
    /// Fewer observations than parameters.
    FewObservations {
        /// Observations.
        observations: usize,
        /// Parameters.
        parameters: usize,
    },
    /// Neighbouring residuals are alike, or alternate.
    ResidualsNotIndependent {
        /// Lag-1 autocorrelation.
        lag1: f64,
        /// z-score of the number of runs.
        runs_z: f64,
        /// Whether the noise model has correlated errors; the residuals are then those that it leaves.
        #[serde(default)]
        modelled: bool,
        /// Group of observations, where there are several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<String>,
    },
    /// Posterior mass at the edge of the prior.
    AtPriorBound {
        /// Parameter.
        parameter: String,
        /// The bound, in SI.
        bound: f64,
        /// Posterior probability of the outermost hundredth of the prior on that side.
        share: f64,
    },
    /// The posterior lies far out in the tail of an unbounded prior.
    FarInPriorTail {
        /// Parameter.
        parameter: String,
        /// Equal-tailed 95 % interval of the posterior, in SI.
        eti95: [f64; 2],
        /// Posterior mean of its normal score: prior standard deviations from the middle of the prior.
        score: f64,
    },
    /// Two parameters cannot be told apart.
    NotSeparable {
        /// First parameter.
        first: String,
        /// Second parameter.
        second: String,
        /// Correlation.
        correlation: f64,
    },
    /// Many simulations failed.
    ManyFailures {
        /// Failed.
        failed: usize,
        /// Done.
        simulations: usize,
        /// The commonest cause.
        commonest: String,
    },
    /// Simulations fail where the posterior is, and where they fail depends on the parameters.
    FailuresInPosterior {
        /// Failed.
        failed: usize,
        /// Done.
        simulations: usize,
        /// Estimated share of the posterior where they fail.
        mass: f64,
        /// Chance that failures lie so much together where failing does not depend on the parameters.
        p_value: f64,
        /// Where they fail.
        place: Option<FailingPlace>,
    },
    /// Many simulations failed, wherever they were.
    FailuresAtRandom {
        /// Failed.
        failed: usize,
        /// Done.
        simulations: usize,
        /// Log of the share that did not fail.
        ln_share: f64,
    },
    /// The best curve misses the data by much more than the noise that was expected.
    PoorFit {
        /// Root mean square residual of the MAP curve, in expected noise standard deviations.
        ratio: f64,
        /// Group of observations, where there are several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<String>,
    },
    /// A parameter is known to its order of magnitude at best.
    OrderOfMagnitude {
        /// Parameter.
        parameter: String,
        /// Ratio of the ends of its 95 % interval.
        factor: f64,
    },
    /// The path keeps only some of the observations.
    PathThinned {
        /// Kept.
        kept: usize,
        /// All.
        observations: usize,
    },
}

impl Concern {
    /// Whether it is that neighbouring residuals are alike where the noise model has them independent: intervals are then
    /// too narrow.
    pub fn is_alike(&self) -> bool {
        matches!(self, Self::ResidualsNotIndependent { lag1, modelled: false, .. } if *lag1 > 0.0)
    }

    /// Whether more simulations are the remedy.
    pub fn wants_simulations(&self) -> bool {
        self.remedy() == MORE
    }

    /// The problem and its size.
    pub fn what(&self) -> String {
        match self {
            Self::NotAPosterior => "the noise was tuned to a wished-for effective sample size and proposals were not corrected for".to_owned(),
            Self::FewEffectiveSamples { ess, .. } => format!("only {ess:.0} effective samples"),
            Self::IntervalNotKnown { parameter, sd, lower, upper } => {
                interval_not_known(parameter, 100.0 * sd, [lower, upper])
            }
            Self::HighKhat { parameter, khat, tail_share } => format!(
                "the importance weights{} have a heavy tail (k-hat {}, trustworthy below {KHAT_LIMIT}, and {:.0} % of an estimate)",
                parameter.as_ref().map_or(String::new(), |p| format!(" for {p}")),
                khat_in_words(*khat),
                100.0 * tail_share
            ),
            Self::EvidenceDisagrees { pooled, frozen, se } => format!(
                "two estimates of the log evidence differ ({pooled:.3} from all samples, {frozen:.3} from the final ones, standard error {se:.3})"
            ),
            Self::SamplesMoved { mean, sd, correlation } => format!(
                "means, sds and correlations are of samples moved to moments that are known better than by their weights (where they were simulated, means differ by up to {mean:.2} posterior sds, sds by {:.0} %, correlations by {correlation:.2})",
                100.0 * sd
            ),
            Self::BudgetTooSmall { simulations, .. } => format!("{simulations} simulations were too few"),
            Self::NotInformed { parameter, bits } => format!(
                "the data say {}about {parameter} ({bits:.2} bits)",
                if *bits < UNINFORMED_BITS { "almost nothing " } else { "little " }
            ),
            Self::TwoModes { parameter, centres: [a, b], shares: [p, q] } => format!(
                "two modes: {:.0} % near {parameter} = {a:.3e}, {:.0} % near {parameter} = {b:.3e}",
                100.0 * p,
                100.0 * q
            ),
            Self::FewObservations { observations, parameters } => {
                let s = if *observations == 1 { "" } else { "s" };
                format!("{observations} observation{s} for {parameters} parameters")
            }
            Self::ResidualsNotIndependent { lag1, runs_z, group, modelled } => format!(
                "neighbouring residuals{}{} {} (lag-1 correlation {lag1:.2}, runs test z {runs_z:.1})",
                if *modelled { " that correlated errors leave" } else { "" },
                of_group(group),
                if *lag1 < 0.0 { "alternate" } else { "are alike" }
            ),
            Self::AtPriorBound { parameter, bound, share } => format!(
                "{:.0} % of the posterior of {parameter} lies against its prior bound {bound:.3e}",
                100.0 * share
            ),
            Self::FarInPriorTail { parameter, eti95, score } => {
                far_in_tail(parameter, *eti95, *score)
            }
            Self::NotSeparable { first, second, correlation } => {
                format!("{first} and {second} cannot be told apart (correlation {correlation:.4})")
            }
            Self::ManyFailures { failed, simulations, commonest } => {
                format!("{failed} of {simulations} simulations failed (most often: {commonest})")
            }
            Self::FailuresInPosterior { failed, simulations, mass, p_value, place } => {
                let at = place.as_ref().map_or_else(String::new, |place| {
                    let FailingPlace { parameter, lower, upper, .. } = place;
                    format!(", 90 % of them at {parameter} = {lower:.3e} .. {upper:.3e}")
                });
                format!(
                    "{failed} of {simulations} simulations failed{at}: it depends on the parameters (p = {p_value:.3}), and about {:.0} % of the posterior is where they fail",
                    100.0 * mass
                )
            }
            Self::FailuresAtRandom { failed, simulations, ln_share } => format!(
                "{failed} of {simulations} simulations failed, and where does not depend on the parameters as far as can be told (the log evidence counts them as likelihood zero; without them it is {:.3} higher)",
                -ln_share
            ),
            Self::PoorFit { ratio, group } => format!(
                "the best curve misses the data{} by {ratio:.1} times the expected noise",
                of_group(group)
            ),
            Self::OrderOfMagnitude { parameter, factor } => {
                format!("the 95 % interval of {parameter} spans a factor of {factor:.0}")
            }
            Self::PathThinned { kept, observations } => {
                format!("the path keeps {kept} of {observations} observations")
            }
        }
    }

    /// Consequence for the result.
    pub fn meaning(&self) -> &str {
        match self {
            Self::NotAPosterior => "this is not a posterior, and its intervals mean nothing",
            Self::FewEffectiveSamples { by_errors: Some(_), drawn: true, .. } => {
                "what is computed from the weighted samples is rough; means, which a Gaussian process knows better, and draws, which are its, are less so"
            }
            Self::FewEffectiveSamples { by_errors: Some(_), .. } => {
                "draws, and what is computed from them, are rough; means of the parameters, which a Gaussian process knows better, are less so"
            }
            Self::FewEffectiveSamples { .. } => "means and intervals are rough",
            Self::IntervalNotKnown { .. } => "a tail of the posterior may be longer or shorter",
            Self::HighKhat { .. } => "the posterior may be incomplete",
            Self::EvidenceDisagrees { .. } => "part of the posterior may be unseen",
            Self::SamplesMoved { .. } => {
                "modes, the path and leave-one-out are of samples where they were simulated"
            }
            Self::BudgetTooSmall { reason, .. } => reason,
            Self::NotInformed { bits, .. } if *bits < UNINFORMED_BITS => {
                "its posterior is its prior"
            }
            Self::NotInformed { .. } => "its posterior is near its prior",
            Self::TwoModes { .. } => {
                "means and medians lie between them, and intervals span the gap"
            }
            Self::FewObservations { .. } => "the priors decide what the data cannot",
            Self::ResidualsNotIndependent { lag1, .. } if *lag1 < 0.0 => {
                "the noise is not independent, and the intervals are too wide or the model is wrong"
            }
            Self::ResidualsNotIndependent { modelled: true, .. } => {
                "the model misses the shape, or the errors are alike in another way than this noise has it"
            }
            Self::ResidualsNotIndependent { .. } => {
                "the noise is not independent or the model misses the shape, and the intervals are too narrow"
            }
            Self::AtPriorBound { .. } => "the prior, not the data, ends the interval there",
            Self::FarInPriorTail { .. } => "the prior pulls the result towards itself",
            Self::NotSeparable { .. } => "only a combination of them is known",
            Self::ManyFailures { .. } => {
                "the posterior is that of the parameters that can be simulated"
            }
            Self::FailuresInPosterior { .. } => {
                "the posterior is cut off there, and its intervals and evidence are wrong"
            }
            Self::FailuresAtRandom { .. } => "they cost samples, and move nothing but the evidence",
            Self::PoorFit { .. } => "the model or the data are in doubt, not only the parameters",
            Self::OrderOfMagnitude { .. } => "it is known to its order of magnitude at best",
            Self::PathThinned { .. } => "the posterior uses all of them",
        }
    }

    /// Remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::NotAPosterior => "calibrate with inferred or fixed noise",
            Self::FewEffectiveSamples { .. }
            | Self::IntervalNotKnown { .. }
            | Self::HighKhat { .. }
            | Self::EvidenceDisagrees { .. }
            | Self::SamplesMoved { .. }
            | Self::BudgetTooSmall { .. } => MORE,
            Self::NotInformed { .. } | Self::OrderOfMagnitude { .. } => {
                "measure where it matters, or give a prior that holds what is known of it"
            }
            Self::TwoModes { .. } => {
                "look at the corner figure, and exclude one by a prior where it cannot be"
            }
            Self::FewObservations { .. } => "measure more, or fix what is known",
            Self::ResidualsNotIndependent { lag1, modelled: false, .. } if *lag1 > 0.0 => {
                "mend the model where the residuals follow a pattern, else take correlated noise"
            }
            Self::ResidualsNotIndependent { .. } => {
                "look at the residuals, and mend the model where they follow a pattern"
            }
            Self::AtPriorBound { .. } => "widen the prior if it is not a hard limit",
            Self::FarInPriorTail { .. } => {
                "correct or widen the prior, unless it is certain; then look for a mistake in the data and their units"
            }
            Self::NotSeparable { .. } => "measure what tells them apart, or fix one",
            Self::ManyFailures { .. } => {
                "mend the commonest cause, or narrow the priors to where the simulator works"
            }
            Self::FailuresInPosterior { .. } => {
                "make the simulator work there, or give priors that exclude it for a reason of their own"
            }
            Self::FailuresAtRandom { .. } => "mend the commonest cause and make them once more",
            Self::PoorFit { .. } => "look at the fit, and at what the model leaves out",
            Self::PathThinned { .. } => "there is nothing to do",
        }
    }
}

impl fmt::Display for Concern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.what(), self.meaning(), self.remedy())
    }
}

/// " of NAME" of one of several groups.
fn of_group(group: &Option<String>) -> String {
    group.as_ref().map_or_else(String::new, |name| format!(" of {name}"))
}

/// How far an interval and the sd, in per cent, are known.
fn interval_not_known(parameter: &str, sd: f64, [lower, upper]: [&f64; 2]) -> String {
    format!(
        "the 95 % interval of {parameter} is known to {lower:.2} (lower end) and {upper:.2} (upper end) posterior sds, its sd to {sd:.0} %"
    )
}

/// How far a posterior lies out in the tail of its prior.
fn far_in_tail(parameter: &str, [lower, upper]: [f64; 2], score: f64) -> String {
    format!(
        "the prior of {parameter} all but excludes what the data ask for: the posterior ({lower:.3e} .. {upper:.3e}) lies {:.1} of its standard deviations {} its middle",
        score.abs(),
        if score < 0.0 { "below" } else { "above" }
    )
}
