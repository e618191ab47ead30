//! Sobol points with nested uniform (Owen) scrambling.
//!
//! A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences" (1995); direction numbers of S. Joe and
//! F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM J. Sci. Comput. 30
//! (2008) 2635. The first 32 binary digits of a coordinate come from the net, as far as they tell its points
//! apart they are permuted digit by digit, each permutation depending on all digits before it; the digits after
//! that are independent of everything, as in the limit of nested scrambling, down to 2^-53.

use rand::Rng;

/// Most dimensions of a net.
pub(crate) const MAX_DIMENSIONS: usize = 21;

/// Degree, coefficients and initial numbers of the primitive polynomials of dimensions 2 to 21
/// (file new-joe-kuo-6 of the reference above).
const JOE_KUO: [(u32, u32, &[u32]); MAX_DIMENSIONS - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// Direction numbers of one dimension, most significant digit first.
fn directions(dimension: usize) -> [u32; 32] {
    let mut v = [0u32; 32];
    if dimension == 0 {
        for (j, v) in v.iter_mut().enumerate() {
            *v = 1 << (31 - j);
        }
        return v;
    }
    let (degree, coefficients, initial) = JOE_KUO[dimension - 1];
    let s = degree as usize;
    for j in 0..s {
        v[j] = initial[j] << (31 - j);
    }
    for j in s..32 {
        v[j] = v[j - s] ^ (v[j - s] >> s);
        for k in 1..s {
            if (coefficients >> (s - 1 - k)) & 1 == 1 {
                v[j] ^= v[j - k];
            }
        }
    }
    v
}

/// Mixes 64 bits so that each output bit depends on all input bits (the finaliser of SplitMix64).
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The first `points` points of a freshly scrambled net of `dimensions`, row by row, inside (0, 1).
pub(crate) fn scrambled_net(dimensions: usize, points: usize, rng: &mut impl Rng) -> Vec<f64> {
    assert!(dimensions <= MAX_DIMENSIONS, "direction numbers end at {MAX_DIMENSIONS} dimensions");
    let digits = usize::BITS - points.saturating_sub(1).leading_zeros();
    let mut out = vec![0.0; dimensions * points];
    for dimension in 0..dimensions {
        let v = directions(dimension);
        let (key, tail_key) = (rng.next_u64(), rng.next_u64());
        let mut x = 0u32;
        for i in 0..points {
            if i > 0 {
                // Gray code: the same points as counting, block of 2^k by block of 2^k.
                x ^= v[i.trailing_zeros() as usize];
            }
            let mut scrambled = 0u64;
            for digit in 0..digits {
                // All digits before this one, behind a leading one that tells "0" from "00".
                let prefix = (1u64 << digit) | (u64::from(x) >> (32 - digit));
                let flip = mix(key ^ mix(prefix)) >> 63;
                let bit = u64::from(x >> (31 - digit)) & 1;
                scrambled = scrambled << 1 | (bit ^ flip);
            }
            let tail = mix(tail_key ^ mix(i as u64)) >> (11 + digits);
            let integer = scrambled << (53 - digits) | tail;
            out[i * dimensions + dimension] = (integer as f64 + 0.5) * 2f64.powi(-53);
        }
    }
    out
}

/// `count` of the numbers below n, evenly and from 0 on; count is at most n.
pub(crate) fn evenly(n: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |k| k * n / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, stream};

    #[test]
    fn unscrambled_points_are_those_of_the_published_generator() {
        // Initial numbers m_j = v_j 2^(j+1-32): 1 3 5 15 (dimension 2), 1 3 3 9 (dimension 3), as tabulated there.
        for (dimension, m) in [(0, [1, 1, 1, 1]), (1, [1, 3, 5, 15]), (2, [1, 3, 3, 9])] {
            let v = directions(dimension);
            for (j, m) in m.iter().enumerate() {
                assert_eq!(v[j] >> (31 - j), *m, "dimension {dimension}, number {j}");
            }
        }
    }

    #[test]
    fn every_dimension_is_a_latin_hypercube_and_every_first_pair_a_net() {
        let (points, dimensions) = (256, MAX_DIMENSIONS);
        let net = scrambled_net(dimensions, points, &mut stream(3, Purpose::Scramble, 0, 0));
        for d in 0..dimensions {
            let mut seen = vec![false; points];
            for i in 0..points {
                let cell = (net[i * dimensions + d] * points as f64) as usize;
                assert!(
                    !std::mem::replace(&mut seen[cell], true),
                    "dimension {d} has two points in cell {cell}"
                );
            }
        }
        // The first two dimensions are a (0, 8, 2)-net in base 2: one point in every elementary interval.
        for split in 0..=8u32 {
            let (nx, ny) = (1usize << split, 1usize << (8 - split));
            let mut seen = vec![0; points];
            for i in 0..points {
                let x = (net[i * dimensions] * nx as f64) as usize;
                let y = (net[i * dimensions + 1] * ny as f64) as usize;
                seen[x * ny + y] += 1;
            }
            assert!(seen.iter().all(|c| *c == 1), "2^{split} columns");
        }
    }

    #[test]
    fn scrambled_integration_is_unbiased_and_beats_random_points() {
        // Integral of prod (1 + (u - 1/2)) = 1; random points have variance 0.13/n in three dimensions.
        let (points, dimensions, repeats) = (64, 3, 2000);
        let estimates: Vec<f64> = (0..repeats)
            .map(|r| {
                let net =
                    scrambled_net(dimensions, points, &mut stream(7, Purpose::Scramble, 0, r));
                net.chunks_exact(dimensions)
                    .map(|u| u.iter().map(|u| u + 0.5).product::<f64>())
                    .sum::<f64>()
                    / points as f64
            })
            .collect();
        let mean = estimates.iter().sum::<f64>() / repeats as f64;
        let variance =
            estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (repeats - 1) as f64;
        let random_variance = ((13f64 / 12.0).powi(3) - 1.0) / points as f64;
        assert!((mean - 1.0).abs() < 4.0 * (variance / repeats as f64).sqrt(), "biased: {mean}");
        assert!(variance < random_variance / 50.0, "{variance} against {random_variance}");
    }

    #[test]
    fn a_scrambled_coordinate_is_uniform_over_scramblings() {
        // The first point of the net is anywhere with equal probability.
        let repeats = 4000;
        let mut cells = [0u32; 16];
        for r in 0..repeats {
            let net = scrambled_net(5, 8, &mut stream(1, Purpose::Scramble, 1, r));
            cells[(net[4] * 16.0) as usize] += 1;
        }
        let expected = repeats as f64 / 16.0;
        let chi2: f64 = cells.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
        assert!(chi2 < 37.7, "chi-square {chi2} on 15 degrees of freedom (0.1 % point 37.7)");
    }
}
