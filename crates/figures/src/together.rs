//! Several measured curves with the posterior of each, calibrated together.

use plotters::style::Color as _;

use crate::axes::Axes;
use crate::columns::{Band, Columns};
use crate::drawing::{Look, Page, Pen, Role, Spec, Swatch, header, one_panel};
use crate::error::PlotError;
use crate::figure::Figure;

/// One experiment of a [`TogetherFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TogetherCurve {
    /// Name in the legend.
    pub name: String,
    /// Control values of the measurements, for example times.
    pub control: Vec<f64>,
    /// Measured values, one per control value.
    pub value: Vec<f64>,
    /// Control values at which the curve is given, increasing.
    pub grid: Vec<f64>,
    /// Posterior mean of the curve, one per grid point.
    pub mean: Vec<f64>,
    /// Central 90 % of a new measurement, or of the curve where noise is not known between the measurements; empty for none.
    pub band90: Band,
}

/// Measurements of several experiments with posterior mean and 90 % band of each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TogetherFigure {
    /// Heading; empty for none.
    pub title: String,
    /// The experiments, in the order of the legend, at most eight.
    pub curves: Vec<TogetherCurve>,
    /// Names and scales of the axes.
    pub axes: Axes,
}

/// More experiments than this have no looks of their own.
const MOST_CURVES: usize = 8;

impl Figure for TogetherFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("together");
        columns.at_most("curves", self.curves.len(), MOST_CURVES)?;
        for TogetherCurve { name, control, value, grid, mean, band90 } in &self.curves {
            let data = (control.len(), "control value");
            columns.need(&format!("value of {name}"), value, data)?;
            let points = (grid.len(), "grid point");
            columns.need(&format!("mean of {name}"), mean, points)?;
            columns.allow_band(&format!("band90 of {name}"), band90, points)?;
        }
        let pen = |place: usize| Pen::solid(Role::Series(place).ink(), 1.3);
        let mut entries: Vec<(&str, Swatch)> = (self.curves.iter().enumerate())
            .map(|(place, curve)| {
                let marker = Role::Series(place).marker();
                (curve.name.as_str(), Swatch::LineAndPoint(pen(place), marker))
            })
            .collect();
        if self.curves.iter().any(|curve| !curve.band90.is_empty()) {
            entries.push(("90 %", Swatch::Band(Role::Data.ink().mix(0.2))));
        }
        let top = header(page, &self.title, &entries)?;
        let all = |pick: fn(&TogetherCurve) -> &Vec<f64>| -> Vec<f64> {
            self.curves.iter().flat_map(pick).copied().collect()
        };
        let x = self.axes.control_of(&all(|curve| &curve.control), &all(|curve| &curve.grid));
        let bounds = self.curves.iter().flat_map(|curve| curve.band90.bounds());
        let values = all(|curve| &curve.value).into_iter().chain(all(|curve| &curve.mean));
        let y = self.axes.value(values.chain(bounds));
        let Some(panel) = one_panel(page, top, Spec::new(x, y))? else { return Ok(()) };
        for (place, curve) in self.curves.iter().enumerate() {
            panel.band(&curve.grid, &curve.band90, Role::Series(place).ink().mix(0.2))?;
        }
        for (place, curve) in self.curves.iter().enumerate() {
            panel.line(&curve.grid, &curve.mean, pen(place))?;
        }
        // Nothing covers a measurement.
        for (place, curve) in self.curves.iter().enumerate() {
            let role = Role::Series(place);
            let look = Look::filled(role.marker(), 1.3, role.ink().mix(0.9));
            panel.markers(&curve.control, &curve.value, look)?;
        }
        Ok(())
    }
}
