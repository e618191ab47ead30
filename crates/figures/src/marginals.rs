//! Marginal densities of several posteriors over the same parameters.

use crate::columns::Columns;
use crate::density::{self, Bins};
use crate::drawing::{Axis, Page, Role, Row, Scale, Spec, Swatch, header, layout, row};
use crate::error::PlotError;
use crate::figure::Figure;

/// One parameter of a [`MarginalsFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MarginalsParameter {
    /// Symbol, for example `C_{1}`.
    pub symbol: String,
    /// Unit, for example `Pa^{-1} s^{-1}`; empty for a pure number.
    pub unit: String,
    /// Whether the draws are log10 of the parameter; ticks are then labelled with the parameter itself.
    pub log10: bool,
    /// Equally weighted draws of each posterior, in the coordinate of the axis; none of one that has not the parameter.
    pub draws: Vec<Vec<f64>>,
}

/// Marginal densities of up to eight posteriors, a panel for each of up to 24 parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MarginalsFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Names of the posteriors.
    pub names: Vec<String>,
    /// The parameters.
    pub parameters: Vec<MarginalsParameter>,
}

/// More panels than this do not fit on a page.
const MOST_PARAMETERS: usize = 24;
/// More posteriors than this cannot be told apart.
const MOST_NAMES: usize = 8;
/// Bins of a density.
const BINS: usize = 160;

impl Figure for MarginalsFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("marginals");
        columns.at_most("parameters", self.parameters.len(), MOST_PARAMETERS)?;
        columns.at_most("names", self.names.len(), MOST_NAMES)?;
        for p in &self.parameters {
            columns.at_most("posteriors", p.draws.len(), self.names.len())?;
        }
        let entries = self.names.iter().enumerate();
        let entries: Vec<_> = entries
            .map(|(place, name)| (name.as_str(), Swatch::Line(Role::Series(place).pen())))
            .collect();
        let top = header(page, &self.title, &entries)?;
        let prepared: Vec<(Axis, Vec<Vec<f64>>)> = self.parameters.iter().map(densities).collect();
        let specs: Vec<Spec> = prepared
            .iter()
            .map(|(axis, densities)| {
                let highest = densities.iter().flatten().copied().fold(0.0, f64::max);
                let height = Axis::holding("", "", Scale::Linear, [0.0, highest * 1.06], 0.0);
                Spec::new(axis.clone(), height).bare()
            })
            .collect();
        let (across, height) = page.of_width((2, 70.0), (3, 95.0));
        let rows: Vec<Row> = specs
            .chunks(across)
            .map(|specs| {
                let (height, mut cells) = row(height, specs.to_vec());
                cells.resize(across.min(prepared.len()), None);
                (height, cells)
            })
            .collect();
        for (panel, (axis, densities)) in layout(page, top, 10.0, &rows)?.iter().zip(&prepared) {
            let bins = bins(axis);
            let xs: Vec<f64> = (0..bins.count).map(|bin| bins.centre(bin)).collect();
            for (place, density) in densities.iter().enumerate() {
                panel.line(&xs[..density.len()], density, Role::Series(place).pen())?;
            }
        }
        Ok(())
    }
}

fn bins(axis: &Axis) -> Bins {
    let support = (f64::NEG_INFINITY, f64::INFINITY);
    Bins { low: axis.low, high: axis.high, count: BINS, support }
}

/// An axis that holds what each posterior has within 99.8 %, and the densities along it; empty for one without draws.
fn densities(p: &MarginalsParameter) -> (Axis, Vec<Vec<f64>>) {
    let scale = if p.log10 { Scale::Exponent } else { Scale::Linear };
    let ends = p.draws.iter().flat_map(|draws| {
        let mut sorted: Vec<(f64, f64)> =
            draws.iter().filter(|x| x.abs() <= 1e300).map(|x| (*x, 1.0)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        [0.001, 0.999].map(|q| density::quantile_sorted(&sorted, q))
    });
    let axis = Axis::holding(&p.symbol, &p.unit, scale, ends, 0.1);
    let bins = bins(&axis);
    let of = |draws: &Vec<f64>| {
        if draws.is_empty() {
            return Vec::new();
        }
        // As in the corner plot.
        let bandwidth = 1.4 * density::bandwidth(draws, |_| 1.0, 1.0);
        density::marginal(&bins, draws, |_| 1.0, bandwidth)
    };
    let densities = p.draws.iter().map(of).collect();
    (axis, densities)
}
