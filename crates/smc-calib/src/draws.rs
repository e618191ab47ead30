//! The equally weighted draws of a posterior: of its samples, or of a process that knows more than few of them do.

use crate::control::ByProcess;
use crate::estimate::Estimator;
use crate::joint::JointProblem;
use crate::marginal::{Marginal, correlation, draws_by_errors, mean_and_sd, range};
use crate::pool::Pool;
use crate::stream::{Purpose, stream};
use crate::{ParameterSummary, Settings};
use rand::RngExt as _;
use rayon::prelude::*;

/// Most predicted outputs of all draws (64 MB).
const MOST: usize = 8_000_000;
/// Normal score of the end of a prior.
const FARTHEST: f64 = 7.0;

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
/// Points that are drawn from the process are taken, coordinate by coordinate and in their order, to the quantiles that the integrals
/// tell ([`crate::estimate::Below`]): the k-th of n in ascending order is the (k - 1/2)/n quantile. How coordinates depend on one another, their
/// copula, stays that of the process (A. Sklar, Publ. Inst. Stat. Univ. Paris 8 (1959) 229).
pub(crate) struct Drawn {
    /// A column for each parameter: SI, and normal score.
    theta: Vec<Vec<f64>>,
    z: Vec<Vec<f64>>,
    /// Predicted outputs, row by row.
    outputs: Vec<f64>,
}

impl Drawn {
    /// None where marginals are not known, or outputs would be too many.
    pub(crate) fn new(
        by: &ByProcess<'_>,
        problem: &JointProblem<'_>,
        estimator: &Estimator,
        settings: &Settings,
    ) -> Option<Self> {
        let (count, d) = (settings.draws, problem.parameters.len());
        if count == 0 || count.saturating_mul(problem.observations()) > MOST {
            return None;
        }
        let points = by.points(count, settings.seed)?;
        let column = |j: usize| {
            let below = estimator.below(j)?;
            let range = range(&problem.parameters[j].prior);
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by(|a, b| points[a * d + j].total_cmp(&points[b * d + j]));
            let mut column = vec![0.0; count];
            for (rank, k) in order.into_iter().enumerate() {
                column[k] = below.quantile((rank as f64 + 0.5) / count as f64, range);
            }
            Some(column)
        };
        let (mut theta, mut z) = (Vec::with_capacity(d), Vec::with_capacity(d));
        for (j, parameter) in problem.parameters.iter().enumerate() {
            let (prior, column) = (&parameter.prior, column(j)?);
            let (lower, upper) = prior.support();
            let own = column.iter().map(|x| prior.coordinate().theta(*x).max(lower).min(upper));
            let own: Vec<f64> = own.collect();
            let score = |theta: &f64| prior.to_z(*theta).clamp(-FARTHEST, FARTHEST);
            z.push(own.iter().map(score).collect::<Vec<f64>>());
            theta.push(own);
        }
        let rows: Vec<f64> = (0..count).flat_map(|k| z.iter().map(move |z| z[k])).collect();
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

    /// Says of each parameter in SI, and of what was learnt of it, what the draws say; their correlations in SI. Moments in SI have the
    /// errors that they would have by as many independent draws as tell those in the coordinate as well.
    pub(crate) fn tell(&self, parameters: &mut [ParameterSummary]) -> Vec<Vec<f64>> {
        let equally = self.equally();
        for (j, summary) in parameters.iter_mut().enumerate() {
            let theta = &self.theta[j];
            let (mean, _, sd, _) = mean_and_sd(theta, &equally);
            let fourth = equally.mean(|k| (theta[k] - mean).powi(4));
            let worth = draws_by_errors(&summary.in_coordinate);
            let si = &mut summary.in_si;
            (si.mean, si.sd) = (mean, sd);
            if sd > 0.0 && worth > 0.0 {
                let excess = (fourth / sd.powi(4) - 1.0).max(0.0);
                si.mean_se = sd / worth.sqrt();
                si.sd_se = 0.5 * sd * (excess / worth).sqrt();
            }
            summary.information_gain_bits =
                Marginal::new(&self.z[j], &equally).information_gain_bits();
        }
        correlation(&self.theta, &equally)
    }
}

/// Systematic resampling: the sample of each draw.
pub(crate) fn chosen(estimator: &Estimator, settings: &Settings) -> Vec<usize> {
    let count = settings.draws;
    if count == 0 {
        return Vec::new();
    }
    let step = estimator.total / count as f64;
    let mut next = step * stream(settings.seed, Purpose::Draws, 0, 0).random::<f64>();
    let mut chosen = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (i, w) in estimator.weights.iter().enumerate() {
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
