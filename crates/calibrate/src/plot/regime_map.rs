//! The regime map of a/R against time: eqs. 3 to 5, as in Figure 2 of the paper.

/// Adhesive contact, zipping and stretching, with the two points where one hands over to the next.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RegimeMapFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the lines [s], positive and increasing.
    pub grid_s: Vec<f64>,
    /// a0/R (eq. 3), a constant.
    pub a0: f64,
    /// a1/R (eq. 4), one per grid time.
    pub a1: Vec<f64>,
    /// a2/R (eq. 5), one per grid time.
    pub a2: Vec<f64>,
    /// p1 = (time [s], a/R), where a0 meets a1.
    pub p1: Option<(f64, f64)>,
    /// p2 = (time [s], a/R), where a1 meets a2.
    pub p2: Option<(f64, f64)>,
    /// a/R at which growth stops; drawn as a line.
    pub final_ratio: Option<f64>,
    /// Measurements to lay over the map: times [s]; may be empty.
    pub data_time_s: Vec<f64>,
    /// Measurements to lay over the map: a/R.
    pub data_ratio: Vec<f64>,
}
