//! Recursive Bayes: what is known of each parameter after each observation.

use super::axis::{Axis, Scale};
use super::drawing::Drawing;
use super::header::{Swatch, header};
use super::palette::Marker;
use super::panel::{Panel, Spec, layout};
use super::{Band, Columns, PlotError, Role, Width};

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
    /// Central 95 % interval after each observation.
    pub interval95: Band,
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
    /// The parameters, up to five.
    pub parameters: Vec<RecursionParameter>,
    /// Effective sample size after each observation.
    pub ess: Vec<f64>,
}

/// More rows than this do not fit on a page.
const MOST_PARAMETERS: usize = 8;

impl RecursionFigure {
    pub(super) fn draw(&self, width: Width) -> Result<Drawing, PlotError> {
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
                &format!("interval95 of {}", p.symbol),
                &p.interval95,
                n,
                "observation",
            )?;
        }
        columns.allow("ess", &self.ess, n, "observation")?;

        let ink = Role::Posterior.ink();
        let (light, dark) = (ink.with_opacity(0.2), ink.with_opacity(0.4));
        let mut drawing = Drawing::new(width);
        let mut entries = vec![
            ("posterior median".to_owned(), Swatch::Line(Role::Posterior.pen())),
            ("50 %".to_owned(), Swatch::Band(ink.with_opacity(0.52))),
            ("95 %".to_owned(), Swatch::Band(light)),
        ];
        if self.parameters.iter().any(|p| p.paper.is_some()) {
            entries.push(("paper".to_owned(), Swatch::Line(Role::Paper.pen())));
        }
        let top = header(&mut drawing, &self.title, &entries);

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
                    .chain(&p.interval95.lower)
                    .chain(&p.interval95.upper)
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
        let (columns, height) = match width {
            Width::Column => (1, 62.0),
            Width::Full => (2, 100.0),
        };
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
            layout(&mut drawing, top, 10.0, &rows).into_iter().flatten().flatten().collect();
        for (panel, p) in panels.iter().zip(&self.parameters) {
            panel.band(
                &mut drawing,
                &self.control,
                &p.interval95.lower,
                &p.interval95.upper,
                light,
            );
            panel.band(&mut drawing, &self.control, &p.interval50.lower, &p.interval50.upper, dark);
            panel.line(&mut drawing, &self.control, &p.median, Role::Posterior.pen());
            if n <= 60 {
                panel.markers(
                    &mut drawing,
                    &self.control,
                    &p.median,
                    Marker::Circle,
                    1.2,
                    ink,
                    None,
                );
            }
            if let Some(paper) = p.paper {
                panel.across(&mut drawing, paper, Role::Paper.pen());
            }
        }
        if let Some(panel) = panels.get(self.parameters.len()) {
            panel.line(&mut drawing, &self.control, &self.ess, Role::Posterior.pen());
            if n <= 60 {
                panel.markers(
                    &mut drawing,
                    &self.control,
                    &self.ess,
                    Marker::Circle,
                    1.2,
                    ink,
                    None,
                );
            }
        }
        Ok(drawing)
    }
}
