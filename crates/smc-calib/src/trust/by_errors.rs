//! What standard errors say of a result that few effective samples, or weights with a heavy tail, know less well than a Gaussian process does.

use super::Concern;
use super::limits::{INTERVAL_ERROR, MOST_BY_ERRORS};
use crate::marginal::{draws_by_centre, draws_by_error};
use crate::posterior::{ParameterSummary, Posterior};

/// Largest error that is told, in posterior sds.
const LARGEST: f64 = 1e6;

/// Independent draws by which means, medians and evidence would be known as well as their standard errors say; none where a process does
/// not know all moments, or where an end of an interval is beyond what it knows.
pub(super) fn of_centre(posterior: &Posterior) -> Option<f64> {
    posterior.ess.by_errors?;
    let of_evidence = draws_by_error(1.0, posterior.log_evidence.se);
    let each = posterior.parameters.iter().map(|p| draws_by_centre(&p.in_coordinate));
    Some(each.fold(of_evidence, f64::min))
}

/// So many draws in words.
pub(super) fn in_words(draws: f64) -> String {
    if draws > MOST_BY_ERRORS {
        format!("more than {MOST_BY_ERRORS:.0}")
    } else {
        format!("{draws:.0}")
    }
}

/// Whether a parameter's standard deviation and the ends of its 95 % interval are known much less well than its mean may be.
pub(super) fn about_interval(of: &ParameterSummary) -> Option<Concern> {
    let m = &of.in_coordinate;
    // Also where it is not a number.
    let over_sd = |se: f64| (se / m.sd).min(LARGEST);
    let errors = [m.sd_se, m.eti95.lower_se, m.eti95.upper_se].map(over_sd);
    let ([sd, lower, upper], parameter) = (errors, of.parameter.name.clone());
    let known = errors.iter().all(|error| *error <= INTERVAL_ERROR);
    (!known).then_some(Concern::IntervalNotKnown { parameter, sd, lower, upper })
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::tests::sound;
    use super::*;
    use crate::posterior::Evidence;

    /// A sound result of 50 simulations and nine effective samples, of which a process knows everything as by 100 draws.
    fn by_process() -> Posterior {
        let mut p = sound();
        (p.counters.simulations, p.ess.importance, p.ess.by_errors) = (50, 9.0, Some(100.0));
        p.log_evidence = Evidence { se: 0.1, ..p.log_evidence };
        for parameter in &mut p.parameters {
            let m = &mut parameter.in_coordinate;
            (m.sd, m.mean_se, m.median_se, m.sd_se) = (2.0, 0.2, 0.2506, 0.1414);
            (m.eti95.lower_se, m.eti95.upper_se) = (0.534, 0.534);
        }
        p
    }

    fn after(change: impl FnOnce(&mut Posterior)) -> (Verdict, Option<Option<f64>>) {
        let mut p = by_process();
        change(&mut p);
        let trust = p.trust();
        let few = trust.concerns.iter().find_map(|concern| match concern {
            Concern::FewEffectiveSamples { by_errors, .. } => Some(*by_errors),
            _ => None,
        });
        (trust.verdict, few)
    }

    #[test]
    fn a_result_is_rough_where_means_medians_and_evidence_are_known_as_by_two_draws() {
        let centre = of_centre(&by_process()).expect("by a process");
        assert!((centre - 100.0).abs() < 0.1, "{centre}");
        assert_eq!(after(|_| {}).0, Verdict::Rough);
        type Change = fn(&mut Posterior, f64);
        let changes: [Change; 3] = [
            |p, n| p.log_evidence.se = 1.0 / n.sqrt(),
            |p, n| p.parameters[0].in_coordinate.mean_se = 2.0 / n.sqrt(),
            |p, n| p.parameters[0].in_coordinate.median_se = 2.5066 / n.sqrt(),
        ];
        for change in changes {
            // More than nine effective samples are told, fewer are not.
            let (verdict, told) = after(|p| change(p, 9.1));
            assert!(verdict == Verdict::Rough && told.is_some_and(|n| n.is_some()), "{told:?}");
            assert_eq!(after(|p| change(p, 2.1)), (Verdict::Rough, Some(None)));
            assert_eq!(after(|p| change(p, 1.9)), (Verdict::Untrusted, Some(None)));
        }
        assert_eq!(after(|p| p.ess.by_errors = None), (Verdict::Untrusted, Some(None)));
    }

    #[test]
    fn an_interval_is_not_known_from_half_a_posterior_sd_on() {
        let told = |change: fn(&mut crate::Moments)| {
            let mut p = by_process();
            change(&mut p.parameters[0].in_coordinate);
            let trust = p.trust();
            assert_eq!(trust.verdict, Verdict::Rough);
            trust.concerns.into_iter().find(|c| matches!(c, Concern::IntervalNotKnown { .. }))
        };
        assert_eq!(told(|m| m.eti95.upper_se = 0.99), None);
        let told = [
            told(|m| m.eti95.upper_se = 1.01),
            told(|m| m.eti95.lower_se = 1.01),
            told(|m| m.sd_se = 1.01),
        ];
        let line = told[0].as_ref().expect("told").what();
        assert!(line.contains("0.51 (upper end)") && line.contains("0.27 (lower end)"), "{line}");
        assert!(told.iter().all(Option::is_some), "{told:?}");
        // Also where the verdict rests on fewer draws than there are effective samples, and where errors are not numbers.
        let mut p = by_process();
        p.log_evidence.se = 0.4;
        p.parameters[0].in_coordinate.eti95.upper_se = f64::NAN;
        let concerns = p.trust().concerns;
        assert!(concerns.iter().any(|c| matches!(c, Concern::IntervalNotKnown { upper: 1e6, .. })));
        // Effective samples alone say no more than that they are few.
        let mut p = by_process();
        (p.ess.by_errors, p.parameters[0].in_coordinate.eti95.upper_se) = (None, 1.01);
        assert!(!p.trust().concerns.iter().any(|c| matches!(c, Concern::IntervalNotKnown { .. })));
    }

    #[test]
    fn a_heavy_tail_of_enough_effective_samples_is_rough_where_the_process_says_the_same() {
        let with = |ess: f64, beside: f64, upper: f64| {
            let mut p = by_process();
            p.settings = crate::Settings::for_budget(600);
            (p.counters.simulations, p.ess.importance, p.khat) = (600, ess, 0.8);
            p.parameters.iter_mut().for_each(|of| (of.khat, of.tail_share) = (0.8, 0.5));
            p.parameters[0].in_coordinate.eti95.upper_se = upper;
            let e = &mut p.log_evidence;
            (e.process_value, e.process_mean) = (Some(e.value + beside), Some(e.value + beside));
            p.trust()
        };
        // Three standard errors of the evidence by so many samples.
        for (ess, apart) in [(36.0, 0.5), (100.0, 0.3), (225.0, 0.2)] {
            for sign in [-1.0, 1.0] {
                let at = |factor: f64| with(ess, sign * factor * apart, 0.5).verdict;
                assert_eq!((at(0.99), at(1.01)), (Verdict::Rough, Verdict::Untrusted), "{ess}");
            }
        }
        let [heavy, interval] = [
            |c: &Concern| matches!(c, Concern::HighKhat { .. }),
            |c: &Concern| matches!(c, Concern::IntervalNotKnown { .. }),
        ];
        let (known, unknown) = (with(225.0, 0.0, 0.5), with(225.0, 0.0, 1.01));
        let line = known.line(&by_process().log_evidence);
        assert!(line.starts_with("rough") && line.contains("process through all says"), "{line}");
        assert!(known.concerns.iter().any(heavy) && !known.concerns.iter().any(interval));
        assert!(unknown.concerns.iter().any(interval), "{unknown:?}");
    }
}
