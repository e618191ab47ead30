//! Weights that are held to integrals that are known better than by them.
//!
//! Where some integrals are known better than the pooled weights know them ([`crate::control`]), the weights are held
//! to them: `w (1 + w^a lambda phi)`, with the lambda for which every sum of `w phi` is what is known (calibration
//! of weights: J.-C. Deville, C.-E. Saerndal, J. Am. Stat. Assoc. 87 (1992) 376). An estimate then has the error of the
//! known integrals in the part of it that they explain, and that of the pool in the rest. With a = 1 it changes the
//! weights least; where that would take a single large weight most of the change, `w exp(w^a lambda phi)` with a = 1/2
//! spreads it, and keeps every weight positive.

#[cfg(test)]
mod tests;

use super::moved::{Axis, Moments, moved, reach};
use crate::cholesky::{add_multiple, cholesky, solve};
use std::ops::RangeInclusive;

/// Least and largest relative change of a weight.
const CHANGES: RangeInclusive<f64> = -0.8..=2.0;
/// Least and largest factor on a weight that is tilted as far as it takes.
const TILTS: RangeInclusive<f64> = 0.02..=50.0;
/// Parts of their shares that moments are held to, in this order; least share of the evidence.
const PARTS: [f64; 5] = [1.0, 0.8, 0.6, 0.4, 0.2];
const LEAST_SHARE: f64 = 2.0 / 3.0;
/// Most moves of samples, after each of which some may stop at the end of the prior.
const MOVES: usize = 20;
/// Most steps of Newton's method to the tilt, most halvings of each, and the relative gap at which it is found.
const STEPS: usize = 50;
const HALVINGS: i32 = 30;
const GAP: f64 = 1e-11;

/// The quantity that the relative change of a weight is proportional to.
#[derive(Clone, Copy)]
pub(super) enum Spread {
    /// The weight.
    Weight,
    /// Its root.
    Root,
    /// Its root, and the weight may change further.
    Far,
    /// One: all weights change alike.
    One,
}

impl Spread {
    pub(super) fn of(self, weight: f64) -> f64 {
        match self {
            Self::Weight => weight,
            Self::Root | Self::Far => weight.sqrt(),
            Self::One => 1.0,
        }
    }
}

/// Integrals of the posterior density times 1, x_j and x_i x_j by every sub-net of the final stage.
#[derive(Default)]
pub(crate) struct Integrals {
    /// Sub-net by sub-net; in units of the exponential of the scale that the weights were given with.
    pub of_sub_nets: Vec<f64>,
    /// Per sample of the pool: 1, x_j, x_i x_j of the standardised coordinates.
    pub features: Vec<f64>,
    /// Share of each that is taken from here, the rest from sums over the samples: the less these know it, the more.
    pub shares: Vec<f64>,
    /// Errors of all of them by draws of what is not known of the surrogate, draw by draw: small ones that make the log evidence and ratios
    /// to it off by as much as draws are. Empty where that is not asked.
    pub errors: Vec<f64>,
    /// What each coordinate is standardised by; empty where samples shall stay where they are.
    pub axes: Vec<Axis>,
    /// Levels of each coordinate, ascending: for each one a further integral, of what lies below it. Empty where intervals are those
    /// of the samples.
    pub levels: Vec<Vec<f64>>,
}

/// Integrals that the weights are held to.
pub(super) struct Known {
    /// Number of integrals.
    pub p: usize,
    /// Their values, and the functions that are integrated, as [`Integrals`] has them.
    pub of_sub_nets: Vec<f64>,
    pub features: Vec<f64>,
    /// Errors of their mean over the sub-nets, as [`Integrals`] has them.
    pub errors: Vec<f64>,
    /// Sums of weight times feature over the samples of every sub-net.
    pub of_pool: Vec<f64>,
    /// The quantity that changes of weights are proportional to.
    pub spread: Spread,
    /// Cholesky factor of the sum of products of features, weighted by weight times spread.
    pub factor: Vec<f64>,
    /// Whether weights might change as far as it takes.
    pub far: bool,
    /// Axes of the coordinates, where the features are those of moved samples.
    pub moved: Vec<Axis>,
    /// Whether all that is known is held to, not a part of it; of moved samples but for correlations, see [`Moments::to`].
    pub whole: bool,
}

impl Known {
    /// Variance over the draws of the sum of integrals with these factors.
    pub(super) fn variance_unknown(&self, factors: &[f64]) -> f64 {
        let squares = self.errors.chunks_exact(self.p).map(|errors| {
            let sum: f64 = errors.iter().zip(factors).map(|(e, f)| e * f).sum();
            sum * sum
        });
        // The mean of the draws is taken out of them.
        let draws = self.errors.len() / self.p;
        if draws < 2 { 0.0 } else { squares.sum::<f64>() / (draws - 1) as f64 }
    }
}

impl Integrals {
    /// They and their errors, moments with a part of their shares.
    pub(super) fn partly(&self, by_samples: &[f64], part: f64) -> [Vec<f64>; 2] {
        let Self { of_sub_nets, shares, errors, .. } = self;
        [
            partly(of_sub_nets, by_samples, shares, part),
            partly_off(errors, by_samples, shares, part),
        ]
    }
}

/// Weights of all samples, and the sub-net of each.
pub(super) struct Samples<'a> {
    pub weights: &'a [f64],
    pub label: &'a [u32],
    pub replicates: usize,
}

/// Weights that are held to integrals.
struct Held {
    spread: Spread,
    weights: Vec<f64>,
    /// Of these weights, as [`Known`] has them.
    of_pool: Vec<f64>,
    factor: Vec<f64>,
}

impl Held {
    /// The weights, and what they are held to: values and errors of the integrals, and what is integrated.
    fn to(
        self,
        [of_sub_nets, errors]: [Vec<f64>; 2],
        features: Vec<f64>,
        far: bool,
    ) -> (Vec<f64>, Known) {
        let Self { spread, weights, of_pool, factor } = self;
        let p = features.len() / weights.len();
        let (moved, whole) = (Vec::new(), true);
        let known =
            Known { p, of_sub_nets, features, errors, of_pool, spread, factor, far, moved, whole };
        (weights, known)
    }
}

/// Those of every p numbers that stand in these columns.
pub(super) fn only(all: &[f64], p: usize, columns: &[usize]) -> Vec<f64> {
    all.chunks_exact(p).flat_map(|row| columns.iter().map(|a| row[*a])).collect()
}

/// Sums over rows of p numbers.
pub(super) fn totals(rows: &[f64], p: usize) -> Vec<f64> {
    (0..p).map(|a| rows.iter().skip(a).step_by(p).sum()).collect()
}

/// The evidence as it is known, and of the other integrals a part of their shares, the rest by the samples at this evidence.
fn partly(known: &[f64], by_samples: &[f64], shares: &[f64], part: f64) -> Vec<f64> {
    let p = shares.len();
    let evidence = |of: &[f64]| of.iter().step_by(p).sum::<f64>();
    let factor = evidence(known) / evidence(by_samples);
    let mixed = |(k, (known, of)): (usize, (&f64, &f64))| {
        let share = if k % p == 0 { 1.0 } else { part * shares[k % p] };
        share * known + (1.0 - share) * factor * of
    };
    known.iter().zip(by_samples).enumerate().map(mixed).collect()
}

/// Errors of what [`partly`] gives, by draws of those of the known integrals: it is linear in these.
fn partly_off(errors: &[f64], by_samples: &[f64], shares: &[f64], part: f64) -> Vec<f64> {
    let p = shares.len();
    let all = totals(by_samples, p);
    errors.chunks_exact(p).flat_map(|draw| partly(draw, &all, shares, part)).collect()
}

/// Cholesky factor of the sum of products of p features, weighted by weight times spread.
fn factor(spread: Spread, weights: &[f64], features: &[f64], p: usize) -> Option<Vec<f64>> {
    let mut gram = vec![0.0; p * p];
    for (w, row) in weights.iter().zip(features.chunks_exact(p)).filter(|(w, _)| **w > 0.0) {
        let change = spread.of(*w);
        for a in 0..p {
            let term = row[a] * w;
            for b in 0..=a {
                gram[a * p + b] += term * row[b] * change;
            }
        }
    }
    cholesky(&gram, p)
}

/// Factors `f = exp(sqrt(w) lambda phi)` for which the sums of `w f phi` are the wished ones: the minimum of
/// `sum sqrt(w) f - lambda wished` by Newton's method. None where it is not found, or a weight would change by more than
/// is allowed.
fn tilts(
    weights: &[f64],
    features: &[f64],
    wished: &[f64],
    allowed: &RangeInclusive<f64>,
) -> Option<Vec<f64>> {
    let p = wished.len();
    let inner =
        |row: &[f64], other: &[f64]| -> f64 { row.iter().zip(other).map(|(f, l)| f * l).sum() };
    let at = |lambda: &[f64]| -> (Vec<f64>, f64) {
        let rows = weights.iter().zip(features.chunks_exact(p));
        let factors: Vec<f64> = rows
            .map(|(w, row)| if *w > 0.0 { (w.sqrt() * inner(row, lambda)).exp() } else { 1.0 })
            .collect();
        let sum: f64 = factors.iter().zip(weights).map(|(f, w)| w.sqrt() * f).sum();
        (factors, sum - inner(lambda, wished))
    };
    let mut lambda = vec![0.0; p];
    let (mut factors, mut value) = at(&lambda);
    for _ in 0..STEPS {
        let (mut gap, mut slopes) = (wished.to_vec(), vec![0.0; p * p]);
        for ((w, f), row) in weights.iter().zip(&factors).zip(features.chunks_exact(p)) {
            for a in 0..p {
                let term = w * f * row[a];
                gap[a] -= term;
                for b in 0..=a {
                    slopes[a * p + b] += term * w.sqrt() * row[b];
                }
            }
        }
        if gap.iter().all(|gap| gap.abs() <= GAP * wished[0].abs()) {
            return factors.iter().all(|f| allowed.contains(f)).then_some(factors);
        }
        let step = solve(&cholesky(&slopes, p)?, &gap);
        (lambda, (factors, value)) = (0..HALVINGS).find_map(|halvings| {
            let share = 0.5f64.powi(halvings);
            let next: Vec<f64> = lambda.iter().zip(&step).map(|(l, s)| l + share * s).collect();
            let found = at(&next);
            // At the minimum itself a step changes nothing but the last digits.
            (found.1 <= value + 1e-14 * value.abs()).then_some((next, found))
        })?;
    }
    None
}

/// Weights that are held to some of the integrals, and what these are, with their errors.
struct InPart {
    held: Held,
    known: Vec<f64>,
    errors: Vec<f64>,
    /// Numbers of those; none where they are all.
    columns: Option<Vec<usize>>,
    /// Part of their shares that the moments are held to.
    part: f64,
}

impl Samples<'_> {
    /// Their weights held to integrals over `d` coordinates, and what they are held to; none where that would change a weight by too
    /// much. With `far`, where importance weights are few, weights may change as far as [`TILTS`]. Where they would change further,
    /// they are held in part ([`Self::held_in_part`]), and samples are then moved to all that is known ([`moved`]) where they can be.
    /// Their heavy tail does not show in the held ones any more.
    pub(super) fn held_to(
        &self,
        integrals: Integrals,
        d: usize,
        far: bool,
    ) -> Option<(Vec<f64>, Known)> {
        if !far {
            let Integrals { of_sub_nets, features, errors, .. } = integrals;
            let held = self.held(&[Spread::Weight, Spread::Root], &of_sub_nets, &features)?;
            return Some(held.to([of_sub_nets, errors], features, far));
        }
        if integrals.shares[0] < LEAST_SHARE {
            return None;
        }
        let p = integrals.shares.len();
        let by_samples = self.sums(self.weights, &integrals.features, p);
        let InPart { held, known, errors, columns, part } =
            self.held_in_part(&integrals, &by_samples, d)?;
        let in_part = columns.is_some() || part < PARTS[0];
        if in_part && !integrals.axes.is_empty() {
            let [known, errors] = integrals.partly(&by_samples, PARTS[0]);
            if let Some((held, features)) = self.moved_to(&held.weights, &integrals, &known) {
                let (weights, known) = held.to([known, errors], features, far);
                return Some((weights, Known { moved: integrals.axes, ..known }));
            }
        }
        let features = columns.map(|columns| only(&integrals.features, p, &columns));
        let (weights, known) =
            held.to([known, errors], features.unwrap_or(integrals.features), far);
        Some((weights, Known { whole: !in_part, ..known }))
    }

    /// Weights held to the evidence, and with the moments, or those of each coordinate without their products, to a mean of what is known
    /// and of what the samples say, the first of [`PARTS`] that weights have; rather to the evidence alone than to nothing.
    fn held_in_part(&self, integrals: &Integrals, by_samples: &[f64], d: usize) -> Option<InPart> {
        let p = integrals.shares.len();
        let squares = (0..d).map(|i| 1 + d + i * (i + 1) / 2 + i);
        let squares: Vec<usize> = (0..=d).chain(squares).collect();
        let spreads = [Spread::Weight, Spread::Far];
        // A copy only where fewer are held: those of all samples are many.
        let mut of_squares = None;
        for part in PARTS {
            let [known, errors] = integrals.partly(by_samples, part);
            if let Some(held) = self.held(&spreads, &known, &integrals.features) {
                return Some(InPart { held, known, errors, columns: None, part });
            }
            let [known, errors] = [known, errors].map(|all| only(&all, p, &squares));
            let features = of_squares.get_or_insert_with(|| only(&integrals.features, p, &squares));
            if let Some(held) = self.held(&spreads, &known, features) {
                return Some(InPart { held, known, errors, columns: Some(squares), part });
            }
        }
        let all = [&integrals.of_sub_nets, &integrals.errors, &integrals.features];
        let [known, errors, features] = all.map(|all| only(all, p, &[0]));
        let held = self.held(&[Spread::One], &known, &features)?;
        Some(InPart { held, known, errors, columns: Some(vec![0]), part: 0.0 })
    }

    /// Samples with these weights, moved to what is known, which the weights then are held to; with their features. Where samples stop at
    /// the end of the prior all are moved again; none where they do not get there.
    fn moved_to(
        &self,
        weights: &[f64],
        integrals: &Integrals,
        known: &[f64],
    ) -> Option<(Held, Vec<f64>)> {
        let Integrals { features, axes, shares, .. } = integrals;
        let p = shares.len();
        let wished = totals(known, p);
        let sums_of = |features: &[f64]| totals(&self.sums(weights, features, p), p);
        let mut sums = sums_of(features);
        let to = Moments::to([&sums, &wished], axes.len())?;
        let mut features = features.clone();
        for _ in 0..MOVES {
            features = moved(&features, &sums, &to, axes)?;
            sums = sums_of(&features);
            if reach(&sums, &wished, axes.len()) {
                let held = self.with(weights.to_vec(), Spread::One, &features)?;
                return Some((held, features));
            }
        }
        None
    }

    /// Weights that are held to the integrals of these features, with what belongs to them.
    fn with(&self, weights: Vec<f64>, spread: Spread, features: &[f64]) -> Option<Held> {
        let p = features.len() / weights.len();
        let factor = factor(spread, &weights, features, p)?;
        let of_pool = self.sums(&weights, features, p);
        Some(Held { spread, weights, of_pool, factor })
    }

    /// Sums of weight times feature over the samples of every sub-net, of p features.
    pub(super) fn sums(&self, weights: &[f64], features: &[f64], p: usize) -> Vec<f64> {
        let mut sums = vec![0.0; self.replicates * p];
        for ((w, label), row) in weights.iter().zip(self.label).zip(features.chunks_exact(p)) {
            if *w > 0.0 {
                add_multiple(&mut sums[*label as usize * p..][..p], *w, row);
            }
        }
        sums
    }

    /// Weights held to integrals by the first of these spreads by which none would change by too much.
    fn held(&self, spreads: &[Spread], of_sub_nets: &[f64], features: &[f64]) -> Option<Held> {
        spreads.iter().find_map(|spread| self.held_by(*spread, of_sub_nets, features))
    }

    fn held_by(&self, spread: Spread, of_sub_nets: &[f64], features: &[f64]) -> Option<Held> {
        let p = of_sub_nets.len() / self.replicates;
        let each = self.weights.len() as f64 / self.replicates as f64;
        let wished: Vec<f64> = totals(of_sub_nets, p).iter().map(|sum| each * sum).collect();
        let weights = match spread {
            Spread::Weight | Spread::One => {
                let factor = factor(spread, self.weights, features, p)?;
                let sums = totals(&self.sums(self.weights, features, p), p);
                let gap: Vec<f64> = wished.iter().zip(&sums).map(|(w, sum)| w - sum).collect();
                let lambda = solve(&factor, &gap);
                let mut weights = self.weights.to_vec();
                for (w, row) in weights.iter_mut().zip(features.chunks_exact(p)) {
                    if *w <= 0.0 {
                        continue;
                    }
                    let inner: f64 = row.iter().zip(&lambda).map(|(f, l)| f * l).sum();
                    let change = spread.of(*w) * inner;
                    if !CHANGES.contains(&change) {
                        return None;
                    }
                    *w *= 1.0 + change;
                }
                weights
            }
            Spread::Root | Spread::Far => {
                let allowed = if matches!(spread, Spread::Far) {
                    TILTS
                } else {
                    1.0 + CHANGES.start()..=1.0 + CHANGES.end()
                };
                let tilts = tilts(self.weights, features, &wished, &allowed)?;
                self.weights.iter().zip(tilts).map(|(w, tilt)| w * tilt).collect()
            }
        };
        self.with(weights, spread, features)
    }
}
