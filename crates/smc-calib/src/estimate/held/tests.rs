use super::*;

/// 64 samples in 4 sub-nets, one with a third of all weight, and integrals of 1 and x that their sums miss.
fn held(spread: Spread) -> Option<(Vec<f64>, Vec<f64>, Vec<f64>)> {
    let (n, r) = (64, 4);
    let mut weights = vec![0.03; n];
    weights[5] = 1.0;
    let features: Vec<f64> =
        (0..n).flat_map(|i| [1.0, (1.7 * i as f64).sin() + f64::from(u8::from(i == 5))]).collect();
    let known = [2.0, 0.3].map(|sum| sum / n as f64);
    let label: Vec<u32> = (0..n).map(|i| (i % r) as u32).collect();
    let samples = Samples { weights: &weights, label: &label, replicates: r };
    let weights = samples.held(&[spread], &known.repeat(r), &features)?.weights;
    let sum = |a: usize| -> f64 {
        weights.iter().zip(features.chunks_exact(2)).map(|(w, f)| w * f[a]).sum()
    };
    let sums = vec![sum(0), sum(1)];
    Some((weights, sums, vec![2.0, 0.3]))
}

#[test]
fn a_single_large_weight_does_not_keep_weights_from_being_held() {
    // By the weight itself the large one would have to become negative.
    assert!(held(Spread::Weight).is_none());
    let (weights, sums, known) = held(Spread::Root).expect("spread");
    assert!(weights.iter().all(|w| *w > 0.0));
    for (sum, known) in sums.iter().zip(known) {
        assert!((sum - known).abs() < 1e-12, "{sum} {known}");
    }
}

/// 64 equal weights and integrals of 1, x and x^2 that are 1.1, 0.2 and another; the means of 1, x and x^2 by the held weights.
fn far(square: f64, shares: [f64; 3]) -> Option<[f64; 3]> {
    let (n, r) = (64, 4);
    let x: Vec<f64> = (0..n).map(|i| (1.7 * f64::from(i)).sin()).collect();
    let features: Vec<f64> = x.iter().flat_map(|x| [1.0, *x, x * x]).collect();
    let of_sub_nets = [1.1, 0.2, square].repeat(r);
    let integrals =
        Integrals { of_sub_nets, features, shares: shares.to_vec(), ..Integrals::default() };
    let label: Vec<u32> = (0..n as u32).map(|i| i % r as u32).collect();
    let samples = Samples { weights: &vec![1.0; n as usize], label: &label, replicates: r };
    let (weights, _) = samples.held_to(integrals, 1, true)?;
    Some([0, 1, 2].map(|power| {
        let terms = weights.iter().zip(&x).map(|(w, x)| w * x.powi(power));
        terms.sum::<f64>() / f64::from(n)
    }))
}

/// The same by equal weights of the same sum.
fn by_samples() -> [f64; 3] {
    let x = (0..64).map(|i| (1.7 * f64::from(i)).sin());
    let sums = x.fold([0.0; 3], |s, x| [s[0] + 1.0, s[1] + x, s[2] + x * x]);
    sums.map(|sum| 1.1 * sum / 64.0)
}

fn assert_close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9, "{a} {b}");
}

#[test]
fn weights_are_held_to_the_share_of_each_integral_that_is_taken() {
    let samples = by_samples();
    for shares in [[1.0; 3], [1.0, 1.0, 0.5], [1.0, 0.3, 1.0], [0.7, 0.0, 0.6]] {
        let held = far(0.4, shares).expect("held");
        assert_close(held[0], 1.1);
        for (a, known) in [(1, 0.2), (2, 0.4)] {
            assert_close(held[a], shares[a] * known + (1.0 - shares[a]) * samples[a]);
        }
    }
}

#[test]
fn errors_of_what_is_held_are_those_of_what_is_taken_and_of_the_evidence_in_the_rest() {
    // Against a difference: errors that move the known integrals.
    let (known, by_samples) = ([2.0, 0.3, 0.9, 1.6, 0.5, 1.1], [1.0, 0.2, 0.7, 1.2, 0.1, 0.4]);
    let (shares, error) = ([1.0, 0.0, 0.6], [0.01, -0.02, 0.03]);
    let moved: Vec<f64> = known.iter().zip(error.iter().cycle()).map(|(k, e)| k + e).collect();
    for part in PARTS {
        let [before, after] =
            [&known[..], &moved].map(|known| partly(known, &by_samples, &shares, part));
        let found = partly_off(&error, &by_samples, &shares, part);
        for (a, found) in found.iter().enumerate() {
            let mean = |of: &[f64]| (of[a] + of[a + 3]) / 2.0;
            assert_close(*found, mean(&after) - mean(&before));
        }
    }
    assert!(partly_off(&[], &by_samples, &shares, 1.0).is_empty());
}

#[test]
fn an_integral_that_samples_know_as_well_is_left_to_them() {
    // An x^2 of 40 where no sample is beyond 1 is the error of a surrogate far out.
    let held = far(40.0, [1.0, 1.0, 0.0]).expect("held to evidence and mean");
    assert_close(held[1], 0.2);
    assert_close(held[2], by_samples()[2]);
}

#[test]
fn moments_that_no_weights_have_are_met_in_part_and_else_the_evidence_alone_is() {
    let samples = by_samples();
    // No x^2 is above 1: weights of sum 1.1 cannot have a mean square of 1.2, but have part of the way there.
    let part = |square: f64, value: f64, a: usize| {
        (value - samples[a]) / ([0.2, square][a - 1] - samples[a])
    };
    let held = far(1.2, [1.0; 3]).expect("held");
    let reached = part(1.2, held[2], 2);
    assert!(PARTS[1..].iter().any(|p| (p - reached).abs() < 1e-9), "{reached}");
    assert_close(part(1.2, held[1], 1), reached);
    // A fifth of the way to 40 is too far.
    let held = far(40.0, [1.0; 3]).expect("held to the evidence");
    (0..3).for_each(|a| assert_close(held[a], samples[a]));
}

#[test]
fn a_product_that_no_weights_have_leaves_the_moments_of_each_coordinate_held() {
    let (n, r) = (64, 4);
    let x = |i: usize, by: f64| (by * i as f64).sin();
    let features: Vec<f64> = (0..n)
        .flat_map(|i| {
            let (x, y) = (x(i, 1.7), x(i, 2.3));
            [1.0, x, y, x * x, x * y, y * y]
        })
        .collect();
    let known = [1.0, 0.1, -0.05, 0.4, 40.0, 0.6];
    let integrals = Integrals {
        of_sub_nets: known.repeat(r),
        features: features.clone(),
        shares: vec![1.0; 6],
        ..Integrals::default()
    };
    let label: Vec<u32> = (0..n).map(|i| (i % r) as u32).collect();
    let samples = Samples { weights: &vec![1.0; n], label: &label, replicates: r };
    let (weights, _) = samples.held_to(integrals, 2, true).expect("held");
    for (a, known) in known.into_iter().enumerate().filter(|(a, _)| *a != 4) {
        let terms = weights.iter().zip(features.chunks_exact(6));
        assert_close(terms.map(|(w, row)| w * row[a]).sum::<f64>() / n as f64, known);
    }
}

#[test]
fn without_a_better_evidence_weights_stay_as_they_are() {
    assert!(far(0.4, [0.6, 1.0, 1.0]).is_none());
}

#[test]
fn tilted_weights_stay_positive_where_moments_change_by_a_fifth() {
    // Fifteen moments of forty samples in four dimensions, as a hundred runs leave them.
    let (n, d) = (40, 4);
    let x = |i: usize, j: usize| {
        4.0 * ((i + 1) as f64 * [2.0, 3.0, 5.0, 7.0f64][j].sqrt()).fract() - 2.0
    };
    let weights: Vec<f64> = (0..n).map(|i| (-0.1 * i as f64).exp()).collect();
    let features: Vec<f64> = (0..n)
        .flat_map(|i| {
            let mut row = vec![1.0];
            row.extend((0..d).map(|j| x(i, j)));
            row.extend((0..d).flat_map(|a| (0..=a).map(move |b| x(i, a) * x(i, b))));
            row
        })
        .collect();
    let p = 15;
    let sum = |weights: &[f64], a: usize| -> f64 {
        weights.iter().zip(features.chunks_exact(p)).map(|(w, row)| w * row[a]).sum()
    };
    let others: Vec<f64> =
        weights.iter().enumerate().map(|(i, w)| w * (1.0 + 0.6 * (1.9 * i as f64).sin())).collect();
    let wished: Vec<f64> = (0..p).map(|a| sum(&others, a)).collect();
    let tilts =
        tilts(&weights, &features, &wished, &TILTS).expect("positive weights with these sums");
    let tilted: Vec<f64> = weights.iter().zip(&tilts).map(|(w, t)| w * t).collect();
    for (a, wished) in wished.iter().enumerate() {
        assert!((sum(&tilted, a) - wished).abs() < 1e-9, "{a}");
    }
    // A mean outside all samples has no such weights.
    let mut beyond = wished.clone();
    beyond[1] = 2.0 * beyond[0];
    assert!(super::tilts(&weights, &features, &beyond, &TILTS).is_none());
}

/// 48 equal weights in 4 sub-nets of two coordinates, and integrals of known moments; with what they are held to.
fn moved_to(
    [mx, my]: [f64; 2],
    [xx, xy, yy]: [f64; 3],
    least: f64,
) -> Option<(Vec<f64>, Known, Vec<f64>)> {
    let (n, r) = (48, 4);
    let features: Vec<f64> = (0..n)
        .flat_map(|i| {
            let (x, y) = ((1.7 * f64::from(i)).sin(), (2.3 * f64::from(i)).sin());
            [1.0, x, y, x * x, x * y, y * y]
        })
        .collect();
    let of_sub_nets = [1.0, mx, my, xx + mx * mx, xy + mx * my, yy + my * my].repeat(r);
    let range = [least, f64::INFINITY];
    let axis = Axis { mean: 0.0, sd: 1.0, range };
    let integrals = Integrals {
        of_sub_nets: of_sub_nets.clone(),
        features,
        shares: vec![1.0; 6],
        axes: vec![axis.clone(), axis],
        ..Integrals::default()
    };
    let label: Vec<u32> = (0..n as u32).map(|i| i % r as u32).collect();
    let samples = Samples { weights: &vec![1.0; n as usize], label: &label, replicates: r };
    let (weights, known) = samples.held_to(integrals, 2, true)?;
    Some((weights, known, of_sub_nets))
}

#[test]
fn samples_are_moved_to_moments_that_no_weights_have() {
    // Coordinates within -1 and 1 cannot have variances of 1.1.
    let (weights, known, wished) =
        moved_to([0.3, -0.2], [1.1, 0.6, 1.2], f64::NEG_INFINITY).expect("held");
    assert_eq!(known.moved.len(), 2);
    for a in 0..6 {
        let terms = weights.iter().zip(known.features.chunks_exact(6));
        assert_close(terms.map(|(w, row)| w * row[a]).sum::<f64>() / 48.0, wished[a]);
    }
    for row in known.features.chunks_exact(6) {
        let [x, y] = [row[1], row[2]];
        assert_eq!(row, [1.0, x, y, x * x, x * y, y * y]);
    }
}

#[test]
fn samples_stay_where_weights_have_the_moments_or_where_they_would_leave_the_prior_or_move_far() {
    let stays = |mean, covariance, least| {
        moved_to(mean, covariance, least).is_some_and(|(_, known, _)| known.moved.is_empty())
    };
    assert!(stays([0.1, -0.1], [0.45, 0.05, 0.5], f64::NEG_INFINITY));
    assert!(stays([0.3, -0.2], [1.1, 0.6, 1.2], -0.9));
    assert!(stays([0.9, -0.2], [1.1, 0.6, 1.2], f64::NEG_INFINITY));
    assert!(stays([0.3, -0.2], [2.5, 0.6, 1.2], f64::NEG_INFINITY));
    // Moments that are no moments at all.
    assert!(stays([0.3, -0.2], [-0.1, 0.0, 1.2], f64::NEG_INFINITY));
}

#[test]
fn samples_that_stop_at_the_end_of_the_prior_are_moved_until_all_have_the_moments() {
    let (weights, known, wished) = moved_to([0.3, -0.2], [1.1, 0.6, 1.2], -1.1).expect("held");
    assert_eq!(known.moved.len(), 2);
    let rows = || weights.iter().zip(known.features.chunks_exact(6));
    let ends = [1, 2].map(|a| rows().map(|(_, row)| row[a]).fold(0.0, f64::min));
    assert!(ends[0] >= -1.1 && ends[1] == -1.1, "{ends:?}");
    let mean = |a: usize| rows().map(|(w, row)| w * row[a]).sum::<f64>() / 48.0;
    for j in 0..2 {
        let square = 3 + 2 * j;
        let [own, exact] = [&mean as &dyn Fn(usize) -> f64, &|a| wished[a]]
            .map(|m| [m(1 + j), (m(square) - m(1 + j).powi(2)).sqrt()]);
        for k in 0..2 {
            assert!((own[k] - exact[k]).abs() < 0.02 * exact[1], "{j} {k}: {own:?} {exact:?}");
        }
    }
}

#[test]
fn moments_that_are_not_quite_those_of_a_density_are_had_but_for_their_correlation() {
    // Variances of 1.1 and 1.2 and a covariance of 1.16 would be a correlation of 1.01.
    let (weights, known, wished) =
        moved_to([0.3, -0.2], [1.1, 1.16, 1.2], f64::NEG_INFINITY).expect("held");
    assert_eq!(known.moved.len(), 2);
    let mean = |a: usize| -> f64 {
        let rows = weights.iter().zip(known.features.chunks_exact(6));
        rows.map(|(w, row)| w * row[a]).sum::<f64>() / 48.0
    };
    for a in [1, 2, 3, 5] {
        assert_close(mean(a), wished[a]);
    }
    let correlation = (mean(4) - mean(1) * mean(2)) / (1.1 * 1.2f64).sqrt();
    assert!((0.9..1.0).contains(&correlation), "{correlation}");
}

#[test]
fn moved_samples_stop_at_the_end_of_the_prior_unless_moments_are_then_missed() {
    let axes = [Axis { mean: 2.0, sd: 0.5, range: [1.0, 4.0] }];
    let at = |x: f64| [1.0, x, x * x];
    // The last one is at 3.9 of 4.
    let features: Vec<f64> = [-1.0, 0.2, 0.6, -0.4, 3.8].into_iter().flat_map(at).collect();
    let moved_to = |last: f64, wider: f64| {
        let weights = [1.0, 1.5, 0.7, 2.0, last];
        let rows = || weights.iter().zip(features.chunks_exact(3));
        let sums: Vec<f64> = (0..3).map(|a| rows().map(|(w, row)| w * row[a]).sum()).collect();
        let sd = wider * (sums[2] / sums[0] - (sums[1] / sums[0]).powi(2)).sqrt();
        let wished = [1.0, 0.3, sd * sd + 0.09].map(|m| m * sums[0]);
        let found = super::moved(&features, &sums, &Moments::to([&sums, &wished], 1)?, &axes)?;
        let sum = |a: usize| -> f64 {
            weights.iter().zip(found.chunks_exact(3)).map(|(w, row)| w * row[a]).sum()
        };
        if !super::reach(&[sum(0), sum(1), sum(2)], &wished, 1) {
            return None;
        }
        let mean = sum(1) / sum(0);
        assert!((mean - 0.3).abs() < 0.02 * sd, "{mean}");
        assert!(((sum(2) / sum(0) - mean * mean).sqrt() / sd - 1.0).abs() < 0.02, "{last}");
        Some(found[13])
    };
    for little in [0.0, 1e-6, 1e-3] {
        assert_eq!(moved_to(little, 1.14), Some(4.0), "{little}");
    }
    // With a hundredth of the weight it has a fourth of the variance: it may stop shortly before where it would go, not long before.
    assert_eq!(moved_to(0.053, 0.97), Some(4.0));
    assert_eq!(moved_to(0.053, 1.5), None);
}
