//! The discrete-element sintering simulator: a pair of viscoelastic spheres that grow a neck.
//!
//! The model is that of J.E. Alvarez, H. Snijder, T. Vaneker, H. Cheng, S. Luding and T. Weinhart, *Neck growth kinetics
//! during polymer sintering for powder-based processes*, EPJ Web Conf. 249 (Powders & Grains 2021);
//! equation numbers in these pages are those of that paper.
//!
//! | what | where |
//! |---|---|
//! | contact law, eq. 1 | [`contact_law`] |
//! | sintering kinetics, eqs. 3 to 5 | [`kinetics`] |
//! | the pair that is simulated | [`PairSpec`], [`PairScene`] |
//! | its solvers | [`solvers`] |
//! | beds of many particles | [`bed`] |
//! | temperature histories and reduced time | [`heat`] |
//! | densification in closed form: pairs, open pores, closed pores | [`densification`] |
//! | Table 3 as printed and in SI | [`printed`] |
//! | the paper's powders and numbers | [`paper`] |
//!
//! ```
//! use dem_core::{Kinetics, PairSpec, Sintering, SolverSettings, paper, simulate};
//!
//! let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build()?;
//! let sintering = Sintering { c1: 2.4e-5, tau_s: 3.81, delta_c: 9.5e-8, lambda: 0.0 };
//! let times_s = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0];
//! let curve = simulate(&scene, Kinetics::ThreeStage, &sintering, &SolverSettings::default(), &times_s)?;
//! assert!(curve.contact_ratio.is_sorted());
//! assert_eq!(curve.contact_ratio[5], 2f64.cbrt());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Everything is SI at the boundary; inside a scene lengths are in particle radii and forces in
//! `K1 R`, so that `x = delta/R = (a/R)^2` is the overlap.

/// Runs the program of `README.md`.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod bed;
pub mod contact_law;
pub mod densification;
mod error;
pub mod heat;
pub mod kinetics;
mod knee;
pub mod lanes;
pub mod paper;
mod powder;
pub mod printed;
mod scene;
mod sintering;
pub mod solvers;

pub use contact_law::{Branch, ContactLaw};
pub use error::{SceneError, SolveError};
pub use kinetics::{Kinetic, Kinetics};
pub use knee::{Knee, heated_time_to_contact_ratio, knee, time_to_contact_ratio};
pub use powder::Powder;
pub use scene::{Damping, PairScene, PairSpec};
pub use sintering::Sintering;
pub use solvers::{
    Curve, PairRun, PairSolver, QuasiStaticLag, SolveReport, SolverChoice, SolverKind,
    SolverSettings, StopReason, choose_solver, contact_ratios, heated_contact_ratios, simulate,
    simulate_heated, verlet_batch,
};
