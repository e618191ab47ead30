//! Recursive Bayes: knowledge of each parameter after each observation.

use plotters::style::Color as _;

use crate::columns::{Band, Columns};
use crate::drawing::{Axis, Look, Marker, Page, Panel, Role, Scale, Spec, Swatch};
use crate::drawing::{grid_of, header, layout};
use crate::error::{Drawn, PlotError};
use crate::figure::Figure;

/// One parameter of a [`RecursionFigure`], after each observation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionParameter {
    /// Symbol, for example `τ_{s}`.
    pub symbol: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// Whether all values are log10 of the parameter; the axis is then labelled with the parameter itself.
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

/// Medians and intervals of the parameters and the effective sample size over the control value (time).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the control variable, for example `time t`.
    pub control_name: String,
    /// Unit of the control variable, for example `s`.
    pub control_unit: String,
    /// Control value of each observation, in the order of assimilation.
    pub control: Vec<f64>,
    /// Whether the control axis is logarithmic.
    pub log_control: bool,
    /// The parameters, up to eight.
    pub parameters: Vec<RecursionParameter>,
    /// Effective sample size after each observation.
    pub ess: Vec<f64>,
}

/// More parameters than this do not fit on a page.
const MOST_PARAMETERS: usize = 8;
/// Up to so many observations get a marker each.
const FEW: usize = 60;

impl Figure for RecursionFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        self.check()?;
        let ink = Role::Posterior.ink();
        let (light, dark) = (ink.mix(0.2), ink.mix(0.4));
        let mut entries = vec![
            ("posterior median", Swatch::Line(Role::Posterior.pen())),
            ("50 %", Swatch::Band(ink.mix(0.52))),
            ("90 %", Swatch::Band(light)),
        ];
        if self.parameters.iter().any(|p| p.paper.is_some()) {
            entries.push(("paper", Swatch::Line(Role::Paper.pen())));
        }
        let top = header(page, &self.title, &entries)?;
        let (columns, height) = page.of_width((1, 62.0), (2, 100.0));
        let panels = layout(page, top, 10.0, &grid_of(columns, height, self.specs()))?;
        for (panel, p) in panels.iter().zip(&self.parameters) {
            panel.band(&self.control, &p.interval90, light)?;
            panel.band(&self.control, &p.interval50, dark)?;
            self.curve(panel, &p.median)?;
            if let Some(paper) = p.paper {
                panel.across(paper, Role::Paper.pen())?;
            }
        }
        panels.get(self.parameters.len()).map_or(Ok(()), |panel| self.curve(panel, &self.ess))
    }
}

impl RecursionFigure {
    fn check(&self) -> Drawn {
        let columns = Columns("recursion");
        columns.at_most("parameters", self.parameters.len(), MOST_PARAMETERS)?;
        let each = (self.control.len(), "observation");
        for p in &self.parameters {
            let field = |name: &str| format!("{name} of {}", p.symbol);
            columns.need(&field("median"), &p.median, each)?;
            columns.allow_band(&field("interval50"), &p.interval50, each)?;
            columns.allow_band(&field("interval90"), &p.interval90, each)?;
        }
        columns.allow("ess", &self.ess, each)
    }

    /// A panel per parameter, and one of the effective sample size.
    fn specs(&self) -> Vec<Spec> {
        let scale = if self.log_control { Scale::Log } else { Scale::Linear };
        let control = self.control.iter().copied();
        let x = Axis::holding(&self.control_name, &self.control_unit, scale, control, 0.02);
        let mut axes: Vec<Axis> = Vec::new();
        for p in &self.parameters {
            let scale = if p.log10 { Scale::Exponent } else { Scale::Linear };
            let values = p.median.iter().chain(&p.paper).copied().chain(p.interval90.bounds());
            axes.push(Axis::holding(&p.symbol, &p.unit, scale, values, 0.05));
        }
        if !self.ess.is_empty() {
            axes.push(Axis::holding("ESS", "", Scale::Log, self.ess.iter().copied(), 0.08));
        }
        axes.into_iter().map(|y| Spec::new(x.clone(), y)).collect()
    }

    fn curve(&self, panel: &Panel, values: &[f64]) -> Drawn {
        panel.line(&self.control, values, Role::Posterior.pen())?;
        if self.control.len() > FEW {
            return Ok(());
        }
        let look = Look::filled(Marker::Circle, 1.2, Role::Posterior.ink());
        panel.markers(&self.control, values, look)
    }
}
