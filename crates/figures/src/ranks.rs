//! Ranks of a simulation-based calibration: whether the truth is ranked uniformly within its posteriors.

use plotters::style::Color as _;

use crate::columns::{Band, Columns};
use crate::drawing::{Axis, GREY, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{grid_of, header, layout};
use crate::error::PlotError;
use crate::figure::Figure;

/// One quantity of a [`RanksFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RankedQuantity {
    /// Name, for example `τ_{s}`.
    pub name: String,
    /// Share of the ranks not above each level, less the level.
    pub difference: Vec<f64>,
    /// Probability that uniform ranks stray as far, 0 to 1 (NaN if unknown: not shown).
    pub p_value: f64,
}

/// Empirical distribution of the ranks less the uniform one, a panel per quantity.
///
/// With ranks r_i in \[0, 1\] of n data sets the curve is F(u) − u, F(u) = #{r_i <= u}/n. It stays inside the band if the
/// sampler is right (Säilynoja, Bürkner and Vehtari 2022, doi:10.1007/s11222-022-10090-6).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RanksFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Levels u at which all curves are given, increasing within 0 to 1.
    pub level: Vec<f64>,
    /// Simultaneous 95 % band of the difference for uniform ranks; may be empty.
    pub band95: Band,
    /// The quantities, up to 24.
    pub quantities: Vec<RankedQuantity>,
}

/// More panels than this do not fit on a page.
const MOST_QUANTITIES: usize = 24;

impl Figure for RanksFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("ranks");
        columns.at_most("quantities", self.quantities.len(), MOST_QUANTITIES)?;
        let each = (self.level.len(), "level");
        columns.allow_band("band95", &self.band95, each)?;
        for q in &self.quantities {
            columns.need(&format!("difference of {}", q.name), &q.difference, each)?;
        }
        let (pen, grey) = (Role::Posterior.pen(), GREY.mix(0.3));
        let entries = [
            ("ranks of the truth", Swatch::Line(pen)),
            ("95 % band of uniform ranks", Swatch::Band(grey)),
        ];
        let top = header(page, &self.title, &entries)?;

        // One height for all panels, and as far down as up.
        let differences = self.quantities.iter().flat_map(|q| &q.difference).copied();
        let drawn = differences.chain(self.band95.bounds()).filter(|v| v.is_finite());
        let reach = drawn.fold(0.0, |reach: f64, v| reach.max(v.abs()));
        let x = Axis::holding("rank u", "", Scale::Linear, [0.0, 1.0], 0.0);
        let y = Axis::holding("F(u) − u", "", Scale::Linear, [-reach, reach], 0.05);
        let (across, height) = page.of_width((2, 62.0), (3, 90.0));
        let specs = self.quantities.iter().enumerate().map(|(place, q)| {
            let known = (0.0..=1.0).contains(&q.p_value);
            let p = if known { format!(" (p = {:.2})", q.p_value) } else { String::new() };
            let spec = Spec::new(x.clone(), y.clone()).y_labels(place % across == 0);
            spec.named(q.name.clone(), p)
        });
        let panels = layout(page, top, 10.0, &grid_of(across, height, specs.collect()))?;
        for (panel, q) in panels.iter().zip(&self.quantities) {
            panel.band(&self.level, &self.band95, grey)?;
            panel.across(0.0, Pen::solid(GREY, 0.5))?;
            panel.line(&self.level, &q.difference, pen)?;
        }
        Ok(())
    }
}
