//! A bed over time: density, coordination and contact ratios.

use plotters::style::Color as _;

use crate::columns::Columns;
use crate::drawing::{Axis, GREY, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{grid_of, header, layout};
use crate::error::PlotError;
use crate::figure::Figure;

/// Density, coordination and contact ratios of a bed. Columns are as long as `time_s`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeriesFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times \[s\].
    pub time_s: Vec<f64>,
    /// Relative density; not drawn where no value is finite.
    pub relative_density: Vec<f64>,
    /// Contacts per particle.
    pub coordination: Vec<f64>,
    /// Mean contact ratio a/R.
    pub mean_contact_ratio: Vec<f64>,
    /// 10 % quantile of the contact ratios.
    pub contact_ratio_10: Vec<f64>,
    /// 90 % quantile of the contact ratios.
    pub contact_ratio_90: Vec<f64>,
    /// Time at which heating began \[s\].
    pub heated_from_s: Option<f64>,
    /// Time at which the pairs ended \[s\]: from there the density is that of closed laws.
    pub pairs_end_s: Option<f64>,
}

impl Figure for SeriesFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("series");
        let each = (self.time_s.len(), "time");
        columns.need("relative_density", &self.relative_density, each)?;
        columns.need("coordination", &self.coordination, each)?;
        columns.need("mean_contact_ratio", &self.mean_contact_ratio, each)?;
        columns.need("contact_ratio_10", &self.contact_ratio_10, each)?;
        columns.need("contact_ratio_90", &self.contact_ratio_90, each)?;

        let pen = Role::Posterior.pen();
        let heat = Pen::dashed(Role::Map.ink(), 0.8, &[3.0, 1.5]);
        let ends = Pen::dashed(GREY, 0.8, &[1.2, 1.4]);
        let spread = Role::Posterior.ink().mix(0.25);
        let mut entries = vec![("mean", Swatch::Line(pen))];
        // A single contact has no spread.
        let deciles = || self.contact_ratio_10.iter().zip(&self.contact_ratio_90);
        if deciles().any(|(lower, upper)| lower < upper) {
            entries.push(("10 to 90 % of the contacts", Swatch::Band(spread)));
        }
        if self.heated_from_s.is_some() {
            entries.push(("heated", Swatch::Line(heat)));
        }
        if self.pairs_end_s.is_some() {
            entries.push(("necks meet: the pairs end", Swatch::Line(ends)));
        }
        let top = header(page, &self.title, &entries)?;

        let start = self.time_s.first().copied().unwrap_or(0.0);
        let times = self.time_s.iter().copied();
        let x = Axis::holding("time t", "s", Scale::Linear, times, 0.02).starting_at(start);
        let y =
            |name, values: Vec<f64>, margin| Axis::holding(name, "", Scale::Linear, values, margin);
        let ratios = [&self.contact_ratio_10[..], &self.contact_ratio_90, &[0.0]].concat();
        let coordination = [&self.coordination[..], &[0.0]].concat();
        let mut panels = vec![
            (y("contact ratio a/R", ratios, 0.06).starting_at(0.0), &self.mean_contact_ratio),
            (y("contacts per particle", coordination, 0.08).starting_at(0.0), &self.coordination),
        ];
        if self.relative_density.iter().any(|density| density.is_finite()) {
            let density = &self.relative_density;
            panels.insert(0, (y("relative density", density.clone(), 0.08), density));
        }
        let (axes, curves): (Vec<Axis>, Vec<&Vec<f64>>) = panels.into_iter().unzip();
        let specs = axes.into_iter().map(|y| Spec::new(x.clone(), y)).collect();
        let panels = layout(page, top, 8.0, &grid_of(1, page.of_width(70.0, 110.0), specs))?;
        for (panel, curve) in panels.iter().zip(curves) {
            for (at, pen) in [(self.heated_from_s, heat), (self.pairs_end_s, ends)] {
                at.map_or(Ok(()), |at| panel.upright(at, pen))?;
            }
            if std::ptr::eq(curve, &self.mean_contact_ratio) {
                let (lower, upper) = (&self.contact_ratio_10, &self.contact_ratio_90);
                panel.between(&self.time_s, lower, upper, spread)?;
            }
            panel.line(&self.time_s, curve, pen)?;
        }
        Ok(())
    }
}
