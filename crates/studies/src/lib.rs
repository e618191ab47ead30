//! Reference solutions shared by the studies and the tests of solvers.

pub mod stiff_reference;
