//! Each limit, on both sides.

use super::*;
use crate::{
    Coordinate, Counters, EffectiveSampleSize, Failure, GroupSummary, Interval, Moments, Noise,
    Parameter, PathPoint, Prior, Sample, Settings, StageRecord, StopReason,
};

fn parameter(name: &str) -> ParameterSummary {
    let prior = Prior::new(PriorSpec::Uniform { lower: -1.0, upper: 9.0 }).expect("a prior");
    let eti95 = Interval { lower: 1.0, upper: 2.0, ..Interval::default() };
    ParameterSummary {
        parameter: Parameter::new(name, "1", prior),
        coordinate: Coordinate::Linear,
        in_coordinate: Moments::default(),
        in_si: Moments { eti95, ..Moments::default() },
        map: 1.0,
        khat: 0.2,
        tail_share: 0.0,
        information_gain_bits: 3.0,
        prior_mean: 0.0,
        prior_sd: 1.0,
    }
}

fn sample(z: f64, weight: f64) -> Sample {
    let (theta, z) = (vec![0.0; 2], vec![z, 0.0]);
    let (log_likelihood, log_weight) = (Some(0.0), Some(0.0));
    let (moved, stage, replicate) = (Vec::new(), 0, 0);
    Sample { z, theta, log_likelihood, log_weight, weight, moved, stage, replicate }
}

fn stage(beta: f64) -> StageRecord {
    StageRecord { last: true, beta, ..StageRecord::default() }
}

/// A result of two parameters and ten observations that nothing speaks against.
pub(super) fn sound() -> Posterior {
    Posterior {
        is_posterior: true,
        noise: Noise::default(),
        settings: Settings::default(),
        samples: vec![sample(0.0, 1.0)],
        draws: Vec::new(),
        parameters: vec![parameter("a"), parameter("b")],
        correlation: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
        correlation_si: Vec::new(),
        log_evidence: Evidence { value: -3.25, se: 0.012, agree: true, ..Evidence::default() },
        ess: EffectiveSampleSize { importance: 5000.0, ..EffectiveSampleSize::default() },
        khat: 0.2,
        map: crate::MapPoint::default(),
        sigma: None,
        noise_shape: None,
        residuals: Residuals { values: vec![0.1; 10], independent: true, ..Residuals::default() },
        predictive: Vec::new(),
        path: vec![PathPoint::default(); 10],
        stages: vec![stage(1.0), stage(1.0)],
        failures: Vec::new(),
        failing: None,
        moved: None,
        stop: StopReason::BudgetSpent,
        counters: Counters { simulations: 10_000, ..Counters::default() },
        groups: Vec::new(),
    }
}

/// The judgement of a sound result after a change.
fn after(change: impl FnOnce(&mut Posterior)) -> Trust {
    let mut posterior = sound();
    change(&mut posterior);
    posterior.trust()
}

/// The only concern after a change, or none.
fn concern(change: impl FnOnce(&mut Posterior)) -> Option<Concern> {
    let mut concerns = after(change).concerns;
    assert!(concerns.len() < 2, "{concerns:?}");
    concerns.pop()
}

/// Why the budget of a sound result with a change is called too small; none where it is not.
fn too_small(change: impl FnOnce(&mut Posterior)) -> Option<String> {
    after(change).concerns.into_iter().find_map(|c| match c {
        Concern::BudgetTooSmall { reason, .. } => Some(reason),
        _ => None,
    })
}

#[test]
fn nothing_speaks_against_a_sound_result() {
    let trust = after(|_| ());
    assert!(trust.converged() && trust.evidence_error_known && trust.concerns.is_empty());
    assert_eq!(
        trust.line(&sound().log_evidence),
        "good; worth 5000 independent draws of the posterior (ESS); no handful of simulations decides (k-hat 0.20); \
         log evidence -3.250 +- 0.012"
    );
}

#[test]
fn the_share_of_the_prior_where_a_mode_would_have_been_met_is_that_of_the_draws_from_the_prior() {
    let drawn = |simulations, prior_share| {
        let proposal = crate::MixtureRecord { prior_share, components: Vec::new() };
        StageRecord { simulations, proposal, ..stage(1.0) }
    };
    let trust = after(|p| p.stages = vec![drawn(1000, 1.0), drawn(10_000, 0.02)]);
    // 1200 draws all miss a mode of this share with a probability of 5 %.
    assert!(((1.0 - trust.unseen).powi(1200) - 0.05).abs() < 1e-9, "{}", trust.unseen);
    let line = trust.line(&sound().log_evidence);
    assert!(line.ends_with("more than 0.25 % of the prior would have been met (95 %)"), "{line}");
    assert_eq!(after(|p| p.stages = vec![drawn(1000, 0.0)]).unseen, 1.0);
}

#[test]
fn a_tuned_result_is_untrusted_and_has_no_evidence() {
    let trust = after(|p| p.is_posterior = false);
    assert_eq!(trust.verdict, Verdict::Untrusted);
    assert_eq!(trust.concerns, [Concern::NotAPosterior]);
    assert!(trust.line(&Evidence::default()).ends_with("no evidence"));
}

#[test]
fn effective_samples_are_judged_at_400_at_a_third_of_few_simulations_and_at_40() {
    for (simulations, limit) in [(10_000, 400.0), (300, 100.0), (60, 40.0)] {
        let at = |ess| {
            after(|p| {
                (p.counters.simulations, p.ess.importance) = (simulations, ess);
            })
        };
        assert!(at(limit).converged() && at(limit).concerns.is_empty());
        let (below, ess) = (at(limit - 0.1), limit - 0.1);
        let told =
            Concern::FewEffectiveSamples { ess, wished: limit, by_errors: None, drawn: false };
        assert_eq!(below.concerns, [told]);
        let rough = if limit > 40.0 { Verdict::Rough } else { Verdict::Untrusted };
        assert_eq!(below.verdict, rough, "{simulations}");
    }
    let few = after(|p| p.ess.importance = 39.9);
    assert_eq!((few.verdict, few.evidence_error_known), (Verdict::Untrusted, false));
    let line = few.line(&sound().log_evidence);
    assert_eq!(
        line,
        "NOT TO BE TRUSTED; worth 40 independent draws of the posterior (ESS; at least 400 wished for); no handful \
         of simulations decides (k-hat 0.20); log evidence -3.2 or more, its error unknown"
    );
}

#[test]
fn a_khat_of_seven_tenths_is_one_too_many() {
    let set = |khat: f64| {
        move |p: &mut Posterior| {
            p.khat = khat;
            p.parameters
                .iter_mut()
                .for_each(|parameter| (parameter.khat, parameter.tail_share) = (khat, 0.5));
        }
    };
    assert!(after(set(0.699)).converged());
    for khat in [0.7, 10.0] {
        let trust = after(set(khat));
        assert_eq!(trust.verdict, Verdict::Untrusted);
        assert_eq!(trust.concerns, [Concern::HighKhat { parameter: None, khat, tail_share: 0.5 }]);
    }
    assert_eq!(after(|p| p.khat = f64::NAN).verdict, Verdict::Untrusted);
    let of_one = concern(|p| {
        (p.khat, p.parameters[1].khat, p.parameters[1].tail_share) = (0.8, 0.8, 0.5);
    });
    let parameter = Some("b".to_owned());
    assert_eq!(of_one, Some(Concern::HighKhat { parameter, khat: 0.8, tail_share: 0.5 }));
}

#[test]
fn a_khat_beside_its_limit_is_never_said_to_be_the_limit() {
    for (khat, words) in [
        (0.694, "0.69"),
        (0.6951, "just below 0.7"),
        (0.69999, "just below 0.7"),
        (0.7, "just above 0.7"),
        (0.7049, "just above 0.7"),
        (0.71, "0.71"),
        (-0.2, "-0.20"),
        (f64::INFINITY, "inf"),
    ] {
        assert_eq!(khat_in_words(khat), words);
    }
}

#[test]
fn a_heavy_tail_counts_from_a_tenth_of_an_estimate_on() {
    let with = |tail_share| {
        after(|p| {
            (p.khat, p.parameters[1].khat) = (1.3, 1.3);
            p.parameters[1].tail_share = tail_share;
        })
    };
    let below = with(0.0999);
    assert!(below.converged() && below.concerns.is_empty());
    let line = below.line(&sound().log_evidence);
    assert!(line.contains("stand out, but have hardly any weight (k-hat 1.30);"), "{line}");
    let above = with(0.1);
    assert_eq!(above.verdict, Verdict::Untrusted);
    assert!(matches!(above.concerns[..], [Concern::HighKhat { .. }]), "{:?}", above.concerns);
    assert!(
        above
            .line(&sound().log_evidence)
            .contains("a few simulations decide (k-hat 1.30; 0.7 is the limit);")
    );
}

/// Quantiles of two normals of sd 0.1 in the first parameter, centres this many sds apart, with this share at the second.
fn of_two_normals(apart: f64, share: f64) -> Option<Concern> {
    let n = 2000;
    concern(|p| {
        let prior = Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 }).expect("a prior");
        let half = 0.05 * apart;
        let one = |k: usize, centre: f64, share: f64| {
            let score = crate::normal::quantile((k as f64 + 0.5) / n as f64);
            // Spread the second parameter evenly, whatever the first is.
            let second = crate::normal::quantile((k as f64 * 0.618_034 + 0.5).fract().max(1e-3));
            let theta = vec![centre + 0.1 * score, second];
            Sample { theta, ..sample(0.0, share / n as f64) }
        };
        p.samples =
            (0..n).flat_map(|k| [one(k, -half, 1.0 - share), one(k, half, share)]).collect();
        for parameter in &mut p.parameters {
            parameter.parameter.prior = prior.clone();
            (parameter.in_coordinate.mean, parameter.in_coordinate.sd) = (0.0, 1.0);
        }
        p.parameters[0].in_coordinate.sd = 0.1f64.hypot(half);
    })
}

#[test]
fn two_normals_are_two_modes_from_about_five_sds_on_and_with_two_hundredths_of_the_posterior() {
    assert_eq!((of_two_normals(0.0, 0.5), of_two_normals(3.9, 0.5)), (None, None));
    match of_two_normals(5.0, 0.3) {
        Some(Concern::TwoModes { parameter, centres: [a, b], shares: [p, q] }) => {
            assert_eq!(parameter, "a");
            assert!((a + 0.25).abs() < 0.02 && (b - 0.25).abs() < 0.02, "{a} {b}");
            assert!((p - 0.7).abs() < 0.02 && (q - 0.3).abs() < 0.02, "{p} {q}");
        }
        other => panic!("{other:?}"),
    }
    assert!(of_two_normals(12.0, 0.025).is_some());
    assert_eq!(of_two_normals(12.0, 0.015), None);
}

#[test]
fn estimates_of_the_evidence_that_disagree_are_a_reason_not_to_trust() {
    let trust = after(|p| p.log_evidence.agree = false);
    assert_eq!(trust.verdict, Verdict::Untrusted);
    assert!(matches!(trust.concerns[..], [Concern::EvidenceDisagrees { .. }]));
}

#[test]
fn estimates_of_the_evidence_agree_up_to_three_standard_errors() {
    assert!(agree(1.0, 1.3, 0.1001) && agree(1.3, 1.0, 0.1001));
    assert!(!agree(1.0, 1.3, 0.0999) && !agree(1.3, 1.0, 0.0999));
}

#[test]
fn residuals_are_dependent_from_a_score_of_2_241_and_a_correlation_of_a_tenth_on() {
    // A lag-1 correlation r of m residuals has the score r sqrt(m).
    assert!(independent(0.224, 0.0, 100.0) && !independent(-0.2242, 0.0, 100.0));
    assert!(independent(0.2, 2.24, 100.0) && !independent(0.2, -2.242, 100.0));
    assert!(independent(0.0999, 9.0, 1e6) && !independent(0.1001, 9.0, 1e6));
}

#[test]
fn a_flattened_last_stage_with_few_samples_means_too_small_a_budget() {
    let reason = |ess, beta| too_small(|p| (p.ess.importance, p.stages[1].beta) = (ess, beta));
    assert!(reason(399.0, 0.99).is_some());
    assert!(reason(399.0, 1.0).is_none() && reason(400.0, 0.99).is_none());
}

#[test]
fn a_small_budget_is_too_small_with_fewer_than_seven_samples_or_with_few_and_a_flattened_likelihood()
 {
    let reason = |ess, beta| {
        too_small(|p| {
            p.settings = Settings::for_budget(1000);
            p.counters.simulations = 1000;
            (p.ess.importance, p.stages[1].beta) = (ess, beta);
        })
    };
    assert_eq!(reason(7.0, 1.0), None);
    assert_eq!(reason(6.9, 1.0).as_deref(), Some("fewer than seven effective samples"));
    assert!(reason(142.0, 0.99).is_some_and(|r| r.contains("not yet known well enough")));
    assert_eq!(reason(143.0, 0.5), None);
}

#[test]
fn few_samples_are_enough_where_the_process_says_the_same_and_more_are_not_where_it_does_not() {
    let signs = |ess, khat, [process, mean]: [f64; 2]| {
        too_small(|p| {
            p.settings = Settings::for_budget(100);
            (p.counters.simulations, p.ess.importance, p.khat) = (100, ess, khat);
            p.parameters.iter_mut().for_each(|of| (of.khat, of.tail_share) = (khat, 0.5));
            let value = p.log_evidence.value;
            p.log_evidence.process_value = Some(value + process);
            p.log_evidence.process_mean = Some(value + mean);
        })
    };
    let enough = |ess, khat| signs(ess, khat, [0.99, -0.5]).is_none();
    assert!(enough(2.0, 0.2) && enough(6.9, 9.0));
    assert!(signs(1.9, 0.2, [0.0, 0.0]).is_some_and(|r| r.contains("fewer than two")));
    for apart in [[1.01, 0.0], [-1.01, 0.0], [0.0, 5.1]] {
        assert!(signs(6.9, 0.2, apart).is_some_and(|r| r.contains("fewer than seven")));
        assert!(signs(20.0, 0.8, apart).is_some_and(|r| r.contains("heavy tail")));
    }
    // Three standard errors of the evidence by nine samples are one, and fifteen samples of a hundred simulations are many.
    assert!(signs(9.0, 0.2, [1.01, 0.0]).is_some_and(|r| r.contains("another evidence")));
    assert_eq!(signs(9.0, 0.2, [-0.99, 0.0]), None);
    assert_eq!(signs(15.0, 0.2, [2.9, 0.0]), None);
    assert!(signs(15.0, 0.2, [-3.1, 0.0]).is_some_and(|r| r.contains("another evidence")));
    assert!([-15.0, 4.9].iter().all(|mean| signs(3.0, 0.8, [0.0, *mean]).is_none()));
}

#[test]
fn the_process_is_held_against_samples_also_where_the_evidence_is_its_own() {
    let reason = |off| {
        too_small(|p| {
            p.settings = Settings::for_budget(100);
            (p.counters.simulations, p.ess.importance) = (100, 6.0);
            let e = &mut p.log_evidence;
            (e.process_value, e.process_mean) = (Some(e.value), Some(e.value));
            e.cross_fitted_value = Some(e.value + off);
        })
    };
    assert!(reason(0.99).is_none() && reason(-0.99).is_none());
    assert!(reason(1.01).is_some() && reason(-1.01).is_some());
}

#[test]
fn an_extended_run_is_judged_as_its_last_part_was_placed() {
    let reason = |samples| {
        too_small(|p| {
            p.settings = Settings::for_budget(1000).extended(samples).expect("more");
            p.counters.simulations = samples;
            (p.ess.importance, p.stages[1].beta) = (285.0, 0.99);
        })
    };
    assert!(reason(2000).is_some_and(|r| r.contains("not yet known well enough")));
    assert!(reason(4096).is_some_and(|r| r.contains("flattened likelihood")));
}

#[test]
fn information_is_judged_at_half_a_bit_and_called_almost_none_below_a_tenth() {
    let told = |bits| concern(|p| p.parameters[1].information_gain_bits = bits);
    assert_eq!(told(0.5), None);
    let text = |bits| told(bits).map(|c| c.to_string()).unwrap_or_default();
    assert!(
        text(0.499).starts_with("the data say little about b (0.50 bits): its posterior is near")
    );
    assert!(text(0.1).contains("say little") && text(0.099).contains("say almost nothing about b"));
}

#[test]
fn as_many_observations_as_parameters_are_enough() {
    let with = |m: usize| {
        concern(|p| {
            p.residuals.values.truncate(m);
            p.path.truncate(m);
        })
    };
    assert_eq!(with(2), None);
    assert_eq!(with(1), Some(Concern::FewObservations { observations: 1, parameters: 2 }));
}

#[test]
fn dependent_residuals_are_told_from_eight_on_and_by_group() {
    let with = |m: usize| {
        concern(|p| {
            p.residuals.values.truncate(m);
            p.path.truncate(m);
            (p.residuals.independent, p.residuals.lag1) = (false, -0.8);
        })
    };
    assert_eq!(with(7), None);
    let told = with(8).map(|c| c.to_string()).unwrap_or_default();
    assert!(told.contains("alternate") && told.contains("too wide"), "{told}");
    let of_group = concern(|p| {
        p.groups = vec![GroupSummary {
            name: "near".to_owned(),
            noise: Noise::default(),
            first: 0,
            observations: 10,
            log_likelihood: 0.0,
            sigma: None,
            sigma_draws: Vec::new(),
            noise_shape: None,
            shape_draws: Vec::new(),
            residuals: Residuals { values: vec![0.1; 10], lag1: 0.8, ..Residuals::default() },
            check: None,
        }];
    });
    let told = of_group.map(|c| c.to_string()).unwrap_or_default();
    assert!(told.starts_with("neighbouring residuals of near are alike"), "{told}");
}

#[test]
fn three_standard_deviations_of_an_unbounded_prior_are_the_last_that_are_not_far_out() {
    let with = |z: f64| {
        concern(|p| {
            p.samples = vec![sample(z, 1.0)];
            let prior = Prior::new(PriorSpec::LogNormal { median: 3.0, sd_log10: 0.5 });
            p.parameters[0].parameter.prior = prior.expect("a prior");
        })
    };
    assert_eq!((with(3.0), with(-3.0)), (None, None));
    let far = |score| {
        let (parameter, eti95) = ("a".to_owned(), [1.0, 2.0]);
        Some(Concern::FarInPriorTail { parameter, eti95, score })
    };
    assert_eq!((with(3.1), with(-4.0)), (far(3.1), far(-4.0)));
    let told = with(-4.0).map(|c| c.what()).unwrap_or_default();
    assert!(told.ends_with("lies 4.0 of its standard deviations below its middle"), "{told}");
}

#[test]
fn a_tenth_of_the_posterior_beyond_the_outermost_hundredth_of_the_prior_is_at_its_bound() {
    let with = |z: f64, weight: f64| {
        concern(|p| p.samples = vec![sample(z, weight), sample(0.0, 1.0 - weight)])
    };
    assert_eq!(with(2.33, 0.1), None);
    assert_eq!(with(2.32, 0.9), None);
    let at = |bound, share| Concern::AtPriorBound { parameter: "a".to_owned(), bound, share };
    assert_eq!(with(2.33, 0.11), Some(at(9.0, 0.11)));
    assert_eq!(with(-2.33, 0.11), Some(at(-1.0, 0.11)));
    let unbounded = concern(|p| {
        p.samples = vec![sample(3.0, 1.0)];
        let normal = Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 });
        p.parameters[0].parameter.prior = normal.expect("a prior");
    });
    assert_eq!(unbounded, None);
}

#[test]
fn parameters_are_told_apart_up_to_a_correlation_of_0_995() {
    let with = |correlation| concern(|p| p.correlation[1][0] = correlation);
    assert_eq!(with(0.995), None);
    for correlation in [0.9951, -0.9951] {
        let (first, second) = ("a".to_owned(), "b".to_owned());
        assert_eq!(with(correlation), Some(Concern::NotSeparable { first, second, correlation }));
    }
}

#[test]
fn more_failures_than_one_in_ten_are_told_with_the_commonest_cause() {
    let with =
        |count| concern(|p| p.failures = vec![Failure { cause: "no contact".to_owned(), count }]);
    assert_eq!(with(1000), None);
    let told = with(1001).map(|c| c.what()).unwrap_or_default();
    assert_eq!(told, "1001 of 10000 simulations failed (most often: no contact)");
}

#[test]
fn a_misfit_of_twice_the_expected_noise_is_the_last_that_passes() {
    let with = |misfit| concern(|p| p.residuals.misfit = misfit);
    assert_eq!((with(None), with(Some(2.0))), (None, None));
    assert_eq!(with(Some(2.01)), Some(Concern::PoorFit { ratio: 2.01, group: None }));
}

#[test]
fn an_interval_over_more_than_two_decades_is_knowledge_of_the_magnitude() {
    let with = |lower, upper| {
        concern(|p| p.parameters[0].in_si.eti95 = Interval { lower, upper, ..Interval::default() })
    };
    assert_eq!((with(1.0, 100.0), with(-1.0, 1000.0)), (None, None));
    let (parameter, factor) = ("a".to_owned(), 101.0);
    assert_eq!(with(1.0, 101.0), Some(Concern::OrderOfMagnitude { parameter, factor }));
}

#[test]
fn samples_more_than_a_hundredth_off_the_moments_of_the_parameters_are_told() {
    let with =
        |mean, sd, correlation| concern(|p| p.moved = Some(MovedBy { mean, sd, correlation }));
    assert_eq!((concern(|p| p.moved = None), with(0.01, 0.01, 0.01)), (None, None));
    for [mean, sd, correlation] in [[0.011, 0.0, 0.0], [0.0, 0.011, 0.0], [0.0, 0.0, 0.011]] {
        let told = Concern::SamplesMoved { mean, sd, correlation };
        assert_eq!(with(mean, sd, correlation), Some(told));
    }
}

#[test]
fn a_thinned_path_is_told() {
    let with = |kept: usize| concern(|p| p.path.truncate(kept));
    assert_eq!(with(10), None);
    assert_eq!(with(9), Some(Concern::PathThinned { kept: 9, observations: 10 }));
}

#[test]
fn a_judgement_read_from_a_file_is_the_one_that_was_written() {
    let trust = after(|p| (p.khat, p.ess.importance, p.correlation[1][0]) = (0.9, 3.0, 1.0));
    let text = serde_json::to_string(&trust).expect("plain data");
    assert!(text.starts_with(r#"{"verdict":"untrusted","effective_samples":3.0"#), "{text}");
    assert_eq!(serde_json::from_str::<Trust>(&text).expect("the same"), trust);
    assert!(serde_json::from_str::<Trust>(&text.replace("khat_limit", "other")).is_err());
}
