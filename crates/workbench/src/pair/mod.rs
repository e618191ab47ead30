//! The neck growth of a pair of particles as a model of its parameters, and what follows from its posterior.

pub mod asked_heat;
pub mod derived;
pub mod draws;
pub mod frenkel_fit;
pub mod heat;
pub mod model;
pub mod parameter;
pub mod product;
