//! Eight numbers at once, and exponential and logarithm that a compiler can apply to so many: no branches, no tables.
//!
//! These two work by taking a power of two out and a polynomial of what is left; errors are a few units in the last
//! place. Bits do not depend on how many numbers are done at once.

/// Number of values that are computed together; sums run in this many lanes, in a fixed order.
pub(crate) const LANES: usize = 8;

/// Eight numbers that are computed together.
pub(crate) type Lane = [f64; LANES];

/// What this work gives, by wider instructions where the machine has them: bits are the same, as no product is fused with a sum.
/// Only what is inlined into the work gains by it.
pub(crate) fn wide<R>(work: impl FnMut() -> R) -> R {
    pulp::Arch::new().dispatch(Wide(work))
}

/// As a closure of its own it would be called through a function of the narrow instructions.
struct Wide<F>(F);

impl<R, F: FnMut() -> R> pulp::NullaryFnOnce for Wide<F> {
    type Output = R;

    #[inline(always)]
    fn call(mut self) -> R {
        (self.0)()
    }
}

/// Sum, number by number. As this, [`minus`] and [`times`] give a new value, wide instructions are used also where a compiler cannot rule
/// out that target and operands overlap.
#[inline(always)]
pub(crate) fn plus(a: &Lane, b: &Lane) -> Lane {
    let mut sum = *a;
    for i in 0..LANES {
        sum[i] += b[i];
    }
    sum
}

/// Difference, number by number.
#[inline(always)]
pub(crate) fn minus(a: &Lane, b: &Lane) -> Lane {
    let mut difference = *a;
    for i in 0..LANES {
        difference[i] -= b[i];
    }
    difference
}

/// Product, number by number.
#[inline(always)]
pub(crate) fn times(a: &Lane, b: &Lane) -> Lane {
    let mut product = *a;
    for i in 0..LANES {
        product[i] *= b[i];
    }
    product
}

/// exp(x) for x not above 0; numbers below -700 count as -700.
#[inline(always)]
pub(crate) fn exp_of_nonpositive(x: f64) -> f64 {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    // Adding and taking away 1.5 2^52 rounds to a whole number, which is then in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = if x > -700.0 { x } else { -700.0 };
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN2_HIGH) - k * LN2_LOW;
    // Taylor to r^13; |r| <= 0.347, the next term is below 5e-18.
    let mut p = 1.0 / 6_227_020_800.0;
    p = p * r + 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    f64::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 52))
}

/// ln(x) for normal positive x.
#[inline(always)]
pub(crate) fn ln_of_positive(x: f64) -> f64 {
    // x = 2^k m with m between sqrt(1/2) and sqrt 2.
    const HALF_ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = x.to_bits();
    let shifted = bits.wrapping_sub(HALF_ROOT);
    let exponent = shifted & 0xfff0_0000_0000_0000;
    let m = f64::from_bits(bits.wrapping_sub(exponent));
    // The exponent as a signed whole number, through the bits of 1.5 2^52.
    let k = f64::from_bits(0x4338_0000_0000_0000u64.wrapping_add(((exponent as i64) >> 52) as u64))
        - 6_755_399_441_055_744.0;
    // ln m = 2 artanh f
    let f = (m - 1.0) / (m + 1.0);
    let q = f * f;
    let mut p = 1.0 / 21.0;
    p = p * q + 1.0 / 19.0;
    p = p * q + 1.0 / 17.0;
    p = p * q + 1.0 / 15.0;
    p = p * q + 1.0 / 13.0;
    p = p * q + 1.0 / 11.0;
    p = p * q + 1.0 / 9.0;
    p = p * q + 1.0 / 7.0;
    p = p * q + 1.0 / 5.0;
    p = p * q + 1.0 / 3.0;
    2.0 * f + (2.0 * f * q) * p + k * std::f64::consts::LN_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_and_logarithms_are_right_to_rounding() {
        for i in 0..=700_000 {
            let x = -f64::from(i) * 1e-3;
            let (got, want) = (exp_of_nonpositive(x), x.exp());
            assert!((got / want - 1.0).abs() < 1e-15, "exp({x}) = {got:e}, {want:e}");
        }
        assert_eq!(exp_of_nonpositive(0.0), 1.0);
        assert!(exp_of_nonpositive(f64::NEG_INFINITY) < 1e-300);
        for i in -200_000..=200_000 {
            let x = (f64::from(i) * 3.5e-3).exp();
            let (got, want) = (ln_of_positive(x), x.ln());
            assert!((got - want).abs() <= 4e-16 * want.abs().max(0.5), "ln({x}) = {got}, {want}");
        }
    }
}
