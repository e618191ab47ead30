//! The equally weighted draws of a posterior: of its samples, or of a process that knows more than few of them do.

use crate::cholesky::rows_of;
use crate::control::ByProcess;
use crate::estimate::{Bins, Estimator};
use crate::joint::JointProblem;
use crate::marginal::{Marginal, correlation, draws_by_errors, mean_and_sd};
use crate::pool::{Pool, effective_sample_size};
use crate::stream::{Purpose, stream};
use crate::{Coordinate, Parameter, ParameterSummary, Settings};
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Draws that a process makes at fewest, below which they would say less than the samples, and at most; most outputs of all of them (64 MB).
const COUNTS: RangeInclusive<usize> = 500..=65_536;
const MOST: usize = 8_000_000;
/// Fewest effective points that draws are chosen from.
const FEWEST_POINTS: f64 = 200.0;
/// Rounds of raking.
const ROUNDS: usize = 50;

/// The draws, and the outputs of each.
pub(crate) struct Draws<'a> {
    /// The sample of each, or the nearest one where a process drew it.
    pub samples: Vec<usize>,
    /// What they are where a process drew them.
    pub drawn: Option<Drawn>,
    /// Outputs that were kept of each sample, so many of each.
    kept: &'a [f64],
    width: usize,
}

impl<'a> Draws<'a> {
    /// Those of a process, or of the samples by their weights.
    pub(crate) fn new(
        pool: &'a Pool,
        estimator: &Estimator,
        settings: &Settings,
        drawn: Option<Drawn>,
    ) -> Self {
        let samples = match &drawn {
            Some(drawn) => drawn.nearest(pool),
            None => chosen(estimator, settings),
        };
        Self { samples, drawn, kept: &pool.kept, width: pool.kept_width }
    }

    /// Their number.
    pub(crate) fn len(&self) -> usize {
        self.samples.len()
    }

    /// The outputs of draw k: simulated, or predicted where a process drew it.
    pub(crate) fn outputs(&self, k: usize) -> &[f64] {
        match &self.drawn {
            Some(drawn) => &drawn.outputs[k * self.width..][..self.width],
            None => &self.kept[self.samples[k] * self.width..][..self.width],
        }
    }

    /// Whether draw k has the outputs of the one before it.
    pub(crate) fn again(&self, k: usize) -> bool {
        self.drawn.is_none() && k > 0 && self.samples[k] == self.samples[k - 1]
    }

    /// Mean over the posterior of a number that is known of each sample, or of each draw where a process drew them.
    pub(crate) fn mean(
        &self,
        estimator: &Estimator,
        of_sample: impl Fn(usize) -> f64,
        of_draw: impl Fn(usize) -> f64,
    ) -> f64 {
        match &self.drawn {
            Some(_) => (0..self.len()).map(of_draw).sum::<f64>() / self.len() as f64,
            None => estimator.mean(of_sample),
        }
    }

    /// Parameters of draw k in SI where a process drew it, else none.
    pub(crate) fn theta(&self, k: usize) -> Vec<f64> {
        let columns = self.drawn.iter().flat_map(|drawn| &drawn.theta);
        columns.map(|column| column[k]).collect()
    }
}

/// Draws of a process: its own joint distribution, with the marginals that are reported.
///
/// Weighted points of the process are raked: coordinate by coordinate, and again, their weights are multiplied by what makes the shares
/// between levels those that the integrals tell ([`crate::estimate::Below`]; W.E. Deming, F.F. Stephan, Ann. Math. Stat. 11 (1940) 427).
/// Draws are points that are chosen by these weights: they stay where the process has its modes, ridges and ends.
pub(crate) struct Drawn {
    /// A column for each parameter: SI, and normal score.
    theta: Vec<Vec<f64>>,
    z: Vec<Vec<f64>>,
    /// Predicted outputs, row by row.
    outputs: Vec<f64>,
}

impl Drawn {
    /// None where marginals are not known, where so few draws would say less than the samples, or outputs would be too many.
    pub(crate) fn new(
        by: &ByProcess<'_>,
        problem: &JointProblem<'_>,
        estimator: &Estimator,
        settings: &Settings,
    ) -> Option<Self> {
        let (count, d) = (settings.draws, problem.parameters.len());
        if !COUNTS.contains(&count) || count * problem.observations() > MOST {
            return None;
        }
        let (points, mut weights) = by.weighed(count, settings.seed);
        let coordinate = problem.coordinate();
        let bins = |j: usize| {
            Some(
                estimator
                    .below(j)?
                    .bins(points.iter().skip(j).step_by(d).map(|z| coordinate(j, *z))),
            )
        };
        let bins: Vec<Bins> = (0..d).map(bins).collect::<Option<_>>()?;
        rake(&mut weights, &bins);
        if effective_sample_size(&weights) < FEWEST_POINTS {
            return None;
        }
        let mut rng = stream(settings.seed, Purpose::Draws, 2, 0);
        let mut chosen = systematic(&weights, count, rng.random());
        chosen.shuffle(&mut rng);
        let rows = rows_of(&points, d, &chosen);
        let column = |j: usize| rows.iter().skip(j).step_by(d).copied().collect::<Vec<f64>>();
        let z: Vec<Vec<f64>> = (0..d).map(column).collect();
        let of = |(z, p): (&Vec<f64>, &Parameter)| z.iter().map(|z| p.prior.from_z(*z)).collect();
        let theta = z.iter().zip(&problem.parameters).map(of).collect();
        let outputs = by.outputs(&rows);
        let finite = outputs.iter().all(|value| value.is_finite());
        finite.then_some(Self { theta, z, outputs })
    }

    /// The simulated sample that is nearest to each, in normal scores over their standard deviation.
    fn nearest(&self, pool: &Pool) -> Vec<usize> {
        let equally = self.equally();
        let scale = |z: &Vec<f64>| mean_and_sd(z, &equally).2.max(f64::MIN_POSITIVE);
        let scales: Vec<f64> = self.z.iter().map(scale).collect();
        let simulated: Vec<usize> = (0..pool.len()).filter(|i| pool.ln_l[*i].is_finite()).collect();
        let distance = |k: usize, i: usize| -> f64 {
            let each = pool.point(i).iter().zip(&self.z).zip(&scales);
            each.map(|((own, z), scale)| ((own - z[k]) / scale).powi(2)).sum()
        };
        let of = |k: usize| {
            let each = simulated.iter().map(|i| (distance(k, *i), *i));
            each.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, i)| i)
        };
        (0..self.theta.first().map_or(0, Vec::len)).into_par_iter().map(of).collect()
    }

    /// Draws of weight one.
    fn equally(&self) -> Estimator {
        let count = self.theta.first().map_or(0, Vec::len);
        Estimator::of(vec![0; count], vec![1.0; count], 0.0, 1)
    }

    /// Says of each parameter over decades, in SI, and of what was learnt of each, what the draws say; their correlations in SI. Moments in
    /// SI have the errors that they would have by as many independent draws as tell those in the coordinate as well.
    pub(crate) fn tell(
        &self,
        parameters: &mut [ParameterSummary],
        correlated: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        let equally = self.equally();
        let linear = |summary: &ParameterSummary| summary.coordinate == Coordinate::Linear;
        let mut in_si = correlation(&self.theta, &equally);
        for (i, j) in (0..parameters.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            if linear(&parameters[i]) && linear(&parameters[j]) {
                (in_si[i][j], in_si[j][i]) = (correlated[i][j], correlated[j][i]);
            }
        }
        for (j, summary) in parameters.iter_mut().enumerate() {
            summary.information_gain_bits =
                Marginal::new(&self.z[j], &equally).information_gain_bits();
            if linear(summary) {
                continue;
            }
            let theta = &self.theta[j];
            let (mean, _, sd, _) = mean_and_sd(theta, &equally);
            let fourth = equally.mean(|k| (theta[k] - mean).powi(4));
            let worth =
                1.0 / (1.0 / draws_by_errors(&summary.in_coordinate) + 1.0 / theta.len() as f64);
            let si = &mut summary.in_si;
            (si.mean, si.sd) = (mean, sd);
            if sd > 0.0 && worth > 0.0 {
                let excess = (fourth / sd.powi(4) - 1.0).max(0.0);
                si.mean_se = sd / worth.sqrt();
                si.sd_se = 0.5 * sd * (excess / worth).sqrt();
            }
        }
        in_si
    }
}

/// Multiplies weights, coordinate by coordinate and again, by what gives their bins the shares that are known. A bin without weight stays
/// without.
fn rake(weights: &mut [f64], bins: &[Bins]) {
    for _ in 0..ROUNDS {
        for Bins { shares, of } in bins {
            let mut sums = vec![0.0; shares.len()];
            weights.iter().zip(of).for_each(|(w, bin)| sums[*bin] += w);
            let factor = |(share, sum): (&f64, &f64)| if *sum > 0.0 { share / sum } else { 0.0 };
            let factors: Vec<f64> = shares.iter().zip(&sums).map(factor).collect();
            weights.iter_mut().zip(of).for_each(|(w, bin)| *w *= factors[*bin]);
        }
    }
}

/// The place of each of so many draws by weight, at even steps from a random first one between 0 and 1.
fn systematic(weights: &[f64], count: usize, first: f64) -> Vec<usize> {
    let step = weights.iter().sum::<f64>() / count as f64;
    let mut next = step * first;
    let mut chosen = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (i, w) in weights.iter().enumerate() {
        sum += w;
        while next < sum && chosen.len() < count {
            chosen.push(i);
            next += step;
        }
    }
    while let (true, Some(last)) = (chosen.len() < count, chosen.last().copied()) {
        chosen.push(last);
    }
    chosen
}

/// Systematic resampling: the sample of each draw.
pub(crate) fn chosen(estimator: &Estimator, settings: &Settings) -> Vec<usize> {
    if settings.draws == 0 {
        return Vec::new();
    }
    let first = stream(settings.seed, Purpose::Draws, 0, 0).random::<f64>();
    systematic(&estimator.weights, settings.draws, first)
}
