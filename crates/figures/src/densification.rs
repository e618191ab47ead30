//! Densification: how a bed fills over time under the posterior, and where the model ends.

use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Marker, Pen, WHITE};
use super::{Band, Columns, PlotError, Role};

/// A fan chart. Columns are as long as `time_s`; values that are not finite are gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct DensificationFigure {
    /// Heading; empty for none.
    pub title: String,
    /// What is drawn over time, for example `relative density`.
    pub quantity: String,
    /// What decides the colour.
    pub role: Role,
    /// Time since heating began \[s\].
    pub time_s: Vec<f64>,
    /// Median over the draws.
    pub median: Vec<f64>,
    /// Central 50 % of the draws.
    pub band50: Band,
    /// Central 90 % of the draws.
    pub band90: Band,
    /// Where the model ends, as a value of the quantity; what lies above is shaded.
    pub model_ends_at: Option<f64>,
    /// The value whose time is asked for.
    pub target: f64,
    /// Median of that time \[s\].
    pub time_to_target_s: Option<f64>,
    /// Its interval \[s\]; an end that is not there is that of the panel.
    pub interval_s: [Option<f64>; 2],
}

impl DensificationFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("densification");
        columns.need("median", &self.median, self.time_s.len(), "time")?;
        columns.allow_band("band50", &self.band50, self.time_s.len(), "time")?;
        columns.allow_band("band90", &self.band90, self.time_s.len(), "time")?;
        let ink = self.role.ink();
        let target = Pen::dashed(Role::Map.ink(), 0.9, &[3.0, 1.5]);
        let ends = Pen::dashed(GREY, 0.9, &[1.2, 1.4]);
        let mut entries = vec![
            ("median".to_owned(), Swatch::Line(self.role.pen())),
            ("50 %".to_owned(), Swatch::Band(ink.mix(0.45))),
            ("90 %".to_owned(), Swatch::Band(ink.mix(0.25))),
        ];
        let look =
            Look::filled(Marker::Diamond, 2.6, Role::Map.ink()).outlined(Pen::solid(WHITE, 0.5));
        if self.time_to_target_s.is_some() {
            entries.push(("time to the target, 90 %".to_owned(), Swatch::Point(look)));
        }
        if self.model_ends_at.is_some() {
            entries.push(("necks meet: outside the model".to_owned(), Swatch::Band(GREY.mix(0.3))));
        }
        let top = header(page, &self.title, &entries)?;
        let x = Axis::holding(
            "time since heating began",
            "s",
            Scale::Linear,
            self.time_s.iter().copied(),
            0.02,
        )
        .starting_at(0.0);
        let values = self
            .median
            .iter()
            .chain(&self.band90.lower)
            .chain(&self.band90.upper)
            .copied()
            .chain([self.target]);
        let y = Axis::holding(&self.quantity, "", Scale::Linear, values, 0.06);
        let (low, high) = (y.low, y.high);
        let height = page.of_width(140.0, 230.0);
        let panels = layout(page, top, 8.0, &[(height, vec![Some(Spec::new(x, y))])])?;
        let Some(panel) = panels.into_iter().flatten().flatten().next() else { return Ok(()) };
        let across = [panel.x.low, panel.x.high];
        if let Some(end) = self.model_ends_at {
            panel.band(&across, &[end.max(low); 2], &[high; 2], GREY.mix(0.18))?;
            panel.across(end, ends)?;
        }
        panel.band(&self.time_s, &self.band90.lower, &self.band90.upper, ink.mix(0.25))?;
        panel.band(&self.time_s, &self.band50.lower, &self.band50.upper, ink.mix(0.30))?;
        panel.line(&self.time_s, &self.median, self.role.pen())?;
        panel.across(self.target, Pen::solid(GREY, 0.4))?;
        if let Some(time) = self.time_to_target_s {
            let [from, to] = self.interval_s;
            let bar = [from.unwrap_or(across[0]), to.unwrap_or(across[1])];
            panel.line(&bar, &[self.target; 2], Pen { width: 1.6, dash: &[], ..target })?;
            panel.markers(&[time], &[self.target], look)?;
        }
        Ok(())
    }
}
