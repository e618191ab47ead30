//! What a user should know before trusting a result.

use crate::joint::JointProblem;
use crate::target::CurveTarget;
use crate::{Noise, Posterior, PriorSpec, Residuals};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A reason to be careful with a result; its `Display` says it in plain words.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Warning {
    /// Weights were tuned, not derived: not a posterior.
    NotAPosterior,
    /// Too few effective samples.
    FewEffectiveSamples {
        /// Effective sample size.
        ess: f64,
    },
    /// Heavy-tailed importance weights.
    HighKhat {
        /// Parameter, or none for the weights themselves.
        parameter: Option<String>,
        /// Pareto shape.
        khat: f64,
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
    /// The data hardly moved this parameter.
    NotInformed {
        /// Parameter.
        parameter: String,
        /// Information gained, in bits.
        bits: f64,
    },
    /// Fewer observations than parameters.
    FewObservations {
        /// Observations.
        observations: usize,
        /// Parameters.
        parameters: usize,
    },
    /// Neighbouring residuals are alike.
    ResidualsNotIndependent {
        /// Lag-1 autocorrelation.
        lag1: f64,
        /// z-score of the number of runs.
        runs_z: f64,
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
    /// Many simulations failed.
    ManyFailures {
        /// Failed.
        failed: usize,
        /// Done.
        simulations: usize,
        /// The commonest cause.
        commonest: String,
    },
    /// The best curve misses the data by much more than the noise that was expected.
    PoorFit {
        /// Root mean square residual of the MAP curve, in expected noise standard deviations.
        ratio: f64,
        /// Group of observations, where there are several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<String>,
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
    /// Budget too small for the result wished for.
    BudgetTooSmall {
        /// Simulations done.
        simulations: usize,
        /// Why.
        reason: String,
    },
    /// The path keeps only some of the observations.
    PathThinned {
        /// Kept.
        kept: usize,
        /// All.
        observations: usize,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAPosterior => write!(
                f,
                "the noise was tuned to a wished-for effective sample size and proposals were not corrected for: this is not a posterior, and its intervals mean nothing"
            ),
            Self::FewEffectiveSamples { ess } => write!(
                f,
                "only {ess:.0} effective samples: means and intervals are rough; run more simulations"
            ),
            Self::HighKhat { parameter, khat } => write!(
                f,
                "the importance weights{} have a heavy tail (k-hat {khat:.2}, trustworthy below 0.7): the posterior may be incomplete; run more simulations",
                parameter.as_ref().map_or(String::new(), |p| format!(" for {p}"))
            ),
            Self::EvidenceDisagrees { pooled, frozen, se } => write!(
                f,
                "two estimates of the log evidence differ ({pooled:.3} from all samples, {frozen:.3} from the final ones, standard error {se:.3}): part of the posterior may be unseen; run more simulations"
            ),
            Self::NotInformed { parameter, bits } => write!(
                f,
                "the data say almost nothing about {parameter} ({bits:.2} bits): its posterior is its prior"
            ),
            Self::FewObservations { observations, parameters } => write!(
                f,
                "{observations} observations for {parameters} parameters: the priors decide what the data cannot"
            ),
            Self::ResidualsNotIndependent { lag1, runs_z, group } if *lag1 < 0.0 => write!(
                f,
                "neighbouring residuals{} alternate (lag-1 correlation {lag1:.2}, runs test z {runs_z:.1}): the noise is not independent, and the intervals are too wide or the model is wrong",
                of_group(group)
            ),
            Self::ResidualsNotIndependent { lag1, runs_z, group } => write!(
                f,
                "neighbouring residuals{} are alike (lag-1 correlation {lag1:.2}, runs test z {runs_z:.1}): the noise is not independent or the model misses the shape, and the intervals are too narrow",
                of_group(group)
            ),
            Self::AtPriorBound { parameter, bound, share } => write!(
                f,
                "{:.0} % of the posterior of {parameter} lies against its prior bound {bound:.3e}: widen the prior if it is not a hard limit",
                100.0 * share
            ),
            Self::ManyFailures { failed, simulations, commonest } => write!(
                f,
                "{failed} of {simulations} simulations failed (most often: {commonest}): the posterior is that of the parameters that can be simulated"
            ),
            Self::PoorFit { ratio, group } => write!(
                f,
                "the best curve misses the data{} by {ratio:.1} times the expected noise: the model or the data are in doubt, not only the parameters",
                of_group(group)
            ),
            Self::NotSeparable { first, second, correlation } => write!(
                f,
                "{first} and {second} cannot be told apart (correlation {correlation:.4}): only a combination of them is known"
            ),
            Self::BudgetTooSmall { simulations, reason } => {
                write!(f, "{simulations} simulations were too few: {reason}")
            }
            Self::PathThinned { kept, observations } => write!(
                f,
                "the path keeps {kept} of {observations} observations; the posterior uses all"
            ),
        }
    }
}

/// Whether a small budget was not enough, and by what that shows.
fn small_budget(posterior: &Posterior) -> Option<Warning> {
    let mut reasons = Vec::new();
    if posterior.ess.importance < 10.0 {
        reasons.push("fewer than ten effective samples");
    }
    if posterior.khat > 0.7 {
        reasons.push("the importance weights have a heavy tail");
    }
    if !posterior.log_evidence.agree {
        reasons.push("the evidence of the last samples is not that of all");
    }
    if posterior.stages.last().is_some_and(|s| s.beta < 1.0) {
        reasons.push("the likelihood was not yet known well enough to place the last samples");
    }
    (!reasons.is_empty()).then(|| Warning::BudgetTooSmall {
        simulations: posterior.counters.simulations,
        reason: reasons.join("; "),
    })
}

/// " of NAME" of one of several groups.
fn of_group(group: &Option<String>) -> String {
    group.as_ref().map_or_else(String::new, |name| format!(" of {name}"))
}

/// Everything that a finished run should warn about.
pub(crate) fn warnings(
    posterior: &Posterior,
    problem: &JointProblem<'_>,
    target: &CurveTarget<'_>,
    failed: usize,
) -> Vec<Warning> {
    let mut list = Vec::new();
    let simulations = posterior.counters.simulations;
    if !posterior.is_posterior {
        list.push(Warning::NotAPosterior);
    }
    let ess = posterior.ess.importance;
    // Who pays for each simulation settles for less, but not for anything.
    let small = posterior.settings.surrogate;
    if ess < if small { 40.0 } else { 400.0 } {
        list.push(Warning::FewEffectiveSamples { ess });
    }
    if posterior.is_posterior {
        let over: Vec<_> = posterior.parameters.iter().filter(|p| p.khat > 0.7).collect();
        if over.len() == posterior.parameters.len() {
            list.push(Warning::HighKhat { parameter: None, khat: posterior.khat });
        } else {
            list.extend(over.iter().map(|p| Warning::HighKhat {
                parameter: Some(p.parameter.name.clone()),
                khat: p.khat,
            }));
        }
        let e = &posterior.log_evidence;
        if !e.agree {
            list.push(Warning::EvidenceDisagrees {
                pooled: e.pooled_value,
                frozen: e.frozen_value,
                se: e.pooled_se.hypot(e.frozen_se),
            });
        }
        if small {
            list.extend(small_budget(posterior));
        } else if ess < 400.0
            && posterior.stages.len() > 1
            && posterior.stages[posterior.stages.len() - 1].beta < 1.0
        {
            list.push(Warning::BudgetTooSmall {
                simulations,
                reason: "the last proposal was still fitted to a flattened likelihood".to_owned(),
            });
        }
        for p in &posterior.parameters {
            if p.information_gain_bits < 0.1 {
                list.push(Warning::NotInformed {
                    parameter: p.parameter.name.clone(),
                    bits: p.information_gain_bits,
                });
            }
        }
    }
    let (m, d) = (problem.observations(), problem.parameters.len());
    if m < d {
        list.push(Warning::FewObservations { observations: m, parameters: d });
    }
    // Each group with its residuals; the one group without a name.
    let groups: Vec<(Option<String>, &Residuals)> = if posterior.groups.is_empty() {
        vec![(None, &posterior.residuals)]
    } else {
        posterior.groups.iter().map(|g| (Some(g.name.clone()), &g.residuals)).collect()
    };
    for (group, residuals) in &groups {
        if residuals.values.len() >= 8 && !residuals.independent {
            list.push(Warning::ResidualsNotIndependent {
                lag1: residuals.lag1,
                runs_z: residuals.runs_z,
                group: group.clone(),
            });
        }
    }
    for (j, p) in problem.parameters.iter().enumerate() {
        let (lower, upper) = p.prior.support();
        let bounded = matches!(
            p.prior.spec(),
            PriorSpec::Uniform { .. }
                | PriorSpec::LogUniform { .. }
                | PriorSpec::TruncatedNormal { .. }
        );
        for (bound, sign) in [(lower, -1.0), (upper, 1.0)] {
            // The outermost hundredth of the prior lies beyond 2.326.
            let share: f64 = posterior
                .samples
                .iter()
                .filter(|s| sign * s.z[j] > 2.326_347_874)
                .map(|s| s.weight)
                .sum();
            if bounded && share > 0.1 {
                list.push(Warning::AtPriorBound { parameter: p.name.clone(), bound, share });
            }
        }
    }
    for i in 0..d {
        for j in 0..i {
            let correlation = posterior.correlation[i][j];
            if correlation.abs() > 0.995 {
                list.push(Warning::NotSeparable {
                    first: problem.parameters[j].name.clone(),
                    second: problem.parameters[i].name.clone(),
                    correlation,
                });
            }
        }
    }
    if failed * 10 > simulations {
        list.push(Warning::ManyFailures {
            failed,
            simulations,
            commonest: posterior.failures.first().map_or_else(String::new, |f| f.cause.clone()),
        });
    }
    let parts = problem.groups.iter().zip(target.likelihood.groups());
    for ((group, residuals), (of, (part, _))) in groups.into_iter().zip(parts) {
        let values = &residuals.values;
        let squares: f64 = match of.noise {
            Noise::Inferred { s0, .. } => values.iter().map(|r| (r / s0).powi(2)).sum(),
            Noise::Fixed { .. } => values
                .iter()
                .enumerate()
                .map(|(i, r)| (r / part.fixed_sigma(i).unwrap_or(f64::INFINITY)).powi(2))
                .sum(),
            Noise::EssTarget { .. } => 0.0,
        };
        let ratio = (squares / values.len() as f64).sqrt();
        if ratio > 2.0 {
            list.push(Warning::PoorFit { ratio, group });
        }
    }
    if target.thinned {
        list.push(Warning::PathThinned { kept: target.indices.len(), observations: m });
    }
    list
}
