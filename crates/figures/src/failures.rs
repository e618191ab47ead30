//! Failed simulations: where they are, beside the finished ones and the posterior.

use crate::columns::Columns;
use crate::drawing::{Axis, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{grid_of, header, layout};
use crate::error::PlotError;
use crate::figure::Figure;

/// Finished and failed simulations, and the posterior, in bins along one parameter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FailuresFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Symbol of the parameter, for example `τ_{s}`.
    pub symbol: String,
    /// Its unit.
    pub unit: String,
    /// Whether the edges are decimal logarithms.
    pub log10: bool,
    /// Ends of the bins, increasing.
    pub edges: Vec<f64>,
    /// Finished simulations in each bin.
    pub finished: Vec<f64>,
    /// Failed simulations in each bin.
    pub failed: Vec<f64>,
    /// Share of the posterior in each bin, 0 to 1.
    pub posterior: Vec<f64>,
}

impl Figure for FailuresFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("failures");
        let each = (self.edges.len().saturating_sub(1), "bin");
        columns.need("finished", &self.finished, each)?;
        columns.need("failed", &self.failed, each)?;
        columns.need("posterior", &self.posterior, each)?;
        let (done, failed) = (Pen::solid(Role::Data.ink(), 0.9), Role::Map.pen());
        let posterior = Role::Posterior.pen();
        let entries = [
            ("finished", Swatch::Line(done)),
            ("failed", Swatch::Line(failed)),
            ("posterior", Swatch::Line(posterior)),
        ];
        let top = header(page, &self.title, &entries)?;
        let scale = if self.log10 { Scale::Exponent } else { Scale::Linear };
        let x = Axis::holding(&self.symbol, &self.unit, scale, self.edges.iter().copied(), 0.02);
        let counts = self.finished.iter().chain(&self.failed).copied().chain([0.0]);
        let counts = Axis::holding("simulations", "", Scale::Linear, counts, 0.05);
        let shares = self.posterior.iter().copied().chain([0.0]);
        let shares = Axis::holding("share of posterior", "", Scale::Linear, shares, 0.05);
        let height = page.of_width(70.0, 90.0);
        let specs = vec![Spec::new(x.clone(), counts), Spec::new(x, shares)];
        let panels = layout(page, top, 10.0, &grid_of(1, height, specs))?;
        let [simulations, mass] = panels.as_slice() else { return Ok(()) };
        let (xs, ys) = steps(&self.edges, &self.finished);
        simulations.line(&xs, &ys, done)?;
        let (xs, ys) = steps(&self.edges, &self.failed);
        simulations.line(&xs, &ys, failed)?;
        let (xs, ys) = steps(&self.edges, &self.posterior);
        mass.line(&xs, &ys, posterior)
    }
}

/// The outline of a histogram.
fn steps(edges: &[f64], heights: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let xs = edges.windows(2).flat_map(|ends| [ends[0], ends[1]]).collect();
    (xs, heights.iter().flat_map(|height| [*height; 2]).collect())
}
