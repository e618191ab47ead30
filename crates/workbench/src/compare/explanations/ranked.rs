//! `compare.json` of explanations: the ranking as data, and its conclusions in words.

use serde::Serialize;
use smc_calib::{PredictiveCheck, Verdict};

use super::super::comparison::{Informed, informed, weights};
use super::super::strength::{Strength, bayes_factor};
use super::super::verdict::{Ranked, close_call, is_read_off};
use super::explained::{Explained, noise_kinds};
use super::own::Law;
use super::priors;
use crate::careful::Careful;
use crate::error::InputError;
use crate::pair::parameter::ParameterName;
use crate::plan::{Plan, pairs};
use crate::record::{FitError, Record};

/// Version of the layout.
const SCHEMA_VERSION: u32 = 1;

/// `compare.json` of explanations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExplanationsReport {
    /// Version of the layout.
    pub schema_version: u32,
    /// Everything that decides the result.
    pub plan: ExplanationsPlan,
    /// The ranking: one entry, that of the measurements that all explain.
    pub comparisons: [Explanations; 1],
}

/// Everything that decides the ranking.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExplanationsPlan {
    /// The runs that were compared; empty where a plan was calibrated for it.
    pub runs: Vec<String>,
    /// The plan of each explanation.
    pub experiments: Vec<Plan>,
}

/// Explanations of the same measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanations {
    /// Heading.
    pub title: String,
    /// Number of observations.
    pub observations: usize,
    /// The noise models.
    pub noise: String,
    /// The explanations in the order in which they were given.
    pub explanations: Vec<Explanation>,
    /// Conclusion in plain words.
    pub verdict: Vec<String>,
    /// Reasons to be careful.
    pub warnings: Vec<String>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explanation {
    /// Its name.
    pub name: String,
    /// Log evidence.
    pub log_evidence: f64,
    /// Its standard error.
    pub log_evidence_se: f64,
    /// Probability, each being as likely beforehand.
    pub probability: f64,
    /// Log evidence minus that of the best.
    pub log_bayes_factor: f64,
    /// The strength of that evidence.
    pub strength: Strength,
    /// How each observable is met.
    pub fits: Vec<FitOf>,
    /// The parameters, with the information gained on each.
    pub informed: Vec<Informed>,
    /// Number of parameters, or of combinations where only these matter, that the data inform.
    pub informed_parameters: usize,
    /// Effective sample size.
    pub ess: f64,
    /// Pareto shape of the importance weights.
    pub khat: f64,
    /// What the sampler's diagnostics say.
    pub sampling: Verdict,
    /// Whether intervals can be taken as they are.
    pub trusted: bool,
}

/// How an observable is met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitOf {
    /// The observable, as the first explanation calls it.
    pub label: String,
    /// Errors of the MAP curve.
    pub error: FitError,
    /// Whether data made by the posterior are as far from their curves, where several observables were calibrated together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub check: Option<PredictiveCheck>,
}

impl ExplanationsReport {
    /// The ranking.
    pub fn ranked(&self) -> &Explanations {
        &self.comparisons[0]
    }
}

impl Explanations {
    /// The explanation of largest evidence.
    pub fn best(&self) -> Option<&Explanation> {
        self.explanations.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
    }
}

/// Ranks explanations; `places` are those of their observables in the order of the first one's, `laws` what of them say whether a
/// law of the radius is contradicted.
pub(super) fn report(
    explained: &[Explained],
    places: &[Vec<usize>],
    runs: Vec<String>,
    laws: Vec<Law>,
) -> Result<ExplanationsReport, InputError> {
    let first = &explained[0].record.plan;
    let labels: Vec<String> =
        first.observables().map(|(experiment, own)| first.label(experiment, own)).collect();
    let mut explanations: Vec<Explanation> =
        explained.iter().zip(places).map(|(one, places)| of(one, &labels, places)).collect();
    let logs: Vec<f64> = explanations.iter().map(|one| one.log_evidence).collect();
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for (one, probability) in explanations.iter_mut().zip(weights(&logs)) {
        one.probability = probability;
        one.log_bayes_factor = one.log_evidence - top;
        one.strength = Strength::of(-one.log_bayes_factor);
    }
    let mut ranking = Explanations {
        title: first.title.clone(),
        observations: first.observations(),
        noise: noise_kinds(first),
        explanations,
        verdict: Vec::new(),
        warnings: Vec::new(),
    };
    ranking.verdict = verdict(&ranking).into_iter().collect();
    let trusted = ranking.explanations.iter().all(|one| one.sampling != Verdict::Untrusted);
    ranking.verdict.extend(laws.iter().map(|law| law.in_words(&logs, trusted)));
    ranking.warnings = warnings(&ranking, explained);
    Ok(ExplanationsReport {
        schema_version: SCHEMA_VERSION,
        plan: ExplanationsPlan {
            runs,
            experiments: explained.iter().map(|one| one.record.plan.clone()).collect(),
        },
        comparisons: [ranking],
    })
}

fn of(Explained { name, record }: &Explained, labels: &[String], places: &[usize]) -> Explanation {
    let found: Vec<_> = record.observables().map(|(_, found)| found).collect();
    let fits = labels.iter().zip(places).map(|(label, place)| FitOf {
        label: label.clone(),
        error: found[*place].map_error,
        check: found[*place].check,
    });
    let (parameters, informed_parameters) = informed(record);
    Explanation {
        name: name.clone(),
        log_evidence: record.log_evidence.value,
        log_evidence_se: record.log_evidence.se,
        probability: 0.0,
        log_bayes_factor: 0.0,
        strength: Strength::None,
        fits: fits.collect(),
        informed: parameters,
        informed_parameters,
        ess: record.ess.importance,
        khat: record.khat,
        sampling: record.trust.verdict,
        trusted: record.trusted(),
    }
}

/// The explanation that the data support, and how strongly.
fn verdict(ranking: &Explanations) -> Option<String> {
    let best = ranking.best()?;
    let mut rivals: Vec<&Explanation> =
        ranking.explanations.iter().filter(|one| one.name != best.name).collect();
    rivals.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let second = rivals.first()?;
    let close: Vec<&str> = rivals
        .iter()
        .filter(|one| one.strength <= Strength::BareMention)
        .map(|one| one.name.as_str())
        .collect();
    Some(if close.is_empty() {
        format!(
            "The data support \"{}\": {} evidence against the next best, \"{}\" (Bayes factor {}).",
            best.name,
            second.strength,
            second.name,
            bayes_factor(-second.log_bayes_factor)
        )
    } else {
        format!(
            "The data do not decide between \"{}\" and \"{}\" (Bayes factors below 3).",
            best.name,
            close.join("\", \"")
        )
    })
}

fn ranked(one: &Explanation) -> Ranked {
    Ranked {
        name: one.name.clone(),
        log_bayes_factor: one.log_bayes_factor,
        se: one.log_evidence_se,
        informed: one.informed_parameters,
    }
}

/// Reasons to be careful: where the prior, the noise or the method decides.
fn warnings(ranking: &Explanations, explained: &[Explained]) -> Vec<String> {
    let noise = &ranking.noise;
    let mut warnings = Vec::new();
    for one in ranking.explanations.iter().filter(|one| one.sampling == Verdict::Untrusted) {
        warnings.push(Careful::UntrustedKinetics {
            kinetics: one.name.clone(),
            noise: noise.clone(),
            ess: one.ess,
            khat: one.khat,
        });
    }
    let Some(best) = ranking.best() else { return Vec::new() };
    for one in ranking.explanations.iter().filter(|one| one.name != best.name) {
        warnings.extend(close_call(&ranked(best), &ranked(one), noise));
    }
    warnings.extend(priors::that_differ(explained));
    warnings.extend(best_curve_misses(best, &ranking.explanations));
    let records = || explained.iter().filter(|one| one.name == best.name);
    let dependent = records().flat_map(|one| one.record.observables()).find_map(|(plan, found)| {
        let residuals = &found.residuals;
        (!residuals.independent && residuals.lag1 > 0.0)
            .then(|| (residuals.lag1, plan.noise.is_correlated()))
    });
    if let Some((lag1, correlated)) = dependent {
        let (kinetics, noise) = (best.name.clone(), noise.clone());
        warnings.push(Careful::DependentComparison { kinetics, noise, lag1, correlated });
    }
    let read_off = explained.iter().flat_map(|one| {
        let of = Some(one.name.clone());
        let values = read_off(&one.record).into_iter();
        values.map(move |value| Careful::FinalContactRatioReadOff { value, of: of.clone() })
    });
    warnings.extend(read_off);
    warnings.iter().map(ToString::to_string).collect()
}

/// How many times worse than another the best curve of the most probable explanation may be before that is said.
const MUCH_WORSE: f64 = 2.0;

/// The observable that the best curve of the most probable explanation misses most, beside the one that meets it best, where it is
/// much worse.
fn best_curve_misses(best: &Explanation, all: &[Explanation]) -> Option<Careful> {
    let times_worse = |(fit, _, meets): &(&FitOf, &Explanation, f64)| fit.error.rmse / meets;
    let of = |(k, fit): (usize, _)| {
        let others = all.iter().filter_map(|one| Some((fit, one, one.fits.get(k)?.error.rmse)));
        others.min_by(|a, b| a.2.total_cmp(&b.2))
    };
    let (fit, other, other_rmse) = best
        .fits
        .iter()
        .enumerate()
        .filter_map(of)
        .filter(|found| times_worse(found) > MUCH_WORSE)
        .max_by(|a, b| times_worse(a).total_cmp(&times_worse(b)))?;
    Some(Careful::BestCurveMisses {
        best: best.name.clone(),
        observable: fit.label.clone(),
        rmse: fit.error.rmse,
        other: other.name.clone(),
        other_rmse,
    })
}

/// The final contact ratios of an explanation that ends there, where they were read off the data.
fn read_off(record: &Record) -> Vec<f64> {
    let parameters = &record.plan.parameters;
    let read_off = pairs(&record.plan.experiments).filter(|(_, pair)| {
        let calibrated = pair.calibrated(ParameterName::Phi);
        parameters.iter().all(|parameter| parameter.name != calibrated)
            && pair.heat.is_none()
            && is_read_off(pair.final_contact_ratio_reason.as_deref())
    });
    let mut values: Vec<f64> = read_off.map(|(_, pair)| pair.final_contact_ratio).collect();
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An explanation that meets two observables with these root mean square errors.
    fn of(name: &str, rmse: [f64; 2]) -> Explanation {
        let fit = |(label, rmse): (&str, f64)| FitOf {
            label: label.to_owned(),
            error: FitError { rmse, max: rmse },
            check: None,
        };
        Explanation {
            name: name.to_owned(),
            log_evidence: 0.0,
            log_evidence_se: 0.0,
            probability: 0.5,
            log_bayes_factor: 0.0,
            strength: Strength::None,
            fits: ["large", "small"].into_iter().zip(rmse).map(fit).collect(),
            informed: Vec::new(),
            informed_parameters: 0,
            ess: 1000.0,
            khat: 0.1,
            sampling: Verdict::Converged,
            trusted: true,
        }
    }

    #[test]
    fn a_most_probable_explanation_whose_curve_misses_what_another_meets_is_named_with_the_worst() {
        let all = [of("shared", [0.06, 0.02]), of("own", [0.2, 0.05]), of("none", [0.3, 0.1])];
        let words = best_curve_misses(&all[1], &all).expect("a reason").to_string();
        let says = "\"own\" misses large by 0.20 (RMSE), that of \"shared\" by 0.060";
        assert!(words.contains(says), "{words}");
        assert_eq!(best_curve_misses(&all[0], &all), None);
        // Twice as far is not much worse.
        let near = [of("shared", [0.06, 0.02]), of("own", [0.12, 0.04])];
        assert_eq!(best_curve_misses(&near[1], &near), None);
    }
}
