//! Quantile, median and root mean square of unweighted values.

/// Each error counts as this much at most.
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

/// Root mean square of errors, each [`LARGEST`] at most.
pub(crate) fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = errors.map(|v| if v.abs() < LARGEST { v } else { LARGEST }).collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
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
    fn an_error_that_is_large_or_not_a_number_counts_as_the_largest() {
        assert_eq!(median([4.0, 1.0, 2.0].into_iter()), 2.0);
        assert_eq!(rms([3.0, -4.0].into_iter()), 12.5f64.sqrt());
        for off in [11.0, -1e300, f64::NAN, f64::INFINITY] {
            assert_eq!(rms([off].into_iter()), LARGEST, "{off}");
        }
    }
}
