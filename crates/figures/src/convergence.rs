//! Convergence of the sampler, stage by stage.

use crate::columns::Band;
use crate::drawing::{Axis, BLACK, Look, Marker, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{grid_of, header, layout, row};
use crate::error::PlotError;
use crate::figure::Figure;

/// One stage of the sampler.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ConvergenceStage {
    /// Simulations spent so far, this stage included.
    pub simulations: f64,
    /// Tempering exponent, 0 to 1.
    pub beta: f64,
    /// Effective sample size of the pool.
    pub ess: f64,
    /// Log evidence (natural logarithm).
    pub log_evidence: f64,
    /// Standard error of the log evidence (NaN if unknown).
    pub log_evidence_error: f64,
    /// Components of the mixture that proposed.
    pub components: f64,
    /// Pareto k-hat of the weights (NaN if unknown).
    pub k_hat: f64,
}

/// Tempering exponent, effective sample size, log evidence, components and k-hat per stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConvergenceFigure {
    /// Heading; empty for none.
    pub title: String,
    /// The stages in order.
    pub stages: Vec<ConvergenceStage>,
    /// k-hat above which the weights are not reliable (0.7), drawn as a line.
    pub k_hat_limit: f64,
    /// k-hat of the result, which is the worst of the weights and of the parameters' moments.
    pub k_hat_of_result: Option<f64>,
    /// Effective sample size asked for, drawn as a line.
    pub ess_target: Option<f64>,
}

impl Figure for ConvergenceFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let column =
            |f: fn(&ConvergenceStage) -> f64| -> Vec<f64> { self.stages.iter().map(f).collect() };
        let spent = column(|s| s.simulations);
        let log_z = column(|s| s.log_evidence);
        let errors = Band {
            lower: column(|s| s.log_evidence - s.log_evidence_error),
            upper: column(|s| s.log_evidence + s.log_evidence_error),
        };
        let pen = Pen::solid(Role::Posterior.ink(), 1.1);
        let limit = Pen::dashed(BLACK, 0.7, &[2.0, 1.6]);
        let of_result = Look::filled(Marker::Diamond, 2.0, Role::Map.ink());
        let mut entries = vec![
            ("after each stage", Swatch::LineAndPoint(pen, Marker::Circle)),
            ("limit or target", Swatch::Line(limit)),
        ];
        if self.k_hat_of_result.is_some() {
            entries.push(("k\u{302} of the result", Swatch::Point(of_result)));
        }
        let top = header(page, &self.title, &entries)?;

        // Name, scale, values, value of the line across (NaN for none), and what else the axis holds.
        let target = self.ess_target.unwrap_or(f64::NAN);
        let curves = [
            ("log Z", Scale::Linear, log_z, f64::NAN, errors.bounds().collect()),
            ("ESS", Scale::Log, column(|s| s.ess), target, vec![]),
            ("tempering β", Scale::Linear, column(|s| s.beta), 1.0, vec![0.0]),
            (
                "k\u{302}",
                Scale::Linear,
                column(|s| s.k_hat),
                self.k_hat_limit,
                [0.0].into_iter().chain(self.k_hat_of_result).collect(),
            ),
            ("components", Scale::Count, column(|s| s.components), f64::NAN, vec![0.0]),
        ];
        let x = Axis::holding("simulations", "", Scale::Linear, spent.iter().copied(), 0.03)
            .starting_at(0.0);
        let specs = curves.iter().map(|(name, scale, values, line, others)| {
            let values = values.iter().chain(others).copied().chain([*line]);
            Spec::new(x.clone(), Axis::holding(name, "", *scale, values, 0.08))
        });
        let specs: Vec<Spec> = specs.collect();
        // One below the other in a column; on a page two and, below them, three.
        let rows = page.of_width(
            grid_of(1, 52.0, specs.clone()),
            vec![row(95.0, specs[..2].to_vec()), row(95.0, specs[2..].to_vec())],
        );
        let radius = if spent.len() <= 60 { 1.6 } else { 0.6 };
        let look = Look::filled(Marker::Circle, radius, pen.ink);
        let panels = layout(page, top, 10.0, &rows)?;
        for (place, (panel, (_, _, values, line, _))) in panels.iter().zip(&curves).enumerate() {
            panel.across(*line, limit)?;
            if place == 0 {
                panel.bars(&spent, &errors.lower, &errors.upper, Pen::solid(pen.ink, 0.9))?;
            }
            panel.line(&spent, values, pen)?;
            panel.markers(&spent, values, look)?;
            if let (3, Some(k_hat), Some(last)) = (place, self.k_hat_of_result, spent.last()) {
                panel.mark(*last, k_hat, of_result)?;
            }
        }
        Ok(())
    }
}
