//! Priors: distribution functions, quantiles, densities, and what is refused.

use crate::support::prior;
use proptest::prelude::*;
use smc_calib::{Coordinate, Prior, PriorError, PriorSpec};

fn some() -> Vec<PriorSpec> {
    vec![
        PriorSpec::Uniform { lower: -2.0, upper: 3.0 },
        PriorSpec::LogUniform { lower: 1e-9, upper: 1e-3 },
        PriorSpec::Normal { mean: 5.0, sd: 0.1 },
        PriorSpec::LogNormal { median: 1e-6, sd_log10: 0.7 },
        PriorSpec::TruncatedNormal { mean: 0.0, sd: 1.0, lower: -1.0, upper: 2.0 },
        PriorSpec::TruncatedNormal { mean: 0.0, sd: 1.0, lower: 6.0, upper: 9.0 },
        PriorSpec::TruncatedNormal { mean: 0.0, sd: 1.0, lower: -9.0, upper: -6.0 },
    ]
}

proptest! {
    #[test]
    fn z_survives_the_way_through_theta(z in -5.0f64..5.0) {
        for spec in some() {
            let p = prior(spec.clone());
            let back = p.to_z(p.from_z(z));
            // Near a bound theta itself has fewer digits.
            prop_assert!((back - z).abs() < 1e-7 * (1.0 + z * z), "{spec:?}: {z} {back}");
        }
    }
}

#[test]
fn far_tails_keep_their_digits_where_theta_can_hold_them() {
    // The lower end of [0, 1] and both ends of unbounded priors.
    let unit = prior(PriorSpec::Uniform { lower: 0.0, upper: 1.0 });
    let log_normal = prior(PriorSpec::LogNormal { median: 1.0, sd_log10: 2.0 });
    for i in 0..=380 {
        let z = -f64::from(i) / 10.0;
        let tolerance = if z < -37.4 { 1e-8 } else { 1e-12 };
        assert!((unit.to_z(unit.from_z(z)) - z).abs() <= tolerance * (1.0 - z), "{z}");
        for z in [z, -z] {
            assert!(
                (log_normal.to_z(log_normal.from_z(z)) - z).abs() <= 1e-12 * (1.0 + z.abs()),
                "{z}"
            );
        }
    }
}

#[test]
fn densities_integrate_to_one_and_give_the_stated_moments() {
    for spec in some() {
        let p = prior(spec.clone());
        // In the coordinate, over the central 1 - 2e-10 of the prior.
        let (a, b) = (p.to_coordinate(p.quantile(1e-10)), p.to_coordinate(p.quantile(1.0 - 1e-10)));
        let n = 200_000;
        let h = (b - a) / f64::from(n);
        let (mut total, mut mean, mut square, mut entropy) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            let x = a + (f64::from(i) + 0.5) * h;
            let ln = p.ln_density_in_coordinate(p.coordinate().theta(x));
            let w = ln.exp() * h;
            total += w;
            mean += w * x;
            square += w * x * x;
            entropy -= w * ln;
        }
        let sd = (square - mean * mean).sqrt();
        assert!((total - 1.0).abs() < 1e-6, "{spec:?}: {total}");
        assert!((p.mean() - mean).abs() < 1e-4 * sd, "{spec:?}: {mean} {}", p.mean());
        assert!((p.sd() / sd - 1.0).abs() < 1e-3, "{spec:?}: {sd} {}", p.sd());
        assert!((p.entropy() - entropy).abs() < 2e-3, "{spec:?}: {entropy} {}", p.entropy());
    }
}

#[test]
fn quantiles_are_the_known_ones() {
    let p = prior(PriorSpec::LogUniform { lower: 1e-6, upper: 1e-2 });
    assert!((p.quantile(0.25) / 1e-5 - 1.0).abs() < 1e-12);
    assert_eq!(p.coordinate(), Coordinate::Log10);
    assert!((p.sd() - 4.0 / 12f64.sqrt()).abs() < 1e-12);
    // scipy.stats.truncnorm(-1, 2).ppf(0.3)
    let t = prior(PriorSpec::TruncatedNormal { mean: 0.0, sd: 1.0, lower: -1.0, upper: 2.0 });
    let lower = smc_calib::normal::cdf(-1.0);
    let mass = smc_calib::normal::cdf(2.0) - lower;
    assert!((t.quantile(0.3) - smc_calib::normal::quantile(lower + 0.3 * mass)).abs() < 1e-14);
}

#[test]
fn impossible_priors_are_refused_with_their_numbers() {
    let refused = |spec| Prior::new(spec).unwrap_err();
    assert_eq!(
        refused(PriorSpec::Uniform { lower: 2.0, upper: 1.0 }),
        PriorError::Bounds { lower: 2.0, upper: 1.0 }
    );
    assert!(matches!(
        refused(PriorSpec::LogUniform { lower: 0.0, upper: 1.0 }),
        PriorError::NotPositive { field: "lower", .. }
    ));
    assert!(matches!(
        refused(PriorSpec::Normal { mean: f64::NAN, sd: 1.0 }),
        PriorError::NotFinite { field: "mean", .. }
    ));
    assert!(matches!(
        refused(PriorSpec::Normal { mean: 0.0, sd: 0.0 }),
        PriorError::NotPositive { field: "sd", .. }
    ));
    assert!(matches!(
        refused(PriorSpec::TruncatedNormal { mean: 0.0, sd: 1.0, lower: 50.0, upper: 51.0 }),
        PriorError::NoMass { .. }
    ));
}
