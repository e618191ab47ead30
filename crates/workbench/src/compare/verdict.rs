//! Conclusions of a comparison in words.

use super::comparison::{Comparison, Entry};
use super::strength::{Strength, bayes_factor};
use crate::careful::Careful;
use crate::number::significant;
use smc_calib::trust::limits::EVIDENCE_ERRORS;

/// Which kinetics the data support, and how strongly.
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

/// Reasons to be careful: where the prior or the method decides.
pub(super) fn warnings(comparison: &Comparison) -> Vec<String> {
    let mut warnings = Vec::new();
    let Some(best) = comparison.best() else { return Vec::new() };
    for entry in &comparison.entries {
        if !entry.trusted {
            warnings.push(Careful::UntrustedKinetics {
                kinetics: entry.kinetics.to_string(),
                ess: entry.ess,
                khat: entry.khat,
            });
        }
        if entry.kinetics == best.kinetics {
            continue;
        }
        let (one, other) = (best.kinetics.to_string(), entry.kinetics.to_string());
        let difference = -entry.log_bayes_factor;
        let error = entry.log_evidence_se.hypot(best.log_evidence_se);
        if difference < EVIDENCE_ERRORS * error {
            let (best, other) = (one.clone(), other.clone());
            warnings.push(Careful::EvidencesTooClose { best, other, difference, error });
        }
        // Lindley: a prior ten times wider in an informed parameter that one of the two has and the other
        // has not costs it ln 10, whatever the data say.
        let parameters = entry.informed_parameters.abs_diff(best.informed_parameters);
        let reach = std::f64::consts::LN_10 * parameters as f64;
        if parameters > 0 && difference < reach {
            warnings.push(Careful::PriorDecides {
                best: one,
                other,
                parameters,
                reach,
                difference,
            });
        }
    }
    if !best.residuals_independent && best.residual_lag1 > 0.0 {
        warnings.push(Careful::DependentComparison {
            kinetics: best.kinetics.to_string(),
            observations: comparison.observations,
            lag1: best.residual_lag1,
        });
    }
    if !comparison.with_phi()
        && comparison
            .final_contact_ratio_reason
            .as_deref()
            .is_some_and(|why| why.contains("measured"))
    {
        let value = comparison.final_contact_ratio;
        warnings.push(Careful::FinalContactRatioReadOff { value });
    }
    warnings.iter().map(ToString::to_string).collect()
}
