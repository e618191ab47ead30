//! A bed over time: density, coordination and contact ratios.

use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Pen};
use super::{Columns, PlotError, Role};

/// What a bed does over time. Columns are as long as `time_s`.
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
    /// Contact ratio that 10 % of the contacts are below.
    pub contact_ratio_10: Vec<f64>,
    /// Contact ratio that 90 % of the contacts are below.
    pub contact_ratio_90: Vec<f64>,
    /// Where heating began \[s\].
    pub heated_from_s: Option<f64>,
    /// Where the model ended \[s\].
    pub model_ends_s: Option<f64>,
}

impl SeriesFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("series");
        for (field, values) in [
            ("relative_density", &self.relative_density),
            ("coordination", &self.coordination),
            ("mean_contact_ratio", &self.mean_contact_ratio),
            ("contact_ratio_10", &self.contact_ratio_10),
            ("contact_ratio_90", &self.contact_ratio_90),
        ] {
            columns.need(field, values, self.time_s.len(), "time")?;
        }
        let pen = Role::Posterior.pen();
        let heat = Pen::dashed(Role::Map.ink(), 0.8, &[3.0, 1.5]);
        let ends = Pen::dashed(GREY, 0.8, &[1.2, 1.4]);
        let spread = Role::Posterior.ink().mix(0.25);
        let mut entries = vec![
            ("mean".to_owned(), Swatch::Line(pen)),
            ("10 to 90 % of the contacts".to_owned(), Swatch::Band(spread)),
        ];
        if self.heated_from_s.is_some() {
            entries.push(("heated".to_owned(), Swatch::Line(heat)));
        }
        if self.model_ends_s.is_some() {
            entries.push(("necks meet: the model ends".to_owned(), Swatch::Line(ends)));
        }
        let top = header(page, &self.title, &entries)?;
        let times = || {
            Axis::holding("time t", "s", Scale::Linear, self.time_s.iter().copied(), 0.02)
                .starting_at(self.time_s.first().copied().unwrap_or(0.0))
        };
        let with_density = self.relative_density.iter().any(|density| density.is_finite());
        let mut panels = Vec::new();
        if with_density {
            let density = self.relative_density.iter().copied();
            panels.push(Axis::holding("relative density", "", Scale::Linear, density, 0.08));
        }
        let ratios = self.contact_ratio_10.iter().chain(&self.contact_ratio_90).copied();
        panels.push(
            Axis::holding("contact ratio a/R", "", Scale::Linear, ratios.chain([0.0]), 0.06)
                .starting_at(0.0),
        );
        let coordination = self.coordination.iter().copied().chain([0.0]);
        panels.push(
            Axis::holding("contacts per particle", "", Scale::Linear, coordination, 0.08)
                .starting_at(0.0),
        );
        let height = page.of_width(70.0, 110.0);
        let last = panels.len() - 1;
        let rows: Vec<(f32, Vec<Option<Spec>>)> = panels
            .into_iter()
            .enumerate()
            .map(|(row, y)| (height, vec![Some(Spec::new(times(), y).x_labels(row == last))]))
            .collect();
        let laid_out: Vec<_> =
            layout(page, top, 8.0, &rows)?.into_iter().flatten().flatten().collect();
        let density = with_density.then_some(&self.relative_density);
        let curves = density.into_iter().chain([&self.mean_contact_ratio, &self.coordination]);
        for (panel, curve) in laid_out.iter().zip(curves) {
            for (at, pen) in [(self.heated_from_s, heat), (self.model_ends_s, ends)] {
                at.map_or(Ok(()), |at| panel.upright(at, pen))?;
            }
            if std::ptr::eq(curve, &self.mean_contact_ratio) {
                panel.band(&self.time_s, &self.contact_ratio_10, &self.contact_ratio_90, spread)?;
            }
            panel.line(&self.time_s, curve, pen)?;
        }
        Ok(())
    }
}
