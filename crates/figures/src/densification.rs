//! Densification: a quantity of a bed over time under the posterior, and where the model ends.

use plotters::style::Color as _;

use crate::columns::{Band, Columns};
use crate::drawing::{Axis, GREY, Look, Marker, Page, Pen, Role, Scale, Spec, Swatch, WHITE};
use crate::drawing::{header, one_panel};
use crate::error::PlotError;
use crate::figure::Figure;

/// A fan chart. Columns are as long as `time_s`; values that are not finite are gaps.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DensificationFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the quantity, for example `relative density`.
    pub quantity: String,
    /// Time since heating began \[s\].
    pub time_s: Vec<f64>,
    /// Median over the draws.
    pub median: Vec<f64>,
    /// Central 50 % of the draws.
    pub band50: Band,
    /// Central 90 % of the draws.
    pub band90: Band,
    /// Value of the quantity at which the pairs end; what lies above is shaded.
    pub pairs_end_at: Option<f64>,
    /// Value that the bed is to reach.
    pub target: f64,
    /// Median of the time to the target \[s\].
    pub time_to_target_s: Option<f64>,
    /// Its interval \[s\]; without an end it goes on to the edge of the panel.
    pub interval_s: [Option<f64>; 2],
}

impl Figure for DensificationFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("densification");
        let each = (self.time_s.len(), "time");
        columns.need("median", &self.median, each)?;
        columns.allow_band("band50", &self.band50, each)?;
        columns.allow_band("band90", &self.band90, each)?;

        let (median, map) = (Role::Posterior.pen(), Role::Map.ink());
        let look = Look::filled(Marker::Diamond, 2.6, map).outlined(Pen::solid(WHITE, 0.5));
        let mut entries = vec![
            ("median", Swatch::Line(median)),
            ("50 %", Swatch::Band(median.ink.mix(0.45))),
            ("90 %", Swatch::Band(median.ink.mix(0.25))),
        ];
        if self.time_to_target_s.is_some() {
            entries.push(("time to the target, 90 %", Swatch::Point(look)));
        }
        if self.pairs_end_at.is_some() {
            entries.push(("necks meet: after the pairs", Swatch::Band(GREY.mix(0.3))));
        }
        let top = header(page, &self.title, &entries)?;

        let times = self.time_s.iter().copied();
        let x = Axis::holding("time since heating began", "s", Scale::Linear, times, 0.02)
            .starting_at(0.0);
        let values = self.median.iter().copied().chain(self.band90.bounds()).chain([self.target]);
        let y = Axis::holding(&self.quantity, "", Scale::Linear, values, 0.06);
        let Some(panel) = one_panel(page, top, Spec::new(x, y))? else { return Ok(()) };
        let across = [panel.x.low, panel.x.high];
        if let Some(end) = self.pairs_end_at {
            let lower = [end.max(panel.y.low); 2];
            panel.between(&across, &lower, &[panel.y.high; 2], GREY.mix(0.18))?;
            panel.across(end, Pen::dashed(GREY, 0.9, &[1.2, 1.4]))?;
        }
        panel.band(&self.time_s, &self.band90, median.ink.mix(0.25))?;
        panel.band(&self.time_s, &self.band50, median.ink.mix(0.30))?;
        panel.line(&self.time_s, &self.median, median)?;
        panel.across(self.target, Pen::solid(GREY, 0.4))?;
        if let Some(time) = self.time_to_target_s {
            let [from, to] = self.interval_s;
            let bar = [from.unwrap_or(across[0]), to.unwrap_or(across[1])];
            panel.line(&bar, &[self.target; 2], Pen::solid(map, 1.6))?;
            panel.mark(time, self.target, look)?;
        }
        Ok(())
    }
}
