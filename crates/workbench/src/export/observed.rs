//! The observables of a run: their likelihoods, dimensions and noise.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use smc_calib::{Likelihood, NoiseDraw, NoiseShape, ShapeSummary, normal};

use super::groups::{Attributes, Values, Variable, attributes, free_name, units};
use crate::error::{InputError, Mistake};
use crate::plan::ObservablePlan;
use crate::record::{ObservableRecord, Record};
use crate::report::{DrawColumns, length_unit};

/// Random streams of the exports, apart from those of the sampler, which are numbered from 1.
#[derive(Clone, Copy)]
pub(super) enum Stream {
    Order = 0xe1,
    Predictive = 0xe2,
    Prior = 0xe3,
}

pub(super) fn stream(seed: u64, of: Stream, place: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((of as u64) << 56 | place as u64);
    rng
}

/// An observable with the draws of it.
pub(super) struct Observed<'a> {
    pub(super) plan: &'a ObservablePlan,
    pub(super) found: &'a ObservableRecord,
    pub(super) likelihood: Likelihood,
    /// Name of its variables.
    pub(super) name: String,
    /// Name of its dimension.
    pub(super) dim: String,
    /// Places of its values among those of all.
    pub(super) places: std::ops::Range<usize>,
    /// Noise of each exported draw; empty where it is stated row by row.
    pub(super) noise: Vec<NoiseDraw>,
}

/// The observables of a run with their likelihoods, and the noise of the chosen draws.
pub(super) fn observed<'a>(
    record: &'a Record,
    draws: &DrawColumns,
    chosen: &[usize],
) -> Result<Vec<Observed<'a>>, InputError> {
    let several = record.observables().count() > 1;
    let mut taken = ["chain", "draw"].map(str::to_owned).to_vec();
    let label = |(_, found): (_, &ObservableRecord)| free_name(&found.label, &mut taken);
    let names: Vec<String> = record.observables().map(label).collect();
    let mut first = 0;
    let mut all = Vec::new();
    for (place, ((plan, found), name)) in record.observables().zip(names).enumerate() {
        let likelihood = Likelihood::new(&plan.noise, &plan.observations()?)
            .map_err(|error| InputError::new(&plan.table, Mistake::OutOfRange).found(error))?;
        let places = first..first + plan.values.len();
        first = places.end;
        let noise = draws.noise.get(place).filter(|noise| !noise.is_empty());
        let noise = noise.map(|noise| chosen.iter().map(|k| noise[*k]).collect());
        let noise = noise.unwrap_or_default();
        let mut of = Observed { plan, found, likelihood, name, dim: String::new(), places, noise };
        let control = if of.has_control_coordinate() { of.control_name() } else { "row" };
        let named = if several { format!("{}_{control}", of.name) } else { control.to_owned() };
        of.dim = free_name(&named, &mut taken);
        all.push(of);
    }
    Ok(all)
}

/// Sigma, and correlation length and white share of correlated noise, a column for each.
pub(super) fn columns(drawn: &[NoiseDraw]) -> Vec<Vec<f64>> {
    let mut columns = vec![drawn.iter().map(|draw| draw.sigma).collect()];
    let shape = |draw: &NoiseDraw| match draw.shape {
        Some(NoiseShape::Correlated { length, white_share }) => Some([length, white_share]),
        _ => None,
    };
    let shapes: Option<Vec<[f64; 2]>> = drawn.iter().map(shape).collect();
    if let Some(shapes) = shapes {
        columns.extend([0, 1].map(|axis| shapes.iter().map(|one| one[axis]).collect()));
    }
    columns
}

/// A number of [0, 1) as one of (0, 1).
pub(super) fn open(u: f64) -> f64 {
    u.max(f64::EPSILON / 4.0)
}

impl Observed<'_> {
    pub(super) fn control_name(&self) -> &str {
        self.plan.control_column.as_deref().unwrap_or("row")
    }

    /// Whether the control values tell the observations apart.
    pub(super) fn has_control_coordinate(&self) -> bool {
        let rising = self.plan.control.windows(2).all(|pair| pair[0] < pair[1]);
        self.plan.control_column.is_some() && rising
    }

    pub(super) fn coordinate(&self) -> Variable {
        if self.has_control_coordinate() {
            let about = attributes([("units", units(&self.plan.control_unit))]);
            return Variable::coordinate(&self.dim, Values::Real(self.plan.control.clone()), about);
        }
        let rows = (1..=self.plan.values.len() as i64).collect();
        let about = attributes([("long_name", "observation, from 1".into())]);
        Variable::coordinate(&self.dim, Values::Whole(rows), about)
    }

    /// A variable with a value for each draw and observation.
    pub(super) fn variable(&self, values: Vec<f64>, attributes: Attributes) -> Variable {
        let width = self.plan.values.len();
        Variable {
            name: self.name.clone(),
            dims: vec!["chain".to_owned(), "draw".to_owned(), self.dim.clone()],
            shape: vec![1, values.len() / width, width],
            values: Values::Real(values),
            attributes,
        }
    }

    /// Attributes of sigma, correlation length and white share.
    pub(super) fn noise_attributes(&self) -> [Attributes; 3] {
        let about = |long_name: &str, unit: &str| {
            attributes([("units", units(unit)), ("long_name", long_name.into())])
        };
        let length = match self.found.noise_shape {
            Some(ShapeSummary::Correlated { scale, .. }) => length_unit(scale, self.plan),
            _ => "1",
        };
        [
            about("standard deviation of the noise", &self.plan.unit),
            about("correlation length of the noise", length),
            about("share of the noise that is independent", "1"),
        ]
    }

    /// New measurements at the observations in draw `k`.
    pub(super) fn measured_again(&self, k: usize, curve: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
        let noise = self.noise.get(k);
        let errors = match noise {
            Some(noise) => self.likelihood.errors_at(noise, curve, &self.plan.control),
            None => (0..curve.len())
                .map(|i| [0.0, self.likelihood.fixed_sigma(i).unwrap_or(f64::NAN)])
                .collect(),
        };
        let each = curve.iter().zip(errors);
        each.map(|(value, [mean, sd])| {
            let widening = noise.map_or(1.0, |noise| noise.widening(rng.random()));
            value + mean + sd * widening * normal::quantile(open(rng.random()))
        })
        .collect()
    }
}
