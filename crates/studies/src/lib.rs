//! What studies and the tests of solvers share.

pub mod stiff_reference;
