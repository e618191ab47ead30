//! Correlated errors: an independent part beside an Ornstein-Uhlenbeck process.
//!
//! `e = sqrt(1 - w) u + sqrt(w) n`, both of variance sigma^2: covariance `sigma^2 K`, `K_ij = w [i = j] + (1 - w) exp(-|s_i - s_j|/l)`,
//! with the distance measured in s. Given the correlation length l and the white share w, the Kalman filter whitens the residuals
//! (G. E. Uhlenbeck, L. S. Ornstein, Phys. Rev. 36 (1930) 823; J. Durbin, S. J. Koopman, Time Series Analysis by State Space Methods
//! (2012), chapter 4); its gains do not depend on the curve. sigma^2 is integrated out as for independent errors, l and w by quadrature.

use super::NoiseError;
use super::rule::{Node, length, ln_one_plus, ln_sum_exp, nodes_for, parts_of, product, share};
use super::scale::DistanceScale;
use super::student::student_constants;
use crate::Observations;
use crate::lanes::{LANES, Lane, minus, plus, times, wide};

/// Most observations: what is prepared for them takes up to 20 kB each.
const MAX_OBSERVATIONS: usize = 10_000;
/// Largest nu0 plus number of observations whose powers are multiplied out. Weights and sums of squares of two nodes differ
/// by a factor of up to about 1e5, so that the sum stays above 1e-300.
const MULTIPLIED: f64 = 100.0;

/// The filter of one node at one observation: eight nodes side by side.
#[derive(Clone, Debug, Default, PartialEq)]
// No lane lies across two lines of the cache.
#[repr(align(64))]
struct Step {
    /// Correlation with the observation before.
    decay: Lane,
    /// Share of the innovation that the process takes up.
    gain: Lane,
    /// One over the variance of the innovation, in sigma^2.
    precision: Lane,
    /// Log of the prior weight, minus half the log of the variances so far.
    ln_scale: Lane,
}

/// The likelihood of a curve under correlated errors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Correlated {
    nu0: f64,
    sum0: f64,
    scale: DistanceScale,
    control: Vec<f64>,
    nodes: Vec<Node>,
    /// The part of the prior's distribution function that each length, and each share, stands for.
    parts: [Vec<[f64; 2]>; 2],
    /// Range of the observations on the scale.
    range: f64,
    rows: usize,
    /// Filters, block of nodes by block of nodes, each through all observations.
    steps: Vec<Step>,
    /// Log constant of the density of the first 1, 2, .. observations.
    constants: Vec<f64>,
    /// For each observation, where powers can be multiplied out; else empty.
    powers: Vec<Power>,
}

/// The power (nu0 + k)/2 as a whole number and perhaps a root, and the weights of the nodes.
#[derive(Clone, Debug, PartialEq)]
struct Power {
    whole: u32,
    root: bool,
    /// Over `exp(ln_weight)`.
    weights: Vec<Lane>,
    ln_weight: f64,
}

impl Correlated {
    /// The model for some observations; none where fewer than three of them lie at different places of the scale: there
    /// is then no correlation to be seen.
    pub(crate) fn new(
        [nu0, sum0]: [f64; 2],
        scale: Option<DistanceScale>,
        nodes: Option<[usize; 2]>,
        observations: &Observations,
    ) -> Result<Option<Self>, NoiseError> {
        let control = observations.control().to_vec();
        let rows = control.len();
        let [lengths, shares] = nodes.unwrap_or_else(|| nodes_for(rows));
        if rows > MAX_OBSERVATIONS {
            return Err(NoiseError::TooManyCorrelated {
                observations: rows,
                most: MAX_OBSERVATIONS,
            });
        }
        for (field, nodes) in [("lengths", lengths), ("shares", shares)] {
            if !(1..=64).contains(&nodes) {
                return Err(NoiseError::Nodes { field, nodes });
            }
        }
        let scale = scale.unwrap_or_else(|| DistanceScale::of(&control));
        if scale == DistanceScale::Log
            && let Some(index) = control.iter().position(|s| *s < 0.0)
        {
            return Err(NoiseError::LogOfNegative { index, control: control[index] });
        }
        let Some(range) = scale.range(&control) else { return Ok(None) };
        let nodes = product(range, lengths, shares);
        let constants = student_constants(nu0, sum0, rows);
        let (steps, powers, parts) = (Vec::new(), Vec::new(), Default::default());
        let mut new =
            Self { nu0, sum0, scale, control, nodes, parts, range, rows, steps, constants, powers };
        new.parts = [0, 1].map(|axis| parts_of(&new.prior(axis)));
        new.steps = new.nodes.chunks(LANES).flat_map(|block| new.prepared(block)).collect();
        if nu0.fract() == 0.0 && rows as f64 + nu0 <= MULTIPLIED {
            new.powers = (0..rows).map(|k| new.power(k)).collect();
        }
        Ok(Some(new))
    }

    /// The power after observation `k`.
    fn power(&self, k: usize) -> Power {
        let twice = self.nu0 as u32 + k as u32 + 1;
        let logs: Vec<Lane> =
            self.steps.iter().skip(k).step_by(self.rows).map(|step| step.ln_scale).collect();
        let ln_weight = logs.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = logs.iter().map(|lane| lane.map(|ln| (ln - ln_weight).exp())).collect();
        Power { whole: twice / 2, root: twice % 2 == 1, weights, ln_weight }
    }

    /// Filters of up to eight nodes; lanes without a node have weight zero.
    fn prepared(&self, block: &[Node]) -> Vec<Step> {
        let mut steps = vec![Step::default(); self.rows];
        for lane in 0..LANES {
            // A lane without a node of its own has the last one's sums of squares.
            let node = block.get(lane).unwrap_or(&block[block.len() - 1]);
            let weight = if lane < block.len() { node.prior } else { 0.0 };
            let mut ln_scale = weight.ln();
            for (step, of) in steps.iter_mut().zip(self.filter(node.length, node.white)) {
                ln_scale -= 0.5 * of.variance.ln();
                step.decay[lane] = of.decay;
                step.gain[lane] = of.gain;
                step.precision[lane] = 1.0 / of.variance;
                step.ln_scale[lane] = ln_scale;
            }
        }
        steps
    }

    /// The filter through the observations for one correlation length and white share.
    fn filter(&self, length: f64, white: f64) -> impl Iterator<Item = Filter> {
        let mut left = 0.0;
        self.control.iter().enumerate().map(move |(k, control)| {
            let decay = match k {
                0 => 0.0,
                _ => self.scale.correlation(self.control[k - 1], *control, length),
            };
            let known = decay * decay * left + (1.0 - white) * (1.0 - decay * decay);
            let variance = known + white;
            let gain = known / variance;
            left = known * (1.0 - gain);
            Filter { decay, gain, variance }
        })
    }

    /// Shape of the inverse gamma of sigma^2 after all observations, and twice its scale before them.
    pub(crate) fn shape_and_sum(&self) -> (f64, f64) {
        (0.5 * (self.nu0 + self.rows as f64), self.sum0)
    }

    /// What distances are measured in.
    pub(crate) fn scale(&self) -> DistanceScale {
        self.scale
    }

    /// Range of the observations on the scale.
    pub(crate) fn range(&self) -> f64 {
        self.range
    }

    /// Correlation lengths and white shares.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Prior probabilities of the lengths, or of the shares.
    pub(crate) fn prior(&self, axis: usize) -> Vec<f64> {
        let count = self.nodes.iter().map(|n| n.place[axis] + 1).max().unwrap_or(0);
        let mut prior = vec![0.0; count];
        self.nodes.iter().for_each(|n| prior[n.place[axis]] += n.prior);
        prior
    }

    /// The length, or the share, at a value of its distribution function under the prior.
    pub(crate) fn quantity(&self, axis: usize, u: f64) -> f64 {
        if axis == 0 { length(self.range, u) } else { share(u) }
    }

    /// The length, or the share, at a value `u` of the distribution function within the part of the prior that a node
    /// stands for; a single node stands for itself.
    pub(crate) fn within(&self, axis: usize, place: usize, u: f64) -> f64 {
        let [before, after] = self.parts[axis][place];
        let u = if self.parts[axis].len() == 1 { 0.5 } else { u };
        self.quantity(axis, before + u * (after - before))
    }

    /// Log likelihood of the curve.
    pub(crate) fn ln_joint(&self, values: &[f64], outputs: &[f64]) -> f64 {
        wide(
            #[inline(always)]
            || self.constants[self.rows - 1] + ln_sum_exp(&self.terms(values, outputs)),
        )
    }

    /// Log of prior weight times density of every node, without the constant.
    #[inline(always)]
    fn terms(&self, values: &[f64], outputs: &[f64]) -> Vec<Lane> {
        let residuals: Vec<f64> = values.iter().zip(outputs).map(|(v, o)| v - o).collect();
        let mut sums = vec![[0.0; LANES]; self.nodes.len().div_ceil(LANES)];
        // A step waits for the one before it: two further blocks fill the time.
        for (steps, three) in self.steps.chunks(3 * self.rows).zip(sums.chunks_mut(3)) {
            let block = |b: usize| &steps[b * self.rows..][..self.rows];
            match three {
                [a, b, c] => {
                    [*a, *b, *c] = sums_of_squares([block(0), block(1), block(2)], &residuals);
                }
                rest => {
                    for (b, sum) in rest.iter_mut().enumerate() {
                        [*sum] = sums_of_squares([block(b)], &residuals);
                    }
                }
            }
        }
        let power = 0.5 * (self.nu0 + self.rows as f64);
        let mut terms = sums;
        for (terms, steps) in terms.iter_mut().zip(self.steps.chunks_exact(self.rows)) {
            let ln_scale = &steps[self.rows - 1].ln_scale;
            let mut ln = [0.0; LANES];
            for i in 0..LANES {
                ln[i] = ln_one_plus(terms[i] / self.sum0);
            }
            for i in 0..LANES {
                terms[i] = ln_scale[i] - power * ln[i];
            }
        }
        terms
    }

    /// Log likelihood of the first 1, 2, .. observations.
    pub(crate) fn ln_cumulative(&self, values: &[f64], outputs: &[f64], cumulative: &mut [f64]) {
        wide(
            #[inline(always)]
            || {
                let mut terms = vec![[0.0; LANES]; self.nodes.len().div_ceil(LANES)];
                let mut state = vec![([0.0; LANES], [0.0; LANES]); terms.len()];
                for k in 0..self.rows {
                    for (b, (expected, sum)) in state.iter_mut().enumerate() {
                        let step = &self.steps[b * self.rows + k];
                        advance(step, values[k] - outputs[k], expected, sum);
                    }
                    let ln = match self.powers.get(k) {
                        Some(power) => self.ln_sum_of_powers(k, power, &state, &mut terms),
                        None => self.ln_sum_of_logs(k, &state, &mut terms),
                    };
                    cumulative[k] = self.constants[k] + ln;
                }
            },
        );
    }

    /// Log of the sum over the nodes of weight times `(1 + S/(nu0 s0^2))^(-(nu0 + k)/2)`, by logarithms.
    #[inline(always)]
    fn ln_sum_of_logs(&self, k: usize, state: &[(Lane, Lane)], terms: &mut [Lane]) -> f64 {
        let half = 0.5 * (self.nu0 + (k + 1) as f64);
        for (b, ((_, sum), terms)) in state.iter().zip(terms.iter_mut()).enumerate() {
            let scale = &self.steps[b * self.rows + k].ln_scale;
            for i in 0..LANES {
                terms[i] = scale[i] - half * ln_one_plus(sum[i] / self.sum0);
            }
        }
        ln_sum_exp(terms)
    }

    /// The same by multiplications, four times faster: for whole nu0, and few enough observations that no number leaves the range.
    #[inline(always)]
    fn ln_sum_of_powers(
        &self,
        k: usize,
        power: &Power,
        state: &[(Lane, Lane)],
        terms: &mut [Lane],
    ) -> f64 {
        let mut least = [f64::MAX; LANES];
        for (_, sum) in state {
            for (least, sum) in least.iter_mut().zip(sum) {
                *least = least.min(*sum);
            }
        }
        let least = self.sum0 + least.iter().copied().fold(f64::MAX, f64::min);
        let mut total = [0.0; LANES];
        for (b, (_, sum)) in state.iter().enumerate() {
            let mut base = sum.map(|sum| least / (self.sum0 + sum));
            let mut product = if power.root { base.map(f64::sqrt) } else { [1.0; LANES] };
            let mut left = power.whole;
            while left > 0 {
                if left & 1 == 1 {
                    product = times(&product, &base);
                }
                base = times(&base, &base);
                left >>= 1;
            }
            terms[b] = times(&product, &power.weights[b]);
        }
        for terms in terms.iter() {
            for (total, t) in total.iter_mut().zip(terms) {
                *total += t;
            }
        }
        let (half, sum) = (0.5 * (self.nu0 + (k + 1) as f64), total.iter().sum::<f64>());
        if !sum.is_normal() {
            return self.ln_sum_of_logs(k, state, terms);
        }
        sum.ln() + power.ln_weight - half * (least / self.sum0).ln()
    }

    /// Posterior probability of every node given the curve, and its sum of squares of whitened residuals.
    pub(crate) fn posterior(&self, values: &[f64], outputs: &[f64]) -> Vec<(f64, f64)> {
        let terms = self.terms(values, outputs);
        let total = ln_sum_exp(&terms);
        let power = 0.5 * (self.nu0 + self.rows as f64);
        let last = |j: usize| self.steps[j / LANES * self.rows + self.rows - 1].ln_scale[j % LANES];
        (0..self.nodes.len())
            .map(|j| {
                let term = terms[j / LANES][j % LANES];
                let sum = self.sum0 * ((last(j) - term) / power).exp_m1().max(0.0);
                ((term - total).exp(), sum)
            })
            .collect()
    }

    /// Residuals over the standard deviations that they were expected with, each given those before it, in sigma.
    pub(crate) fn whitened(&self, residuals: &[f64], length: f64, white: f64) -> Vec<f64> {
        let mut state = 0.0;
        let filters = self.filter(length, white).zip(residuals);
        filters
            .map(|(f, residual)| {
                let expected = f.decay * state;
                let innovation = residual - expected;
                state = expected + f.gain * innovation;
                innovation / f.variance.sqrt()
            })
            .collect()
    }

    /// Mean and variance over sigma^2 of each residual given all others: `r_i - (Q r)_i/Q_ii` and `1/Q_ii`, where Q is the
    /// inverse of K (P.-C. Buerkner, J. Gabry, A. Vehtari, Comput. Stat. 36 (2021) 1243), by the smoothing recursion of
    /// P. de Jong, J. Am. Stat. Assoc. 83 (1988) 231.
    pub(crate) fn given_others(
        &self,
        residuals: &[f64],
        length: f64,
        white: f64,
    ) -> Vec<(f64, f64)> {
        let filters: Vec<Filter> = self.filter(length, white).collect();
        let mut innovations = Vec::with_capacity(self.rows);
        let mut state = 0.0;
        for (f, residual) in filters.iter().zip(residuals) {
            let expected = f.decay * state;
            innovations.push(residual - expected);
            state = expected + f.gain * (residual - expected);
        }
        let mut found = vec![(0.0, 0.0); self.rows];
        let (mut r, mut n) = (0.0, 0.0);
        for k in (0..self.rows).rev() {
            let f = &filters[k];
            let next = filters.get(k + 1).map_or(0.0, |f| f.decay);
            let (taken, left) = (next * f.gain, next * (1.0 - f.gain));
            let scaled = innovations[k] / f.variance;
            let (u, d) = (scaled - taken * r, 1.0 / f.variance + taken * taken * n);
            found[k] = (residuals[k] - u / d, 1.0 / d);
            (r, n) = (scaled + left * r, 1.0 / f.variance + left * left * n);
        }
        found
    }

    /// Mean, and variance over sigma^2, of the error of new observations at `control`, given the residuals: what is known
    /// of the process there, and the independent part.
    pub(crate) fn smoothed(
        &self,
        residuals: &[f64],
        length: f64,
        white: f64,
        control: &[f64],
    ) -> Vec<(f64, f64)> {
        // Observations and new places in one order; a new place at an observation comes after it.
        let observed = self.control.iter().zip(residuals).map(|(s, r)| (*s, Ok(*r)));
        let asked = control.iter().enumerate().map(|(i, s)| (*s, Err(i)));
        let mut all: Vec<(f64, Result<f64, usize>)> = observed.chain(asked).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.is_err().cmp(&b.1.is_err())));
        let mut passed: Vec<[f64; 5]> = Vec::with_capacity(all.len());
        let (mut state, mut left, mut before) = (0.0, 1.0 - white, None);
        for (s, what) in &all {
            let decay = before.map_or(0.0, |before| self.scale.correlation(before, *s, length));
            let expected = decay * state;
            let known = decay * decay * left + (1.0 - white) * (1.0 - decay * decay);
            (state, left) = (expected, known);
            if let Ok(residual) = what {
                let gain = known / (known + white);
                state += gain * (residual - expected);
                left *= 1.0 - gain;
            }
            passed.push([decay, expected, known, state, left]);
            before = Some(*s);
        }
        let mut found = vec![(0.0, 1.0); control.len()];
        for k in (0..all.len()).rev() {
            let [.., mut mean, mut variance] = passed[k];
            if let Some([decay, expected, known, later, of_later]) = passed.get(k + 1).copied()
                && known > 0.0
            {
                let back = variance * decay / known;
                mean += back * (later - expected);
                variance += back * back * (of_later - known);
            }
            (passed[k][3], passed[k][4]) = (mean, variance);
            if let Err(i) = all[k].1 {
                found[i] = (mean, variance.max(0.0) + white);
            }
        }
        found
    }
}

/// The scalar filter at one observation; variances are in sigma^2.
#[derive(Clone, Copy, Debug)]
struct Filter {
    decay: f64,
    gain: f64,
    /// Variance of the innovation.
    variance: f64,
}

/// Sums of squares of whitened residuals by some blocks of nodes.
#[inline(always)]
fn sums_of_squares<const B: usize>(blocks: [&[Step]; B], residuals: &[f64]) -> [Lane; B] {
    let (mut expected, mut sums) = ([[0.0; LANES]; B], [[0.0; LANES]; B]);
    let blocks = blocks.map(|steps| &steps[..residuals.len()]);
    for (k, residual) in residuals.iter().enumerate() {
        for b in 0..B {
            advance(&blocks[b][k], *residual, &mut expected[b], &mut sums[b]);
        }
    }
    sums
}

/// Takes up one residual.
#[inline(always)]
fn advance(step: &Step, residual: f64, expected: &mut Lane, sum: &mut Lane) {
    let predicted = times(&step.decay, expected);
    let innovation = minus(&[residual; LANES], &predicted);
    let square = times(&times(&innovation, &innovation), &step.precision);
    *sum = plus(sum, &square);
    *expected = plus(&predicted, &times(&step.gain, &innovation));
}
