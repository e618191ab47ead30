//! Beds: many particles with the contact law and the kinetics of the pair.

mod contact;
mod engine;
mod error;
mod forces;
mod friction;
mod material;
mod measure;
mod motion;
mod neighbours;
mod packing;
mod particles;
mod quasi_static;
mod region;
mod vec3;

pub use engine::{Bed, Drive, Start, Surroundings, Work};
pub use error::BedError;
pub use material::{Friction, Growing, Material};
pub use measure::{ContactState, Energies, Sample};
pub use packing::{Radii, jammed_packing, random_packing};
pub use particles::Particles;
pub use quasi_static::{QuasiStaticReport, QuasiStaticSettings};
pub use region::{Region, Side, Wall};
