//! Beds: many particles with the contact law and the kinetics of the pair.
//!
//! | what | where |
//! |---|---|
//! | a scene from TOML, its phases, its run | [`SceneFile`], [`Scene::run`], [`Run`], [`Series`] |
//! | the engine: velocity Verlet, neighbour list, threads | [`Bed::advance`] |
//! | force balance at every instant, for times that no step of inertia reaches | [`Bed::advance_quasi_static`] |
//! | the end of the pairs, and the closed laws that follow | [`WhenNecksMeet`], [`Law`], [`densification`](crate::densification) |
//! | necks that resist shear and rolling | [`Material::with_neck_viscosity`] |
//! | random and jammed packings | [`random_packing`], [`jammed_packing`] |
//! | tables, pictures' data, restarts | [`write_csv`], [`write_vtk`], [`Bed::checkpoint`] |
//!
//! A contact is the pair of the calibration at the effective radius `R = 2 Ri Rj/(Ri + Rj)`, up to the neck at which the
//! smaller particle is a hemisphere on the larger one ([`final_contact_ratio`]); a wall has `2 Ri` and does not grow. Features that a scene does not have (images, unequal radii, friction and with it rotation,
//! walls, gravity, drag, growth) are not compiled into its step; `README.md` beside this module has the cost of each.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use dem_core::bed::SceneFile;
//!
//! let scene = r#"
//!     name = "pair"
//!     phases = [{ name = "heat", duration_s = 0.05, heated = true, outputs = 5 }]
//!     [particles.table]
//!     positions_m = [[0.0, 0.0, 0.0], [62.9685e-6, 0.0, 0.0]]
//!     radii_m = [31.5e-6, 31.5e-6]
//!     [material]
//!     youngs_modulus_pa = 1.65e9
//!     surface_tension_n_per_m = 40.7e-3
//!     density_kg_per_m3 = 1000.0
//!     [sintering]
//!     kinetics = "three-stage"
//!     c1 = 1.177e-5
//!     tau_s = 3.81
//!     delta_c = 9.55e-8
//!     calibrated_radius_m = 31.5e-6
//! "#;
//! let series = SceneFile::parse(scene, "pair.toml")?.build()?.run(|_, _| ControlFlow::Continue(()))?;
//! assert!(series.samples[5].mean_contact_ratio > 0.1);
//! # Ok::<(), dem_core::bed::BedError>(())
//! ```

mod adhesion;
mod advance;
mod checkpoint;
mod closure;
mod contact;
mod engine;
mod error;
mod forces;
mod friction;
mod heat_clock;
mod heated;
mod material;
mod measure;
mod motion;
mod necks;
mod neighbours;
mod output;
mod packing;
mod particles;
mod phase;
mod place;
mod quasi_static;
mod region;
mod relist;
mod run;
mod scene;
mod scene_file;
mod set_off;
mod stability;
mod start;
mod stiffness;
mod vec3;

pub use adhesion::AdhesionTable;
pub use closure::{EndRates, LEAST_CLOSING, Law, NECKS_MEET, WhenNecksMeet};
pub use engine::{Bed, Drive, Work};
pub use error::BedError;
pub use material::{Friction, Growing, Material, final_contact_ratio};
pub use measure::{ContactState, Energies, Sample, inertia_error};
pub use output::{CSV_HEADER, write_csv, write_vtk};
pub use packing::{Radii, jammed_packing, random_packing};
pub use particles::Particles;
pub use phase::{Mode, Phase};
pub use quasi_static::{QuasiStaticReport, QuasiStaticSettings};
pub use region::{Region, Side, Wall};
pub use run::{Progress, Run, Series};
pub use scene::Scene;
pub use scene_file::{
    BoxTable, DragTable, GravityTable, MaterialTable, Outline, ParticlesTable, SceneFile,
    SinteringTable,
};
pub use start::{Start, Surroundings};
pub use stiffness::PhaseEntry;
