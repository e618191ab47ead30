//! Conclusions of a comparison in words.

use super::comparison::{Comparison, Entry};
use super::strength::{Strength, bayes_factor};
use crate::careful::Careful;
use crate::number::{probability, significant};
use smc_calib::Verdict;
use smc_calib::trust::limits::EVIDENCE_ERRORS;

/// Difference of two log evidences that is worth a word.
const WORTH_A_WORD: f64 = 1.0;

/// Which kinetics the data support under each noise, whether that depends on the noise, and which noise they prefer.
pub(super) fn in_words(comparison: &Comparison) -> Vec<String> {
    let mut words: Vec<String> = comparison
        .noises
        .iter()
        .filter_map(|noise| under_one_noise(comparison, &noise.name))
        .collect();
    if comparison.noises.len() > 1 {
        words.push(dependence(comparison));
        words.extend(preferred_noise(comparison));
    }
    words
}

/// The kinetics that the data support under one noise, by evidence and by leave-one-out prediction.
fn under_one_noise(comparison: &Comparison, noise: &str) -> Option<String> {
    let best = comparison.best_under(noise)?;
    let rivals: Vec<&Entry> =
        comparison.under(noise).filter(|entry| entry.kinetics != best.kinetics).collect();
    let second = rivals.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
    let named = |wanted: &dyn Fn(Strength) -> bool| -> Vec<&str> {
        let found = rivals.iter().filter(|entry| wanted(entry.strength));
        found.map(|entry| entry.kinetics.as_str()).collect()
    };
    let close = named(&|strength| strength <= Strength::BareMention);
    let mut words = if close.is_empty() {
        format!(
            "With {noise} errors the data support {}: {} evidence against the next best, {} (Bayes factor {}).",
            best.kinetics,
            second.strength,
            second.kinetics,
            bayes_factor(-second.log_bayes_factor),
        )
    } else {
        format!(
            "With {noise} errors the data do not decide between {} and {} (Bayes factors below 3).",
            best.kinetics,
            close.join(", "),
        )
    };
    let excluded = named(&|strength| strength == Strength::VeryStrong);
    if !excluded.is_empty() {
        words.push_str(&format!(" Very strong evidence against {}.", excluded.join(", ")));
    }
    let predictor = comparison
        .under(noise)
        .max_by(|a, b| a.leave_one_out.ln_density.total_cmp(&b.leave_one_out.ln_density))?;
    words.push_str(&if predictor.kinetics == best.kinetics {
        format!(" {} also predicts left-out observations best.", best.kinetics)
    } else {
        let clear = -best.leave_one_out_difference > 2.0 * best.leave_one_out_difference_spread;
        format!(
            " {} predicts left-out observations better than {}, by {} ± {}: {}.",
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
    Some(words)
}

/// Whether the order of the kinetics depends on the noise.
fn dependence(comparison: &Comparison) -> String {
    let mut bests: Vec<&str> = Vec::new();
    for noise in &comparison.noises {
        if !bests.contains(&noise.best.as_str()) {
            bests.push(&noise.best);
        }
    }
    let mut words = match &bests[..] {
        [one] => format!("{one} is the best kinetics under every noise"),
        several => {
            let each = several.iter().map(|best| {
                let under = comparison.noises.iter().filter(|noise| noise.best == **best);
                let names: Vec<&str> = under.map(|noise| noise.name.as_str()).collect();
                format!("{best} with {} errors", names.join(" and "))
            });
            format!(
                "The best kinetics depends on the noise: {}",
                each.collect::<Vec<_>>().join(", ")
            )
        }
    };
    let turned = turned(comparison);
    if turned.is_empty() {
        words.push_str(if bests.len() == 1 {
            "; no pair of kinetics changes its order clearly with the noise."
        } else {
            "; no pair of them changes its order clearly, by more than 1 in ln Z both ways."
        });
    } else {
        words.push_str(&format!("; the order changes between {}.", turned.join(", ")));
    }
    words
}

/// Pairs of kinetics whose order changes from one noise to another, by more than [`WORTH_A_WORD`] both ways.
fn turned(comparison: &Comparison) -> Vec<String> {
    let kinetics = comparison.kinetics();
    let mut turned = Vec::new();
    for (place, a) in kinetics.iter().enumerate() {
        for b in &kinetics[place + 1..] {
            let differences: Vec<(f64, &str)> = comparison
                .noises
                .iter()
                .filter_map(|noise| {
                    let [a, b] = [a, b].map(|one| comparison.cell(one, &noise.name));
                    Some((a?.log_evidence - b?.log_evidence, noise.name.as_str()))
                })
                .collect();
            let extreme = |sign: f64| {
                let by = |x: &&(f64, &str), y: &&(f64, &str)| (sign * x.0).total_cmp(&(sign * y.0));
                differences.iter().max_by(by).filter(|(by, _)| sign * by > WORTH_A_WORD)
            };
            if let (Some((most, with)), Some((least, other))) = (extreme(1.0), extreme(-1.0)) {
                turned.push(format!(
                    "{a} and {b} (ln Z of {a} is {} above with {with} errors, {} below with {other} ones)",
                    significant(*most, 2),
                    significant(-least, 2),
                ));
            }
        }
    }
    turned
}

/// The noise that the data prefer, and by how much.
fn preferred_noise(comparison: &Comparison) -> Option<String> {
    let mut ranked: Vec<_> = comparison.noises.iter().collect();
    ranked.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let (first, others) = ranked.split_first()?;
    let gap = |other: &&super::comparison::NoiseEvidence| first.log_evidence - other.log_evidence;
    let best = comparison.best()?;
    let close = others.iter().any(|other| gap(other) < WORTH_A_WORD);
    let gaps: Vec<String> = others
        .iter()
        .map(|other| format!("{} above {} ones", significant(gap(other), 3), other.name))
        .collect();
    let opening =
        if close { "The data hardly tell the noise models apart" } else { "The data prefer" };
    let subject = if close {
        format!(": {} errors have the largest ln Z", first.name)
    } else {
        format!(" {} errors", first.name)
    };
    Some(format!(
        "{opening}{subject}: averaged over the kinetics, ln Z is {}. Of the whole table {} with {} errors has probability {}.",
        gaps.join(" and "),
        best.kinetics,
        best.noise,
        probability(best.probability),
    ))
}

/// Reasons to be careful: where the prior or the method decides.
pub(super) fn warnings(comparison: &Comparison) -> Vec<String> {
    let mut warnings = Vec::new();
    let untrusted = |entry: &&Entry| entry.sampling == Verdict::Untrusted;
    for entry in comparison.entries.iter().filter(untrusted) {
        warnings.push(Careful::UntrustedKinetics {
            kinetics: entry.kinetics.to_string(),
            noise: entry.noise.to_string(),
            ess: entry.ess,
            khat: entry.khat,
        });
    }
    for noise in &comparison.noises {
        warnings.extend(close_calls(comparison, &noise.name));
    }
    let correlated = comparison.noises.iter().any(|noise| noise.noise.is_correlated());
    if let Some(best) = comparison.best()
        && !best.residuals_independent
        && best.residual_lag1 > 0.0
    {
        warnings.push(Careful::DependentComparison {
            kinetics: best.kinetics.to_string(),
            noise: best.noise.to_string(),
            lag1: best.residual_lag1,
            correlated,
        });
    }
    if !comparison.with_phi() && is_read_off(comparison.final_contact_ratio_reason.as_deref()) {
        let value = comparison.final_contact_ratio;
        warnings.push(Careful::FinalContactRatioReadOff { value, of: None });
    }
    doubt(comparison).into_iter().chain(warnings.iter().map(ToString::to_string)).collect()
}

/// The clock or the priors, where the most probable model under a doubt says so.
fn doubt(comparison: &Comparison) -> Option<String> {
    let doubted = || comparison.entries.iter().filter(|entry| !entry.doubts.is_empty());
    let first = doubted().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))?;
    Some(format!(
        "{} with {} errors, and {} of {} models in all: {}",
        first.kinetics,
        first.noise,
        doubted().count(),
        comparison.entries.len(),
        first.doubts.first()?
    ))
}

/// Kinetics under one noise that the method or the prior tells apart, not the data.
fn close_calls(comparison: &Comparison, noise: &str) -> Vec<Careful> {
    let Some(best) = comparison.best_under(noise) else { return Vec::new() };
    let ranked = |entry: &Entry| Ranked {
        name: entry.kinetics.clone(),
        log_bayes_factor: entry.log_bayes_factor,
        se: entry.log_evidence_se,
        informed: entry.informed_parameters,
    };
    let rivals = comparison.under(noise).filter(|entry| entry.kinetics != best.kinetics);
    rivals.flat_map(|entry| close_call(&ranked(best), &ranked(entry), noise)).collect()
}

/// Whether a final contact ratio was read off the measurements, by the reason that is given for it.
pub(super) fn is_read_off(reason: Option<&str>) -> bool {
    reason.is_some_and(|why| why.contains("measured"))
}

/// A model by its evidence.
pub(super) struct Ranked {
    pub(super) name: String,
    /// Log evidence minus that of the best.
    pub(super) log_bayes_factor: f64,
    /// Standard error of the log evidence.
    pub(super) se: f64,
    /// Number of parameters that the data inform.
    pub(super) informed: usize,
}

/// Whether the method or the prior tells a model from the best one, not the data.
pub(super) fn close_call(best: &Ranked, entry: &Ranked, noise: &str) -> Vec<Careful> {
    let mut warnings = Vec::new();
    let (one, other, noise) = (best.name.clone(), entry.name.clone(), noise.to_owned());
    let difference = -entry.log_bayes_factor;
    let error = entry.se.hypot(best.se);
    if difference < EVIDENCE_ERRORS * error {
        let (best, other, noise) = (one.clone(), other.clone(), noise.clone());
        warnings.push(Careful::EvidencesTooClose { best, other, noise, difference, error });
    }
    // Lindley: a prior ten times wider in an informed parameter that one of the two has and the other
    // has not costs it ln 10, whatever the data say.
    let parameters = entry.informed.abs_diff(best.informed);
    let reach = std::f64::consts::LN_10 * parameters as f64;
    if parameters > 0 && difference < reach {
        let best = one;
        warnings.push(Careful::PriorDecides { best, other, noise, parameters, reach, difference });
    }
    warnings
}
