//! The corner plot: marginal densities on the diagonal, densities of the pairs below it.

/// One parameter of a [`CornerFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerParameter {
    /// Symbol, for example `C_{1}`.
    pub symbol: String,
    /// Unit, for example `Pa^{-1} s^{-1}`; empty for a pure number.
    pub unit: String,
    /// True if the draws are log10 of the parameter: ticks are then labelled with the parameter itself.
    pub log10: bool,
    /// Draws in the coordinate of the axis (log10 of the parameter where `log10`).
    pub draws: Vec<f64>,
    /// Prior density as (coordinate, density per unit of the coordinate), increasing in the coordinate; empty for none.
    pub prior: Vec<(f64, f64)>,
    /// The paper's value, in the coordinate.
    pub paper: Option<f64>,
    /// The maximum a posteriori, in the coordinate.
    pub map: Option<f64>,
}

/// Posterior of up to five parameters: marginals with 50 % and 95 % intervals, pairs with 50 % and 90 % regions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerFigure {
    /// Heading; empty for none.
    pub title: String,
    /// The parameters, one to five.
    pub parameters: Vec<CornerParameter>,
    /// One weight per draw (any scale); empty for equal weights.
    pub weights: Vec<f64>,
}
