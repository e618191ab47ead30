//! Recursive Bayes: what is known of each parameter after each observation.
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::Marker;
use super::panel::Panel;
use super::{Band, Columns, PlotError, Role};

/// One parameter of a [`RecursionFigure`], after each observation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionParameter {
    /// Symbol, for example `τ_{s}`.
    pub symbol: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// True if all values are log10 of the parameter: the axis is then labelled with the parameter itself.
    pub log10: bool,
    /// Posterior median after each observation.
    pub median: Vec<f64>,
    /// Central 50 % interval after each observation.
    pub interval50: Band,
    /// Central 90 % interval after each observation.
    pub interval90: Band,
    /// The paper's value.
    pub paper: Option<f64>,
}

/// Medians and intervals of the parameters and the effective sample size against the control value (time).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the control, for example `time t`.
    pub control_name: String,
    /// Unit of the control, for example `s`.
    pub control_unit: String,
    /// Control value of each observation, in the order of assimilation.
    pub control: Vec<f64>,
    /// Logarithmic control axis.
    pub log_control: bool,
    /// The parameters, up to eight.
    pub parameters: Vec<RecursionParameter>,
    /// Effective sample size after each observation.
    pub ess: Vec<f64>,
}

/// More rows than this do not fit on a page.
const MOST_PARAMETERS: usize = 8;

impl RecursionFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("recursion");
        columns.at_most("parameters", self.parameters.len(), MOST_PARAMETERS)?;
        let n = self.control.len();
        for p in &self.parameters {
            columns.need(&format!("median of {}", p.symbol), &p.median, n, "observation")?;
            columns.allow_band(
                &format!("interval50 of {}", p.symbol),
                &p.interval50,
                n,
                "observation",
            )?;
            columns.allow_band(
                &format!("interval90 of {}", p.symbol),
                &p.interval90,
                n,
                "observation",
            )?;
        }
        columns.allow("ess", &self.ess, n, "observation")?;

        let ink = Role::Posterior.ink();
        let (light, dark) = (ink.mix(0.2), ink.mix(0.4));
        let mut entries = vec![
            ("posterior median".to_owned(), Swatch::Line(Role::Posterior.pen())),
            ("50 %".to_owned(), Swatch::Band(ink.mix(0.52))),
            ("90 %".to_owned(), Swatch::Band(light)),
        ];
        if self.parameters.iter().any(|p| p.paper.is_some()) {
            entries.push(("paper".to_owned(), Swatch::Line(Role::Paper.pen())));
        }
        let top = header(page, &self.title, &entries)?;

        let scale = if self.log_control { Scale::Log } else { Scale::Linear };
        let x = Axis::holding(
            &self.control_name,
            &self.control_unit,
            scale,
            self.control.iter().copied(),
            0.02,
        );
        let mut specs: Vec<Spec> = self
            .parameters
            .iter()
            .map(|p| {
                let scale = if p.log10 { Scale::Exponent } else { Scale::Linear };
                let values = p
                    .median
                    .iter()
                    .chain(&p.interval90.lower)
                    .chain(&p.interval90.upper)
                    .chain(&p.paper);
                Spec::new(
                    x.clone(),
                    Axis::holding(&p.symbol, &p.unit, scale, values.copied(), 0.05),
                )
            })
            .collect();
        if !self.ess.is_empty() {
            specs.push(Spec::new(
                x,
                Axis::holding("ESS", "", Scale::Log, self.ess.iter().copied(), 0.08),
            ));
        }
        let (columns, height) = page.of_width((1, 62.0), (2, 100.0));
        let columns = columns.min(specs.len().max(1));
        let last_row_starts = specs.len().saturating_sub(columns);
        let cells: Vec<Option<Spec>> = specs
            .into_iter()
            .enumerate()
            .map(|(i, spec)| Some(spec.x_labels(i >= last_row_starts)))
            .collect();
        let rows: Vec<(f32, Vec<Option<Spec>>)> = cells
            .chunks(columns)
            .map(|row| {
                let mut row = row.to_vec();
                row.resize(columns, None);
                (height, row)
            })
            .collect();
        let panels: Vec<Panel> =
            layout(page, top, 10.0, &rows)?.into_iter().flatten().flatten().collect();
        for (panel, p) in panels.iter().zip(&self.parameters) {
            panel.band(&self.control, &p.interval90.lower, &p.interval90.upper, light)?;
            panel.band(&self.control, &p.interval50.lower, &p.interval50.upper, dark)?;
            panel.line(&self.control, &p.median, Role::Posterior.pen())?;
            if n <= 60 {
                panel.markers(&self.control, &p.median, Look::filled(Marker::Circle, 1.2, ink))?;
            }
            if let Some(paper) = p.paper {
                panel.across(paper, Role::Paper.pen())?;
            }
        }
        if let Some(panel) = panels.get(self.parameters.len()) {
            panel.line(&self.control, &self.ess, Role::Posterior.pen())?;
            if n <= 60 {
                panel.markers(&self.control, &self.ess, Look::filled(Marker::Circle, 1.2, ink))?;
            }
        }
        Ok(())
    }
}
