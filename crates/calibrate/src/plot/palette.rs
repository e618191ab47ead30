//! One colour, dash and marker per role, the same in every figure.

/// What a curve or a point stands for; it decides its colour, dash and marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// Measurements.
    Data,
    /// The posterior: bands, densities, means.
    Posterior,
    /// The maximum a posteriori.
    Map,
    /// The value or curve of the paper.
    Paper,
    /// The best curve of Frenkel's model, with one parameter.
    Frenkel,
    /// The prior.
    Prior,
    /// The n-th of several named models, samplers or solvers (0 to 7; counts on from the start beyond that).
    Series(usize),
}
