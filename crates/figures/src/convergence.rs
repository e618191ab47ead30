//! Convergence of the sampler, stage by stage.
use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{BLACK, Marker, Pen};
use super::panel::Panel;
use super::{PlotError, Role};

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
    /// k-hat above which weights are not to be trusted (0.7), drawn as a line.
    pub k_hat_limit: f64,
    /// Effective sample size asked for, drawn as a line.
    pub ess_target: Option<f64>,
}

impl ConvergenceFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let column =
            |f: fn(&ConvergenceStage) -> f64| -> Vec<f64> { self.stages.iter().map(f).collect() };
        let spent = column(|s| s.simulations);
        let (evidence, error) = (column(|s| s.log_evidence), column(|s| s.log_evidence_error));
        let lower: Vec<f64> = evidence.iter().zip(&error).map(|(z, e)| z - e).collect();
        let upper: Vec<f64> = evidence.iter().zip(&error).map(|(z, e)| z + e).collect();
        let (beta, ess, k_hat, components) =
            (column(|s| s.beta), column(|s| s.ess), column(|s| s.k_hat), column(|s| s.components));

        let pen = Pen::solid(Role::Posterior.ink(), 1.1);
        let limit = Pen::dashed(BLACK, 0.7, &[2.0, 1.6]);
        let entries = [
            ("after each stage".to_owned(), Swatch::LineAndPoint(pen, Marker::Circle)),
            ("limit or target".to_owned(), Swatch::Line(limit)),
        ];
        let top = header(page, &self.title, &entries)?;

        let x = Axis::holding("simulations", "", Scale::Linear, spent.iter().copied(), 0.03)
            .starting_at(0.0);
        let with = |values: &[f64], more: &[f64]| -> Vec<f64> {
            values.iter().chain(more).copied().collect()
        };
        let spec = |name: &str, scale, values: Vec<f64>| {
            Spec::new(x.clone(), Axis::holding(name, "", scale, values, 0.08))
        };
        let log_z = [evidence.as_slice(), &lower, &upper].concat();
        let specs = [
            spec("log Z", Scale::Linear, log_z),
            spec("ESS", Scale::Log, with(&ess, self.ess_target.as_slice())),
            spec("tempering β", Scale::Linear, with(&beta, &[0.0, 1.0])),
            spec("k\u{302}", Scale::Linear, with(&k_hat, &[0.0, self.k_hat_limit])),
            spec("components", Scale::Count, with(&components, &[0.0])),
        ];
        // One below the other in a column; on a page two and, below them, three.
        let (height, counts): (f32, &[usize]) =
            page.of_width((52.0, &[1, 1, 1, 1, 1]), (95.0, &[2, 3]));
        let mut specs = specs.into_iter();
        let rows: Vec<_> = counts
            .iter()
            .enumerate()
            .map(|(row, &count)| {
                let labelled = count > 1 || row + 1 == counts.len();
                let cells = specs.by_ref().take(count).map(|s| Some(s.x_labels(labelled)));
                (height, cells.collect::<Vec<_>>())
            })
            .collect();
        let panels: Vec<Panel> =
            layout(page, top, 10.0, &rows)?.into_iter().flatten().flatten().collect();
        let [evidence_panel, ess_panel, beta_panel, k_panel, components_panel] = panels.as_slice()
        else {
            return Ok(());
        };

        beta_panel.across(1.0, limit)?;
        k_panel.across(self.k_hat_limit, limit)?;
        if let Some(target) = self.ess_target {
            ess_panel.across(target, limit)?;
        }
        evidence_panel.bars(&spent, &lower, &upper, Pen::solid(pen.ink, 0.9))?;
        let curves = [
            (beta_panel, &beta),
            (ess_panel, &ess),
            (evidence_panel, &evidence),
            (k_panel, &k_hat),
            (components_panel, &components),
        ];
        for (panel, values) in curves {
            panel.line(&spent, values, pen)?;
            panel.markers(
                &spent,
                values,
                Look::filled(Marker::Circle, if spent.len() <= 60 { 1.6 } else { 0.6 }, pen.ink),
            )?;
        }
        Ok(())
    }
}
