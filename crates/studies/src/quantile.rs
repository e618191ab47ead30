//! Quantile, median and root mean square of unweighted values.

/// What an error counts as at most in [`capped_rms`].
pub(crate) const LARGEST: f64 = 10.0;

/// Quantile of sorted values, linear in between where both neighbours are finite.
pub(crate) fn quantile(sorted: &[f64], p: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let place = p * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    if below == above { below } else { below + (above - below) * place.fract() }
}

/// Median of values in any order.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    quantile(&sorted, 0.5)
}

/// Root mean square.
pub(crate) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

/// Root mean square of errors, each [`LARGEST`] at most.
pub(crate) fn capped_rms(errors: impl Iterator<Item = f64>) -> f64 {
    rms(errors.map(|v| if v.abs() < LARGEST { v } else { LARGEST }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_lies_between_its_neighbours_and_infinities_stay_infinite() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(quantile(&[1.0, f64::INFINITY, f64::INFINITY], 0.75), f64::INFINITY);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn where_errors_are_capped_a_large_one_or_none_counts_as_the_largest() {
        assert_eq!(median([4.0, 1.0, 2.0].into_iter()), 2.0);
        for mean in [rms([3.0, -4.0].into_iter()), capped_rms([3.0, -4.0].into_iter())] {
            assert_eq!(mean, 12.5f64.sqrt());
        }
        assert_eq!(rms([-11.0].into_iter()), 11.0);
        for off in [11.0, -1e300, f64::NAN, f64::INFINITY] {
            assert_eq!(capped_rms([off].into_iter()), LARGEST, "{off}");
        }
    }
}
