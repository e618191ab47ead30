//! Whether a result can be trusted: the one judgement that tables, files and users ask for.
//!
//! A result has *converged* where nothing speaks against its weights and it has the effective samples wished for; it is
//! *rough* where only those are missing, or where a Gaussian process knows means and evidence that few weights, or weights with a heavy
//! tail, do not; else it is *untrusted*. What else a user should know of it (parameters that the data do not inform, a poor fit, ..)
//! are its [`Concern`]s. All limits are in [`limits`].

mod by_errors;
mod concern;
pub mod limits;
mod modes;
mod tails;
#[cfg(test)]
mod tests;

pub use concern::Concern;
pub(crate) use tails::Tail;
pub use tails::khat_holds;

use self::limits::*;
use self::modes::two_modes;
use crate::estimate::MovedBy;
use crate::posterior::{Evidence, Failing, ParameterSummary, Posterior, Residuals};
use crate::prior::PriorSpec;
use crate::{Noise, StageRecord};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Whether a result is what it says, to the accuracy that users expect.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Nothing speaks against it, and it has the effective samples wished for.
    Converged,
    /// Nothing speaks against it but few effective samples; or so few, or with so heavy a tail of the weights, that means and evidence are
    /// known by a Gaussian process alone.
    Rough,
    /// Means, intervals and evidence may be wrong.
    Untrusted,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "good",
            Self::Rough => "rough",
            Self::Untrusted => "NOT TO BE TRUSTED",
        })
    }
}

/// How far a result can be trusted, and why.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trust {
    /// The verdict.
    pub verdict: Verdict,
    /// Effective samples, by the importance weights.
    pub effective_samples: f64,
    /// Effective samples wished for: a third of the simulations, at least 40 and at most 400.
    pub effective_samples_wished: f64,
    /// Pareto shape of the importance weights, the largest over the weights and all parameters.
    pub khat: f64,
    /// Pareto shape from which on a tail is heavy.
    pub khat_limit: f64,
    /// Largest share of the weights or of a parameter's moments that a heavy tail has.
    #[serde(default)]
    pub tail_share: f64,
    /// Share from which on a heavy tail cannot be trusted.
    #[serde(default)]
    pub tail_share_limit: f64,
    /// Whether standard errors, of the log evidence and of all other estimates, can be believed.
    pub evidence_error_known: bool,
    /// A further mode whose surroundings take more than this share of the prior would have been met with a probability of
    /// 95 %: `1 - 0.05^(1/n)`, about 3/n, for n samples drawn from the prior; 1 without any.
    #[serde(default)]
    pub unseen: f64,
    /// Reasons to be careful.
    pub concerns: Vec<Concern>,
}

impl Trust {
    /// Whether the result has converged.
    pub fn converged(&self) -> bool {
        self.verdict == Verdict::Converged
    }

    /// Whether intervals can be taken as they are: converged, a fit that meets the data, and no errors that are more alike
    /// than the noise model has them, which makes intervals too narrow.
    pub fn trusted(&self) -> bool {
        let poor = self.concerns.iter().any(|c| matches!(c, Concern::PoorFit { .. }));
        self.converged() && !poor && !self.intervals_too_narrow()
    }

    /// Whether a heavy tail of the weights decides an estimate by them.
    pub fn has_heavy_tail(&self) -> bool {
        !khat_holds(self.khat) && self.tail_share >= self.tail_share_limit
    }

    /// Whether residuals are alike where the noise model has them independent.
    pub fn intervals_too_narrow(&self) -> bool {
        self.concerns.iter().any(Concern::is_alike)
    }

    /// One line with the verdict and its grounds. `evidence` belongs to the same result.
    pub fn line(&self, evidence: &Evidence) -> String {
        let wished = self.effective_samples_wished;
        let few = |concern: &Concern| match concern {
            Concern::FewEffectiveSamples { by_errors, .. } => *by_errors,
            _ => None,
        };
        let worth = match self.concerns.iter().find_map(few) {
            Some(draws) => format!(
                "means and evidence are known as by {} independent draws of the posterior, the weighted samples are worth {:.0}",
                by_errors::in_words(draws),
                self.effective_samples
            ),
            None => {
                format!("worth {:.0} independent draws of the posterior", self.effective_samples)
            }
        };
        let of = if self.effective_samples < wished {
            format!(" (ESS; at least {wished:.0} wished for)")
        } else {
            " (ESS)".to_owned()
        };
        let khat = khat_in_words(self.khat);
        let weights = if self.has_heavy_tail() {
            // It is rough then only where a process knows as much.
            let beside = match self.verdict {
                Verdict::Rough => ", and a Gaussian process through all says the same",
                Verdict::Converged | Verdict::Untrusted => "",
            };
            let limit = self.khat_limit;
            format!("a few simulations decide (k-hat {khat}; {limit} is the limit){beside}")
        } else if khat_holds(self.khat) {
            format!("no handful of simulations decides (k-hat {khat})")
        } else {
            format!("a few simulations stand out, but have hardly any weight (k-hat {khat})")
        };
        let explored = if self.unseen < 1.0 {
            let share = two_digits(100.0 * self.unseen);
            format!(
                "; a further mode around more than {share} % of the prior would have been met (95 %)"
            )
        } else {
            String::new()
        };
        format!("{}; {worth}{of}; {weights}; {}{explored}", self.verdict, self.evidence(evidence))
    }

    /// The log evidence in words, with its standard error only where that can be believed.
    pub fn evidence(&self, Evidence { value, se, .. }: &Evidence) -> String {
        if self.concerns.contains(&Concern::NotAPosterior) {
            "no evidence".to_owned()
        } else if self.evidence_error_known {
            format!("log evidence {} +- {}", to_its_error(*value, *se), two_digits(*se))
        } else {
            format!("log evidence {value:.1} or more, its error unknown")
        }
    }
}

/// A value with the decimals at which its error has two digits, three to nine.
fn to_its_error(value: f64, error: f64) -> String {
    let decimals = if error > 0.0 && error.is_finite() {
        (1.0 - error.log10().floor()).clamp(3.0, 9.0) as usize
    } else {
        3
    };
    format!("{value:.decimals$}")
}

/// Two significant digits, with a power of ten below 0.001 and from 10 000.
fn two_digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let scientific = format!("{value:.1e}");
    let exponent: i32 =
        scientific.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or_default();
    if (-3..4).contains(&exponent) {
        let decimals = (1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        scientific
    }
}

/// Whether two estimates of the log evidence agree; `se` is the standard error of their difference.
pub(crate) fn agree(a: f64, b: f64, se: f64) -> bool {
    (a - b).abs() <= EVIDENCE_ERRORS * se
}

/// Whether `m` residuals of this lag-1 correlation and this score of the runs test count as independent: neither test
/// objects, or the correlation is too small to matter.
pub(crate) fn independent(lag1: f64, runs_z: f64, m: f64) -> bool {
    let significant = (lag1 * m.sqrt()).abs().max(runs_z.abs()) >= RESIDUAL_SCORE;
    !(significant && lag1.abs() >= RESIDUAL_CORRELATION)
}

impl Posterior {
    /// Judges the result.
    pub fn trust(&self) -> Trust {
        let wished = (self.counters.simulations as f64 / SIMULATIONS_PER_SAMPLE)
            .clamp(FEWEST_EFFECTIVE_SAMPLES, EFFECTIVE_SAMPLES);
        let ess = self.ess.importance;
        let by_weights = self.known_by_weights();
        let by_process = self.known_by_errors(wished).is_some();
        let sound = self.is_posterior
            && self.log_evidence.agree
            && !self.failing.as_ref().is_some_and(Failing::matters)
            && (by_weights || by_process);
        Trust {
            verdict: match (sound, by_weights && ess >= wished) {
                (true, true) => Verdict::Converged,
                (true, false) => Verdict::Rough,
                (false, _) => Verdict::Untrusted,
            },
            effective_samples: ess,
            effective_samples_wished: wished,
            khat: self.khat,
            khat_limit: KHAT_LIMIT,
            tail_share: self.parameters.iter().map(|p| p.tail_share).fold(0.0, f64::max),
            tail_share_limit: TAIL_SHARE,
            evidence_error_known: sound,
            unseen: self.unseen(),
            concerns: self.concerns(wished),
        }
    }

    /// Whether the weights say enough by themselves.
    fn known_by_weights(&self) -> bool {
        self.tails_hold() && self.ess.importance >= FEWEST_EFFECTIVE_SAMPLES
    }

    /// Independent draws as of which a process knows means, medians and evidence, where they are enough and nothing says that the budget
    /// was too small.
    fn known_by_errors(&self, wished: f64) -> Option<f64> {
        let enough = by_errors::of_centre(self).filter(|draws| *draws >= FEWEST_BY_ERRORS)?;
        self.about_budget(wished).is_none().then_some(enough)
    }

    /// Share of the prior that no sample may have come from, see [`Trust::unseen`].
    fn unseen(&self) -> f64 {
        let from_prior =
            |stage: &StageRecord| stage.simulations as f64 * stage.proposal.prior_share;
        let draws: f64 = self.stages.iter().map(from_prior).sum();
        if draws >= 1.0 { 1.0 - MISSED.powf(1.0 / draws) } else { 1.0 }
    }

    fn concerns(&self, wished: f64) -> Vec<Concern> {
        let mut list = Vec::new();
        let ess = self.ess.importance;
        if !self.is_posterior {
            list.push(Concern::NotAPosterior);
        }
        let known = self.known_by_errors(wished);
        if ess < wished {
            let by_errors = known.filter(|draws| *draws >= ess);
            let drawn = self.is_drawn();
            list.push(Concern::FewEffectiveSamples { ess, wished, by_errors, drawn });
        }
        if known.is_some() && !self.known_by_weights() {
            list.extend(self.parameters.iter().filter_map(by_errors::about_interval));
        }
        if self.is_posterior {
            list.extend(self.about_weights());
            list.extend(self.about_budget(wished));
            list.extend(self.moved.and_then(about_moved));
            list.extend(self.parameters.iter().filter_map(about_information));
            list.extend(two_modes(self));
        }
        let (observations, parameters) = (self.residuals.values.len(), self.parameters.len());
        if observations < parameters {
            list.push(Concern::FewObservations { observations, parameters });
        }
        list.extend(self.residuals().filter_map(about_independence));
        list.extend((0..parameters).flat_map(|j| self.about_bounds(j)));
        list.extend((0..parameters).filter_map(|j| self.about_tail(j)));
        list.extend(self.about_correlations());
        list.extend(self.about_failures());
        list.extend(self.residuals().filter_map(about_fit));
        list.extend(self.parameters.iter().filter_map(about_magnitude));
        let kept = if self.path.is_empty() { self.predictive.len() } else { self.path.len() };
        if (1..observations).contains(&kept) {
            list.push(Concern::PathThinned { kept, observations });
        }
        list
    }

    /// Whether no heavy tail can change an estimate.
    fn tails_hold(&self) -> bool {
        // Each parameter's k-hat and share are at least those of the weights themselves.
        !self.khat.is_nan() && self.parameters.iter().all(|p| p.tail().holds())
    }

    /// Tails of the importance weights, and the two estimates of the evidence.
    fn about_weights(&self) -> Vec<Concern> {
        let heavy: Vec<_> = self.parameters.iter().filter(|p| !p.tail().holds()).collect();
        let mut list: Vec<Concern> = if heavy.len() == self.parameters.len() {
            let tail_share = heavy.iter().map(|p| p.tail_share).fold(0.0, f64::max);
            vec![Concern::HighKhat { parameter: None, khat: self.khat, tail_share }]
        } else {
            let of_one = |p: &&ParameterSummary| Concern::HighKhat {
                parameter: Some(p.parameter.name.clone()),
                khat: p.khat,
                tail_share: p.tail_share,
            };
            heavy.iter().map(of_one).collect()
        };
        let e = &self.log_evidence;
        if !e.agree {
            list.push(Concern::EvidenceDisagrees {
                pooled: e.pooled_value,
                frozen: e.frozen_value,
                se: e.pooled_se.hypot(e.frozen_se),
            });
        }
        list
    }

    /// Signs that the budget was too small; those whose few samples a Gaussian process places are asked more closely.
    fn about_budget(&self, wished: f64) -> Option<Concern> {
        let ess = self.ess.importance;
        let flattened = self.stages.last().is_some_and(|s| s.beta < 1.0);
        let mut signs = Vec::new();
        if self.settings.process_placed(self.counters.simulations) {
            // `value` itself may be mostly the process's.
            let e = &self.log_evidence;
            let cross_fitted = e.cross_fitted_value.unwrap_or(e.value);
            let [beside, mean] =
                [e.process_value, e.process_mean].map(|by| by.map(|by| by - cross_fitted));
            // What the process says as well does not rest on a few weights.
            let beyond_chance = |beside: f64| beside.abs() * ess.sqrt() > EVIDENCE_ERRORS;
            let agrees = beside.is_some_and(|b| b.abs() < PROCESS_AGREES && !beyond_chance(b))
                && mean.is_some_and(|mean| mean < PROCESS_HIDES);
            if ess < FEWEST_BESIDE_PROCESS {
                signs.push("fewer than two effective samples");
            } else if ess < FEWEST_OF_SMALL_BUDGET && !agrees {
                signs.push("fewer than seven effective samples");
            }
            if !self.tails_hold() && !agrees {
                signs.push("the importance weights have a heavy tail");
            }
            // What many weights say counts, not what a process says that has yet to learn.
            let few = ess * MOST_PER_SAMPLE < self.counters.simulations as f64;
            let differs =
                |beside: f64| beside.abs() > PROCESS_DIFFERS || few && beyond_chance(beside);
            if beside.is_some_and(differs) {
                signs.push("the process through the samples has another evidence");
            }
            if !self.log_evidence.agree {
                signs.push("the evidence of the last samples is not that of all");
            }
            // Given sets are all there at once: nothing is placed.
            if few && flattened && self.stages.len() > 1 {
                signs
                    .push("the likelihood was not yet known well enough to place the last samples");
            }
        } else if ess < wished && self.stages.len() > 1 && flattened {
            signs.push("the last proposal was still fitted to a flattened likelihood");
        }
        (!signs.is_empty()).then(|| Concern::BudgetTooSmall {
            simulations: self.counters.simulations,
            reason: signs.join("; "),
        })
    }

    /// Residuals and noise of each group with its name; of a single group without a name.
    fn residuals(&self) -> impl Iterator<Item = (Option<String>, &Noise, &Residuals)> {
        let one = self.groups.is_empty().then_some((None, &self.noise, &self.residuals));
        let several = self.groups.iter().map(|g| (Some(g.name.clone()), &g.noise, &g.residuals));
        one.into_iter().chain(several)
    }

    /// Posterior mass at the bounds of parameter `j`.
    fn about_bounds(&self, j: usize) -> Vec<Concern> {
        let parameter = &self.parameters[j].parameter;
        let (lower, upper) = parameter.prior.support();
        let bounded = matches!(
            parameter.prior.spec(),
            PriorSpec::Uniform { .. }
                | PriorSpec::LogUniform { .. }
                | PriorSpec::TruncatedNormal { .. }
        );
        let at = |(bound, sign): (f64, f64)| {
            let beyond = self.samples.iter().filter(|s| sign * s.z[j] > BOUND_SCORE);
            let share: f64 = beyond.map(|s| s.weight).sum();
            let parameter = parameter.name.clone();
            (bounded && share > BOUND_SHARE).then_some(Concern::AtPriorBound {
                parameter,
                bound,
                share,
            })
        };
        [(lower, -1.0), (upper, 1.0)].into_iter().filter_map(at).collect()
    }

    /// Posterior of parameter `j` far out in the tail of a prior without bounds.
    fn about_tail(&self, j: usize) -> Option<Concern> {
        let of = &self.parameters[j];
        let unbounded = matches!(
            of.parameter.prior.spec(),
            PriorSpec::Normal { .. } | PriorSpec::LogNormal { .. }
        );
        let (sum, total) = self.samples.iter().fold((0.0, 0.0), |(sum, total), sample| {
            (sum + sample.weight * sample.z[j], total + sample.weight)
        });
        let score = sum / total;
        (unbounded && score.abs() > TAIL_SCORE).then(|| Concern::FarInPriorTail {
            parameter: of.parameter.name.clone(),
            eti95: [of.in_si.eti95.lower, of.in_si.eti95.upper],
            score,
        })
    }

    fn about_correlations(&self) -> Vec<Concern> {
        let name = |j: usize| self.parameters[j].parameter.name.clone();
        let pairs = self.correlation.iter().enumerate().flat_map(|(i, row)| {
            row.iter().take(i).enumerate().map(move |(j, correlation)| (i, j, *correlation))
        });
        pairs
            .filter(|(.., correlation)| correlation.abs() > CORRELATION_LIMIT)
            .map(|(i, j, correlation)| Concern::NotSeparable {
                first: name(j),
                second: name(i),
                correlation,
            })
            .collect()
    }

    fn about_failures(&self) -> Option<Concern> {
        let failed: usize = self.failures.iter().map(|f| f.count).sum();
        let simulations = self.counters.simulations;
        if let Some(failing) = &self.failing {
            if failing.matters() {
                return Some(Concern::FailuresInPosterior {
                    failed,
                    simulations,
                    mass: failing.mass,
                    p_value: failing.p_value,
                    place: failing.place.clone(),
                });
            }
            if !failing.depends() && failed as f64 > FAILED_SHARE * simulations as f64 {
                let ln_share = (-(failed as f64) / simulations as f64).ln_1p();
                return Some(Concern::FailuresAtRandom { failed, simulations, ln_share });
            }
        }
        (failed as f64 > FAILED_SHARE * simulations as f64).then(|| Concern::ManyFailures {
            failed,
            simulations,
            commonest: self.failures.first().map_or_else(String::new, |f| f.cause.clone()),
        })
    }
}

fn about_moved(MovedBy { mean, sd, correlation }: MovedBy) -> Option<Concern> {
    let most = mean.max(sd).max(correlation);
    (most > MOVED).then_some(Concern::SamplesMoved { mean, sd, correlation })
}

fn about_information(p: &ParameterSummary) -> Option<Concern> {
    let (parameter, bits) = (p.parameter.name.clone(), p.information_gain_bits);
    (bits < INFORMED_BITS).then_some(Concern::NotInformed { parameter, bits })
}

fn about_magnitude(p: &ParameterSummary) -> Option<Concern> {
    let interval = &p.in_si.eti95;
    let factor = interval.upper / interval.lower;
    let parameter = p.parameter.name.clone();
    (interval.lower > 0.0 && factor > MAGNITUDE)
        .then_some(Concern::OrderOfMagnitude { parameter, factor })
}

fn about_independence((group, noise, r): (Option<String>, &Noise, &Residuals)) -> Option<Concern> {
    let dependent = r.values.len() >= FEWEST_RESIDUALS && !r.independent;
    let (lag1, runs_z) = (r.lag1, r.runs_z);
    let modelled = noise.is_correlated();
    dependent.then_some(Concern::ResidualsNotIndependent { lag1, runs_z, modelled, group })
}

fn about_fit((group, _, r): (Option<String>, &Noise, &Residuals)) -> Option<Concern> {
    r.misfit.filter(|ratio| *ratio > MISFIT_LIMIT).map(|ratio| Concern::PoorFit { ratio, group })
}
