//! How a bed densifies, in closed form: pairs that approach each other, open pores, closed pores.
//!
//! | law | range | equation |
//! |---|---|---|
//! | pairs, affine ([`affine_density`]) | while necks are apart | `rho = rho0/(1 - s x/2)^3`, `x = (a/R)^2`, s of the [`Approach`] |
//! | Scherer's cell ([`cell_time`]) | open pores, rho up to [`CLOSED`] | `dx/dt = (K/2) (3 pi - 8 sqrt(2) x)^(1/3) x^(2/3)`, `rho = 3 pi x^2 - 8 sqrt(2) x^3` |
//! | Mackenzie and Shuttleworth ([`pore_time`]) | closed pores | `d rho/dt = (3/2) (4 pi/3)^(1/3) K (1 - rho)^(2/3) rho^(1/3)` |
//!
//! `K = gamma n^(1/3)/eta`, n the number of cells, or of pores, per volume of solid. With one per particle,
//! `n = 3/(4 pi R^3)`, and `tau_s = eta R/gamma` this is `K = (3/(4 pi))^(1/3)/tau_s`, and the last law
//! `d rho/dt = (1.5/tau_s) (1 - rho)^(2/3) rho^(1/3)`. Times here are in units of that tau_s.
//!
//! Sources: G.W. Scherer, J. Am. Ceram. Soc. 60 (1977) 236; J.K. Mackenzie, R. Shuttleworth, Proc. Phys. Soc. B 62
//! (1949) 833; J. Frenkel, J. Phys. (USSR) 9 (1945) 385; W.D. Kingery, M. Berg, J. Appl. Phys. 26 (1955) 1205.

use std::f64::consts::{PI, SQRT_2};
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::kinetics::UnknownName;
use crate::{Kinetics, PairScene, Sintering, time_to_contact_ratio};

/// How far two particles approach each other while a neck of radius a grows between them: `2 s a^2/(2R)`, s the
/// [`factor`](Self::factor). The neck, a/R over time, is the same for all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// The paper's: the overlap of two spheres that meet in a circle of radius a, `a^2/(2R)` for each. The matter that
    /// overlaps is left out; that of two cut spheres of kept volume goes the same way while the neck is small.
    #[default]
    Overlap,
    /// Frenkel's shrinkage on the neck law of this crate: the length shrinks by `3 gamma t/(8 eta R)` while `x = t/tau_s`, which is `3/4 a^2/(2R)`. His
    /// balance of energies has that shrinkage with a neck of its own, `a^2 = (3/2) R gamma t/eta`, for which it is Kingery and Berg's relation.
    EnergyBalance,
    /// Kingery and Berg's: the matter that leaves the contact fills the neck, `a^2/(4R)` for each.
    KingeryBerg,
}

impl Approach {
    /// All of them, the default first.
    pub const ALL: [Self; 3] = [Self::Overlap, Self::EnergyBalance, Self::KingeryBerg];

    /// The name in a scene file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Overlap => "overlap",
            Self::EnergyBalance => "energy-balance",
            Self::KingeryBerg => "kingery-berg",
        }
    }

    /// Approach over that of [`Overlap`](Self::Overlap).
    #[must_use]
    pub fn factor(self) -> f64 {
        match self {
            Self::Overlap => 1.0,
            Self::EnergyBalance => 0.75,
            Self::KingeryBerg => 0.5,
        }
    }
}

impl fmt::Display for Approach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Approach {
    type Err = UnknownName;

    fn from_str(value: &str) -> Result<Self, UnknownName> {
        Self::ALL.into_iter().find(|approach| approach.name() == value).ok_or_else(|| UnknownName {
            what: "approach",
            value: value.to_owned(),
            choices: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// Relative density of a bed that shrinks like each of its pairs, from `start` without necks.
#[must_use]
pub fn affine_density(start: f64, overlap: f64, approach: Approach) -> f64 {
    start / (1.0 - 0.5 * approach.factor() * overlap).powi(3)
}

/// The overlap `x = (a/R)^2` at which such a bed reaches a density; 0 at or below the start.
#[must_use]
pub fn affine_overlap(start: f64, density: f64, approach: Approach) -> f64 {
    (2.0 / approach.factor() * (1.0 - (start / density).cbrt())).max(0.0)
}

/// Relative density at which the pores of the cell close: its cylinders touch, `x = 1/2`, `3 pi/4 - sqrt(2) = 0.942`.
pub const CLOSED: f64 = 0.75 * PI - SQRT_2;

/// `8 sqrt(2)`.
const JOINTS: f64 = 8.0 * SQRT_2;

/// Relative density of Scherer's cell, a cube with cylinders along its edges of radius over length x up to 1/2.
#[must_use]
pub fn cell_density(x: f64) -> f64 {
    (3.0 * PI - JOINTS * x) * x * x
}

/// Its inverse, for densities from 0 to [`CLOSED`].
#[must_use]
pub fn cell_aspect(density: f64) -> f64 {
    inverse(density, [0.0, 0.5], cell_density)
}

/// Time, in tau_s, that Scherer's cell takes from nothing to a density up to [`CLOSED`]; of use are differences.
///
/// With `y^3 = 3 pi/x - c^3`, `c^3 = 8 sqrt(2)`, the integral `K t = 2 dx/((3 pi - c^3 x)^(1/3) x^(2/3))` is
///
/// ```text
/// K t = (2/c) [F(inf) - F(y)],   F(y) = (1/2) ln((c^2 - c y + y^2)/(c + y)^2) + sqrt(3) atan((2y - c)/(c sqrt(3)))
/// ```
#[must_use]
pub fn cell_time(density: f64) -> f64 {
    let x = cell_aspect(density.clamp(0.0, CLOSED));
    if x <= 0.0 {
        return 0.0;
    }
    let c = JOINTS.cbrt();
    let y = (3.0 * PI / x - JOINTS).cbrt();
    let root = 3f64.sqrt();
    // F(inf) - F(y), without the difference of two large numbers where y is large.
    let log = 0.5 * (3.0 * c * y / (c * c - c * y + y * y)).ln_1p();
    let angle = root * (0.5 * PI - ((2.0 * y - c) / (c * root)).atan());
    2.0 / c * (log + angle) * UNIT
}

/// tau_s times K, inverted: `(4 pi/3)^(1/3)`.
const UNIT: f64 = 1.611_991_954_016_469_6;

/// Time, in tau_s, that closed pores take from a density to 1, where Mackenzie and Shuttleworth's law ends.
///
/// With `w^3 = (1 - rho)/rho` it is `(2/3) G(w)`, `G(w) = ln(1 + w) - (1/2) ln(1 - w + w^2) + sqrt(3) [atan((2w - 1)/sqrt(3)) + pi/6]`.
#[must_use]
pub fn pore_time(density: f64) -> f64 {
    let density = density.clamp(f64::MIN_POSITIVE, 1.0);
    let w = ((1.0 - density) / density).cbrt();
    let root = 3f64.sqrt();
    let log = w.ln_1p() - 0.5 * (w * (w - 1.0)).ln_1p();
    (2.0 / 3.0 * (log + root * (((2.0 * w - 1.0) / root).atan() + PI / 6.0))).max(0.0)
}

/// Time, in tau_s, from one density to a higher one: by open pores up to [`CLOSED`], by closed ones from there.
#[must_use]
pub fn closure_time(from: f64, to: f64) -> f64 {
    let open = cell_time(to.min(CLOSED)) - cell_time(from.min(CLOSED));
    let closed = pore_time(from.max(CLOSED)) - pore_time(to.max(CLOSED));
    (open + closed).max(0.0)
}

/// The rate of the relative density by the same laws, per tau_s: by open pores below [`CLOSED`], by closed ones from there.
#[must_use]
pub fn closure_rate(density: f64) -> f64 {
    if density >= CLOSED {
        return 1.5 * (1.0 - density.min(1.0)).powf(2.0 / 3.0) * density.min(1.0).cbrt();
    }
    let x = cell_aspect(density);
    let by_aspect = 6.0 * PI * x - 3.0 * JOINTS * x * x;
    by_aspect * 0.5 / UNIT * (3.0 * PI - JOINTS * x).cbrt() * x.powf(2.0 / 3.0)
}

/// The relative density that a bed of density `from` has after a time, in tau_s: the inverse of [`closure_time`]. It
/// ends at 1.
///
/// The rate changes where the pores close, from 0.286 to 0.220 per tau_s: the two laws are those of different pores, and
/// nothing is smoothed.
#[must_use]
pub fn closure_density(from: f64, time: f64) -> f64 {
    let from = from.min(1.0);
    if time >= closure_time(from, 1.0) {
        return 1.0;
    }
    inverse(time, [from, 1.0], |density| closure_time(from, density))
}

/// A law by which a bed of equal particles densifies from its first contacts on, in closed form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Densification {
    /// All its pairs approach alike, up to `a/R = 1/2`, where the necks of two neighbours that touch each other meet, or to
    /// [`CLOSED`]; from there open and closed pores.
    Pairs(Approach),
    /// Open and closed pores from the start.
    Cell,
    /// Closed pores from the start.
    Pores,
}

impl Densification {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Pairs(Approach::Overlap),
        Self::Pairs(Approach::EnergyBalance),
        Self::Pairs(Approach::KingeryBerg),
        Self::Cell,
        Self::Pores,
    ];

    /// A name with its source.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pairs(Approach::Overlap) => "pairs, approach a^2/2R (overlap)",
            Self::Pairs(Approach::EnergyBalance) => "pairs, 3a^2/8R (Frenkel's shrinkage)",
            Self::Pairs(Approach::KingeryBerg) => "pairs, a^2/4R (Kingery and Berg)",
            Self::Cell => "open pores (Scherer)",
            Self::Pores => "closed pores (Mackenzie and Shuttleworth)",
        }
    }

    /// Time \[s\] from the relative density `start` to `density`: 0 at or below the start, `None` where it is never reached.
    ///
    /// `pair` and `sintering` are those of the radius of the particles.
    #[must_use]
    pub fn time_s(
        self,
        pair: &PairScene,
        (kinetics, sintering): (Kinetics, &Sintering),
        start: f64,
        density: f64,
    ) -> Option<f64> {
        let closed = |from: f64| sintering.tau_s * closure_time(from, density);
        if density <= start {
            return Some(0.0);
        }
        if density > 1.0 {
            return None;
        }
        match self {
            Self::Pairs(approach) => {
                let end = affine_overlap(start, CLOSED, approach).min(0.25);
                let overlap = affine_overlap(start, density, approach).min(end);
                let alone = time_to_contact_ratio(pair, kinetics, sintering, overlap.sqrt())?;
                let there = affine_density(start, overlap, approach);
                Some(alone + if overlap < end { 0.0 } else { closed(there.max(start)) })
            }
            Self::Cell => Some(closed(start)),
            Self::Pores => Some(sintering.tau_s * (pore_time(start) - pore_time(density))),
        }
    }
}

/// Where a rising function has a value, between the ends, to rounding.
fn inverse(value: f64, [mut low, mut high]: [f64; 2], of: impl Fn(f64) -> f64) -> f64 {
    if value <= of(low) {
        return low;
    }
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if of(middle) < value {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simpson's rule with many points.
    fn integral(from: f64, to: f64, of: impl Fn(f64) -> f64) -> f64 {
        let n = 20_000;
        let h = (to - from) / f64::from(n);
        let inside: f64 = (0..n)
            .map(|k| {
                let a = from + f64::from(k) * h;
                of(a) + 4.0 * of(a + 0.5 * h) + of(a + h)
            })
            .sum();
        inside * h / 6.0
    }

    /// `d rho/dt` \[1/tau_s\] as the laws are printed.
    fn cell_rate(density: f64) -> f64 {
        let x = cell_aspect(density);
        let k = (3.0 / (4.0 * PI)).cbrt();
        let dx = 0.5 * k * (3.0 * PI - 8.0 * SQRT_2 * x).cbrt() * x.powf(2.0 / 3.0);
        (6.0 * PI * x - 24.0 * SQRT_2 * x * x) * dx
    }

    fn pore_rate(density: f64) -> f64 {
        1.5 * (1.0 - density).powf(2.0 / 3.0) * density.cbrt()
    }

    #[test]
    fn times_of_both_laws_are_the_integrals_of_their_rates() {
        for (from, to) in [(0.05, 0.3), (0.3, 0.64), (0.64, 0.9), (0.9, CLOSED)] {
            let expected = integral(from, to, |rho| 1.0 / cell_rate(rho));
            let time = closure_time(from, to);
            assert!((time / expected - 1.0).abs() < 1e-9, "cell {from} {to}: {time} {expected}");
        }
        for (from, to) in [(CLOSED, 0.96), (0.95, 0.99), (0.64, 0.9)] {
            let expected = integral(from, to, |rho| 1.0 / pore_rate(rho));
            let time = pore_time(from) - pore_time(to);
            assert!((time / expected - 1.0).abs() < 1e-9, "pores {from} {to}: {time} {expected}");
        }
    }

    #[test]
    fn the_rate_is_that_of_the_printed_laws_and_of_the_times() {
        for density in [0.05, 0.3, 0.647, 0.9, 0.941, 0.943, 0.99] {
            let printed = if density < CLOSED { cell_rate(density) } else { pore_rate(density) };
            let rate = closure_rate(density);
            assert!((rate / printed - 1.0).abs() < 1e-12, "{density}: {rate} {printed}");
            let took = closure_time(density - 1e-4, density + 1e-4);
            assert!((rate * took / 2e-4 - 1.0).abs() < 1e-4, "{density}: {rate} {took}");
        }
        assert_eq!(closure_rate(1.0), 0.0);
    }

    #[test]
    fn pores_close_at_0_942_where_the_rate_falls_from_0_286_to_0_220() {
        assert!((CLOSED - 0.941_981).abs() < 1e-6, "{CLOSED}");
        assert!((cell_density(0.5) - CLOSED).abs() < 1e-15);
        assert!((cell_rate(CLOSED) - 0.2857).abs() < 1e-4, "{}", cell_rate(CLOSED));
        assert!((pore_rate(CLOSED) - 0.2204).abs() < 1e-4, "{}", pore_rate(CLOSED));
        // At 0.94, as it is often rounded.
        assert!((cell_rate(0.94) - 0.295).abs() < 5e-4, "{}", cell_rate(0.94));
        assert!((pore_rate(0.94) - 0.225).abs() < 5e-4, "{}", pore_rate(0.94));
        assert!((UNIT.powi(3) / (4.0 * PI / 3.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn cell_does_the_work_of_its_surface_against_its_viscosity() {
        // Scherer's balance: gamma dS/dt = -3 eta V (dh/dt/h)^2, V = 3 pi a^2 h the solid of three cylinders, S its
        // surface 6 pi a l - 24 sqrt(2) a^2 (the derivative of V by a), h the length that gives V.
        for x in [0.05f64, 0.2, 0.35, 0.48] {
            let solid = 1.0;
            let length = |x: f64| (solid / cell_density(x)).cbrt();
            let surface = |x: f64| (6.0 * PI * x - 24.0 * SQRT_2 * x * x) * length(x).powi(2);
            let effective = |x: f64| solid / (3.0 * PI * (x * length(x)).powi(2));
            let d = 1e-6;
            let slope = |of: &dyn Fn(f64) -> f64| (of(x + d) - of(x - d)) / (2.0 * d);
            // gamma = eta = n = 1: K = 1.
            let strain = slope(&effective) / effective(x);
            let dx = -slope(&surface) / (3.0 * solid * strain * strain);
            let printed = 0.5 * (3.0 * PI - 8.0 * SQRT_2 * x).cbrt() * x.powf(2.0 / 3.0);
            assert!((dx / printed - 1.0).abs() < 1e-6, "{x}: {dx} {printed}");
        }
    }

    #[test]
    fn one_pore_per_particle_takes_the_published_times() {
        let to = |density: f64| pore_time(0.64) - pore_time(density);
        assert!((to(0.9) - 0.537).abs() < 1e-3, "{}", to(0.9));
        assert!((to(0.99) - 1.04).abs() < 5e-3, "{}", to(0.99));
        assert_eq!(pore_time(1.0), 0.0);
    }

    #[test]
    fn density_after_a_time_is_the_inverse_and_ends_at_one() {
        for from in [0.3, 0.64, 0.93, CLOSED, 0.97] {
            for to in [0.75, 0.93, CLOSED, 0.96, 0.999] {
                if to > from {
                    let back = closure_density(from, closure_time(from, to));
                    assert!((back - to).abs() < 1e-12, "{from} {to}: {back}");
                }
            }
            assert_eq!(closure_density(from, 0.0), from);
            assert_eq!(closure_density(from, 1e3), 1.0);
        }
        assert_eq!(closure_density(1.0, 0.1), 1.0);
        assert_eq!(closure_density(1.2, 0.1), 1.0);
    }

    #[test]
    fn times_of_all_laws_to_a_density_are_those_of_their_parts() {
        let pair = crate::PairSpec::new(crate::paper::PA12, 2f64.cbrt()).build().expect("valid");
        let sintering = Sintering { c1: 1e-5, tau_s: 2.0, delta_c: 1e-7, lambda: 0.0 };
        let law = (Kinetics::Frenkel, &sintering);
        let time = |of: Densification, density: f64| of.time_s(&pair, law, 0.64, density);
        let overlap = Densification::Pairs(Approach::Overlap);
        // x = x0 + t/tau_s with 0.64/(1 - x/2)^3 = 0.9.
        let x = 2.0 * (1.0 - (0.64f64 / 0.9).cbrt());
        let found = time(overlap, 0.9).expect("reached");
        assert!((found - 2.0 * (x - pair.x0())).abs() < 1e-12, "{found}");
        assert!((x - 0.2149).abs() < 1e-4, "{x}");
        // Kingery and Berg's pairs end at x = 1/4 and a density of 0.777.
        let end = 0.64 / 0.9375f64.powi(3);
        let expected = 2.0 * (0.25 - pair.x0() + closure_time(end, 0.9));
        let found = time(Densification::Pairs(Approach::KingeryBerg), 0.9).expect("reached");
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        let pores = time(Densification::Pores, 0.9).expect("reached");
        assert!((pores - 2.0 * 0.537).abs() < 2e-3, "{pores}");
        assert_eq!(time(Densification::Cell, 0.97), Some(2.0 * closure_time(0.64, 0.97)));
        for of in Densification::ALL {
            assert_eq!(time(of, 0.6), Some(0.0));
            assert_eq!(time(of, 1.01), None);
            let times: Vec<f64> =
                [0.7, 0.8, 0.94, 0.95, 0.999].iter().filter_map(|&to| time(of, to)).collect();
            assert!(times.len() == 5 && times.is_sorted(), "{}: {times:?}", of.name());
        }
    }

    #[test]
    fn affine_beds_shrink_by_the_linear_laws_of_their_approach() {
        // The length shrinks by s x/2: 0.5, 3/8 and 0.25 of t/tau_s while x = t/tau_s.
        for (approach, linear) in Approach::ALL.into_iter().zip([0.5, 0.375, 0.25]) {
            let shrunk = 1.0 - (0.6 / affine_density(0.6, 0.1, approach)).cbrt();
            assert!((shrunk / (0.1 * linear) - 1.0).abs() < 1e-12, "{approach}");
            let back = affine_overlap(0.6, affine_density(0.6, 0.3, approach), approach);
            assert!((back - 0.3).abs() < 1e-12, "{approach}");
            assert_eq!(approach.name().parse::<Approach>(), Ok(approach));
        }
        assert!("none".parse::<Approach>().expect_err("unknown").to_string().contains("overlap"));
    }
}
