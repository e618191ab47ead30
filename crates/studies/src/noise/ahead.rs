//! The last third of each curve, predicted from the first two thirds.

use std::path::Path;

use smc_calib::{Likelihood, Noise, NoiseShape, Posterior, Simulator as _, normal};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use super::models::models;
use crate::args::NoiseArgs;
use crate::pair::{Calibration, settings};
use crate::report::{Report, Table};

/// Draws of the posterior that predictions are mixtures of.
const DRAWS: usize = 2000;

const TEXT: &str = "\
The first two thirds of the rows of each material are calibrated (distances and quadrature nodes know nothing of the rest), and the
others predicted: for every draw of the posterior the curve, and the error with what the residuals say of it. Log score: sum over the
predicted rows of the log density of each, given the fitted rows alone; larger is better. Coverage: rows inside the
equal-tailed 90 % interval. Width: mean width of that interval in a/R. Bias: mean of measured minus median predicted value. Rows of
one curve are not independent: a coverage of 15 rows says little.
";

pub(crate) fn run(args: &NoiseArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::part(out, "prediction", &args.command("prediction"))?;
    let mut table = Table::new(&[
        "material",
        "noise",
        "rows fitted",
        "rows predicted",
        "log score",
        "90 % coverage",
        "width",
        "bias",
    ]);
    for material in Material::ALL {
        for (name, noise) in models() {
            table.push(row(material, name, &noise, args.samples.max(16_384))?);
        }
    }
    report.table(&table)?;
    let text = format!("{} simulations.\n{TEXT}\n{}", args.samples.max(16_384), table.markdown());
    Ok(report.page("Prediction of the last third", &text)?)
}

/// Mixture of normal distributions.
struct Mixture(Vec<(f64, f64, f64)>);

impl Mixture {
    fn density(&self, at: f64) -> f64 {
        self.0.iter().map(|(p, m, sd)| p * normal::ln_density((at - m) / sd).exp() / sd).sum()
    }

    fn below(&self, at: f64) -> f64 {
        self.0.iter().map(|(p, m, sd)| p * normal::cdf((at - m) / sd)).sum()
    }

    /// By bisection.
    fn quantile(&self, probability: f64) -> f64 {
        let (mut low, mut high) = (-100.0, 100.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.below(middle) < probability { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

fn row(
    material: Material,
    name: &str,
    noise: &Noise,
    samples: usize,
) -> Result<Vec<String>, Failure> {
    let whole = Calibration::under(material, noise)?;
    let rows = whole.observations.len();
    let fitted = 2 * rows / 3;
    let later = whole.observations.control()[fitted..].to_vec();
    let values = whole.observations.values()[fitted..].to_vec();
    let first = whole.first(fitted)?;
    let posterior = first.sampled(&settings(samples, 1)).map_err(RunError::new)?;
    let mixtures = mixtures(&first, &posterior, &later)?;
    let (mut score, mut inside, mut width, mut bias) = (0.0, 0, 0.0, 0.0);
    let count = values.len() as f64;
    for (mixture, value) in mixtures.iter().zip(&values) {
        score += mixture.density(*value).ln();
        let [low, median, high] = [0.05, 0.5, 0.95].map(|p| mixture.quantile(p));
        inside += usize::from((low..=high).contains(value));
        width += (high - low) / count;
        bias += (value - median) / count;
    }
    Ok(vec![
        material.title().to_owned(),
        name.to_owned(),
        fitted.to_string(),
        values.len().to_string(),
        format!("{score:.2}"),
        format!("{inside} of {}", values.len()),
        format!("{width:.3}"),
        format!("{bias:+.3}"),
    ])
}

/// What is predicted at every later time.
fn mixtures(
    first: &Calibration,
    posterior: &Posterior,
    later: &[f64],
) -> Result<Vec<Mixture>, Failure> {
    let ahead = first.model.at_times(later.to_vec());
    let likelihood: &Likelihood = &first.likelihood;
    let mut mixtures: Vec<Mixture> = later.iter().map(|_| Mixture(Vec::new())).collect();
    let (mut curve, mut next) = (vec![0.0; first.observations.len()], vec![0.0; later.len()]);
    for k in 0..DRAWS {
        let draw = &posterior.draws[k * posterior.draws.len() / DRAWS];
        let theta = posterior.theta(draw);
        first.model.simulate(theta, &mut curve).map_err(RunError::new)?;
        ahead.simulate(theta, &mut next).map_err(RunError::new)?;
        let Some(noise) = draw.noise() else { continue };
        let errors = likelihood.errors_at(&noise, &curve, later);
        let (share, factor) = match noise.shape {
            Some(NoiseShape::Robust { outlier_share, outlier_width }) => {
                (outlier_share, outlier_width)
            }
            _ => (0.0, 1.0),
        };
        for ((mixture, value), [mean, sd]) in mixtures.iter_mut().zip(&next).zip(errors) {
            let each = 1.0 / DRAWS as f64;
            mixture.0.push((each * (1.0 - share), value + mean, sd));
            if share > 0.0 {
                mixture.0.push((each * share, value + mean, sd * factor));
            }
        }
    }
    Ok(mixtures)
}
