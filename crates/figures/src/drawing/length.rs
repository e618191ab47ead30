//! Units of length on a page. plotters counts in whole numbers: here in hundredths of a point.

/// plotters' units per point.
pub(crate) const PER_POINT: f32 = 100.0;
/// Points (1/72 inch) per millimetre.
pub(crate) const POINTS_PER_MM: f32 = 72.0 / 25.4;

/// A length in points as plotters counts it.
pub(crate) fn grid(points: f32) -> i32 {
    (points * PER_POINT).round() as i32
}

/// A length of plotters in points.
pub(crate) fn points(grid: i32) -> f32 {
    grid as f32 / PER_POINT
}
