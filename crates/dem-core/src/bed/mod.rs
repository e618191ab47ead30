//! Beds: many particles with the contact law and the kinetics of the pair.

mod checkpoint;
mod contact;
mod engine;
mod error;
mod forces;
mod friction;
mod material;
mod measure;
mod motion;
mod neighbours;
mod output;
mod packing;
mod particles;
mod quasi_static;
mod region;
mod run;
mod scene;
mod vec3;

pub use engine::{Bed, Drive, Start, Surroundings, Work};
pub use error::BedError;
pub use material::{Friction, Growing, Material};
pub use measure::{ContactState, Energies, Sample};
pub use output::{CSV_HEADER, write_csv, write_vtk};
pub use packing::{Radii, jammed_packing, random_packing};
pub use particles::Particles;
pub use quasi_static::{QuasiStaticReport, QuasiStaticSettings};
pub use region::{Region, Side, Wall};
pub use run::{Progress, Series};
pub use scene::{
    BoxTable, DragTable, FrictionTable, GravityTable, MaterialTable, Mode, ParticlesTable, Phase,
    RadiiTable, Scene, SceneFile, SideName, SinteringTable,
};
