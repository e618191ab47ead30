//! The two forms of Table 3: as printed, and in SI.
//!
//! Table 3 does not hold SI values of the parameters of eqs. 3 to 5. Two things separate them, both
//! found by working back from the statements of section 4 of the paper:
//!
//! 1. The adhesion parameter of the code that ran is `fa/R` (N/m) while its rates divide `f_ep` (N)
//!    by it, so every rate carries a factor R in metres: `tau_s = tau_table / R`. Read literally,
//!    1.2e-4 s would end PA12 thirty thousand times too soon.
//! 2. That code works with the radius `R* = R/2` of the pair, compares `2a/R` with its threshold,
//!    and spreads its zipping law differently. In the symbols of eqs. 4 and 5 it integrates
//!    - the knee `a_ve/R = (1/2) (63 pi^3)^(1/5) (delta_c,table / (4R))^(2/5)`,
//!    - zipping `x^(7/2) = B t` with `B = (63 pi^3/16) gamma delta_c,table C1_table / (512 R)`,
//!    - stretching `dx/dt = R / tau_table`.
//!
//! Equating these with the SI forms, knee `(63 pi^3)^(1/5) (delta_c/(8R))^(2/5)` and
//! `B = (63 pi^3/16) (delta_c/R)^2 (2 C1 gamma/R)`:
//!
//! - `delta_c/8 = delta_c,table / (4 * 2^(5/2))`, so `delta_c = delta_c,table / (2 sqrt 2)`;
//! - `2 C1 delta_c^2 / R^3 = delta_c,table C1_table / (512 R)` with
//!   `delta_c^2 = delta_c,table^2 / 8`, so `C1 = C1_table R^2 / (128 delta_c,table)`;
//! - `tau_s = tau_table / R`.
//!
//! Here R is the number of metres in the radius. The map is one to one.

use crate::Sintering;

/// The three parameters in the form printed in Table 3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrintedTable3 {
    /// C1 as printed.
    pub c1: f64,
    /// tau_s as printed.
    pub tau_s: f64,
    /// delta_c as printed.
    pub delta_c: f64,
}

/// Writes SI parameters of particles of radius `radius_m` in the form of Table 3.
#[must_use]
pub fn to_printed(sintering: &Sintering, radius_m: f64) -> PrintedTable3 {
    let delta_c = sintering.delta_c * DELTA_C_RATIO;
    PrintedTable3 {
        c1: sintering.c1 * 128.0 * delta_c / (radius_m * radius_m),
        tau_s: sintering.tau_s * radius_m,
        delta_c,
    }
}

/// Reads numbers in the form of Table 3, for particles of radius `radius_m`, into SI.
#[must_use]
pub fn from_printed(printed: &PrintedTable3, radius_m: f64) -> Sintering {
    Sintering {
        c1: printed.c1 * radius_m * radius_m / (128.0 * printed.delta_c),
        tau_s: printed.tau_s / radius_m,
        delta_c: printed.delta_c / DELTA_C_RATIO,
        lambda: 0.0,
    }
}

/// `delta_c,table / delta_c = 2 sqrt 2`.
const DELTA_C_RATIO: f64 = 2.0 * std::f64::consts::SQRT_2;
