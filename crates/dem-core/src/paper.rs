//! The powders of Table 1, the system of Table 2 and the nine numbers of Table 3.

use crate::{Powder, printed::PrintedTable3};

/// Density of all particles (Table 2) \[kg/m3\].
pub const DENSITY_KG_PER_M3: f64 = 1000.0;
/// Loading stiffness K1 (Table 2) \[N/m\].
pub const K1_N_PER_M: f64 = 3.0e-4;
/// Largest unloading stiffness over K1 (Table 2).
pub const K2_MAX_OVER_K1: f64 = 10.0;
/// Cohesion stiffness over K1 (Table 2).
pub const KC_OVER_K1: f64 = 1.0;
/// Adhesive force over `K1 R`; the paper prints `fa = K1 * 1e-3 m`, which as a force is an overlap of
/// thirty particle radii. With R for the metre a/R starts at 0.032, just above the JKR contact of eq. 3.
pub const ADHESION_OVER_K1_RADIUS: f64 = 1.0e-3;

/// Polystyrene (Table 1).
pub const PS: Powder = Powder {
    radius_m: 30.5e-6,
    youngs_modulus_pa: 1.60e9,
    surface_tension_n_per_m: 35.0e-3,
    density_kg_per_m3: DENSITY_KG_PER_M3,
};
/// Polyamide 12 (Table 1).
pub const PA12: Powder = Powder {
    radius_m: 31.5e-6,
    youngs_modulus_pa: 1.65e9,
    surface_tension_n_per_m: 40.70e-3,
    density_kg_per_m3: DENSITY_KG_PER_M3,
};
/// PEEK 450PF (Table 1).
pub const PEEK_450PF: Powder = Powder {
    radius_m: 25.0e-6,
    youngs_modulus_pa: 2.00e9,
    surface_tension_n_per_m: 41.0e-3,
    density_kg_per_m3: DENSITY_KG_PER_M3,
};

/// Table 3 for [`PS`], as printed.
pub const PS_TABLE3: PrintedTable3 = PrintedTable3 { c1: 21.2, tau_s: 2.1e-6, delta_c: 4.8e-7 };
/// Table 3 for [`PA12`], as printed.
pub const PA12_TABLE3: PrintedTable3 = PrintedTable3 { c1: 4.1e-1, tau_s: 1.2e-4, delta_c: 2.7e-7 };
/// Table 3 for [`PEEK_450PF`], as printed.
pub const PEEK_450PF_TABLE3: PrintedTable3 =
    PrintedTable3 { c1: 1.5e-1, tau_s: 5.7e-4, delta_c: 9.8e-7 };
