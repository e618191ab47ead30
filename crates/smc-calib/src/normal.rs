//! The standard normal distribution, accurate in both tails.
//!
//! A probability near one loses its digits, so a point of a distribution is given by both tail areas, [`Tails`]; the
//! smaller one keeps full precision.

use std::f64::consts::FRAC_1_SQRT_2;

/// ln sqrt(2 pi)
pub(crate) const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_8;

/// Both tail areas of a point: `below + above = 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tails {
    /// P(X <= x)
    pub below: f64,
    /// P(X > x)
    pub above: f64,
}

/// Log density of the standard normal.
pub fn ln_density(z: f64) -> f64 {
    -0.5 * z * z - LN_SQRT_2PI
}

/// Log density of independent standard normals: of the prior at normal scores.
pub(crate) fn ln_prior(z: &[f64]) -> f64 {
    -z.iter().map(|z| 0.5 * z * z + LN_SQRT_2PI).sum::<f64>()
}

/// Phi(z), to full relative precision for z down to -37.5 (below it the result is subnormal).
///
/// # Formula
/// Phi(z) = erfc(-z / sqrt 2) / 2
pub fn cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Both tail areas of z.
pub fn tails(z: f64) -> Tails {
    if z <= 0.0 {
        let below = cdf(z);
        Tails { below, above: 1.0 - below }
    } else {
        let above = cdf(-z);
        Tails { below: 1.0 - above, above }
    }
}

/// Phi^-1 of a lower tail area; relative precision holds down to the smallest positive number.
pub fn quantile(p: f64) -> f64 {
    if p.is_nan() || !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if p == 0.0 {
        return f64::NEG_INFINITY;
    }
    if p == 1.0 {
        return f64::INFINITY;
    }
    // Above one half 1 - p is exact.
    if p > 0.5 { -lower_quantile(1.0 - p) } else { lower_quantile(p) }
}

/// The z whose tail areas these are, taken from the smaller one.
pub fn quantile_of(tails: Tails) -> f64 {
    if tails.below <= tails.above { quantile(tails.below) } else { -quantile(tails.above) }
}

/// Phi^-1 of a lower tail area not above one half: M.J. Wichura, "Algorithm AS 241: the percentage
/// points of the normal distribution", Applied Statistics 37 (1988) 477 (PPND16, relative error
/// about 1e-16), here in the order of a polynomial's coefficients.
fn lower_quantile(p: f64) -> f64 {
    const A: [f64; 8] = [
        3.387_132_872_796_366_6,
        1.331_416_678_917_843_8e2,
        1.971_590_950_306_551_4e3,
        1.373_169_376_550_946e4,
        4.592_195_393_154_987e4,
        6.726_577_092_700_87e4,
        3.343_057_558_358_813e4,
        2.509_080_928_730_122_7e3,
    ];
    const B: [f64; 8] = [
        1.0,
        4.231_333_070_160_091e1,
        6.871_870_074_920_579e2,
        5.394_196_021_424_751e3,
        2.121_379_430_158_659_7e4,
        3.930_789_580_009_271e4,
        2.872_908_573_572_194_3e4,
        5.226_495_278_852_854e3,
    ];
    const C: [f64; 8] = [
        1.423_437_110_749_683_5,
        4.630_337_846_156_546,
        5.769_497_221_460_691,
        3.647_848_324_763_204_5,
        1.270_458_252_452_368_4,
        2.417_807_251_774_506e-1,
        2.272_384_498_926_918_4e-2,
        7.745_450_142_783_414e-4,
    ];
    const D: [f64; 8] = [
        1.0,
        2.053_191_626_637_759,
        1.676_384_830_183_803_8,
        6.897_673_349_851e-1,
        1.481_039_764_274_800_8e-1,
        1.519_866_656_361_645_7e-2,
        5.475_938_084_995_345e-4,
        1.050_750_071_644_416_9e-9,
    ];
    const E: [f64; 8] = [
        6.657_904_643_501_103,
        5.463_784_911_164_114,
        1.784_826_539_917_291_3,
        2.965_605_718_285_048_7e-1,
        2.653_218_952_657_612_4e-2,
        1.242_660_947_388_078_4e-3,
        2.711_555_568_743_487_6e-5,
        2.010_334_399_292_288_1e-7,
    ];
    const F: [f64; 8] = [
        1.0,
        5.998_322_065_558_88e-1,
        1.369_298_809_227_358e-1,
        1.487_536_129_085_061_5e-2,
        7.868_691_311_456_133e-4,
        1.846_318_317_510_054_8e-5,
        1.421_511_758_316_446e-7,
        2.044_263_103_389_939_8e-15,
    ];
    let ratio = |a: &[f64; 8], b: &[f64; 8], x: f64| polynomial(a, x) / polynomial(b, x);
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * ratio(&A, &B, r);
    }
    let r = (-p.ln()).sqrt();
    -if r <= 5.0 { ratio(&C, &D, r - 1.6) } else { ratio(&E, &F, r - 5.0) }
}

fn polynomial(coefficients: &[f64; 8], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdf_and_quantile_match_known_values() {
        // 40-digit values (mpmath).
        for (z, p) in [
            (-1.0, 0.158_655_253_931_457_05),
            (-3.0, 1.349_898_031_630_094_5e-3),
            (-8.0, 6.220_960_574_271_784e-16),
            (-20.0, 2.753_624_118_606_234e-89),
            (-37.0, 5.725_571_222_524_577e-300),
        ] {
            approx::assert_relative_eq!(cdf(z), p, max_relative = 1e-13);
            approx::assert_relative_eq!(quantile(p), z, max_relative = 1e-14);
        }
        approx::assert_relative_eq!(quantile(0.975), 1.959_963_984_540_054, max_relative = 1e-15);
        assert_eq!(quantile(0.5), 0.0);
    }

    #[test]
    fn tails_lose_no_z_between_minus_38_and_38() {
        for i in -3800..=3800 {
            let z = f64::from(i) / 100.0;
            let back = quantile_of(tails(z));
            // Beyond 37.5 a tail area is subnormal and has fewer digits.
            let tolerance = if z.abs() > 37.5 { 1e-9 } else { 1e-13 };
            assert!((back - z).abs() <= tolerance * z.abs().max(1.0), "{z} came back as {back}");
        }
    }

    #[test]
    fn a_number_outside_zero_to_one_has_no_quantile() {
        assert!(quantile(-0.1).is_nan() && quantile(1.1).is_nan() && quantile(f64::NAN).is_nan());
        assert_eq!(quantile(0.0), f64::NEG_INFINITY);
        assert_eq!(quantile(1.0), f64::INFINITY);
    }
}
