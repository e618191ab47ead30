//! The search for the covariance of largest evidence among those with a metric.

use super::kernel::{Kernel, Samples, Shape};
use super::metric::{MOST_BENT, Metric};
use crate::nelder_mead::{Start, best_of, maximise};

/// Lengths that the search starts from; the prior's cube is two wide.
const STARTS: [f64; 3] = [0.5, 1.5, 4.0];
/// First step of the search, in logarithms.
const STEP: f64 = 0.7;
/// Logarithms that lengths and the factor on the nuggets stay between.
const LN_LENGTH: [f64; 2] = [-4.0, 4.0];
const LN_NUGGET: [f64; 2] = [-5.0, 0.0];
/// The same of the scale over the values' root mean square, which it starts from (one where that is less): log likelihoods in the
/// prior are thousands below the best one.
const LN_SCALE: [f64; 2] = [-6.0, 6.0];
/// Evaluations of the evidence per number that is searched: for lengths alone, for lengths that a further search begins from, and by
/// that. Three times as many give no better answers at 50 simulations.
const SEARCH: [usize; 3] = [40, 20, 30];
/// Most parameters whose coordinates are mixed and bent.
const MOST_MIXED: usize = 4;

/// What the numbers of a point of the search stand for: logarithms of the scale, of the lengths and of the factor on the nuggets; then
/// how coordinates are mixed and bent.
struct Searched {
    d: usize,
    shape: Shape,
    size: f64,
    /// What the scale is measured in.
    unit: f64,
}

impl Searched {
    /// Numbers of lengths alone.
    fn numbers(&self) -> usize {
        self.d + 2
    }

    /// Numbers of how coordinates are mixed, and of how they are bent: those of a cube.
    fn further(&self, cube: bool) -> [usize; 2] {
        let d = self.d;
        if d > MOST_MIXED { [0, 0] } else { [d * (d - 1) / 2, if cube { d } else { 0 }] }
    }

    fn clamped(&self, i: usize, x: f64) -> f64 {
        let [least, most] = match i {
            0 => LN_SCALE,
            i if i <= self.d => LN_LENGTH,
            i if i == self.d + 1 => LN_NUGGET,
            i if i < self.numbers() + self.further(false)[0] => return x,
            _ => [-MOST_BENT, MOST_BENT],
        };
        x.clamp(least, most)
    }

    fn kernel(&self, x: &[f64]) -> Kernel {
        let Self { d, shape, size, unit } = *self;
        let at = |i: usize| self.clamped(i, x[i]);
        let first = self.numbers();
        let bent = x.len().min(first + self.further(false)[0]);
        let metric = Metric {
            lengths: (1..=d).map(|i| at(i).exp()).collect(),
            mixed: (first..bent).map(at).collect(),
            bent: (bent..x.len()).map(at).collect(),
        };
        Kernel::Searched { shape, size, scale: unit * at(0).exp(), metric, nugget: at(d + 1).exp() }
    }

    /// Axes of the first simplex of so many numbers.
    fn axes(&self, numbers: usize) -> Vec<f64> {
        let mut axes = vec![0.0; numbers * numbers];
        (0..numbers).for_each(|i| axes[i * numbers + i] = STEP);
        axes[(self.d + 1) * (numbers + 1)] = -STEP;
        axes
    }
}

impl Samples<'_> {
    /// The covariance of this shape of largest evidence: its lengths first, and from there with coordinates that are mixed and, those of
    /// a cube, bent.
    pub(super) fn searched_kernel(
        &self,
        m: usize,
        shape: Shape,
        size: f64,
        cube: bool,
    ) -> Option<Kernel> {
        // The size of coefficients is one more than the mean square.
        let searched = Searched { d: self.d, shape, size, unit: (size - 1.0).sqrt().max(1.0) };
        let numbers = searched.numbers();
        let starts = STARTS.map(|length| {
            let mut point = vec![length.ln(); numbers];
            point[0] = 0.0;
            point[self.d + 1] = 0.0;
            Start { point, axes: searched.axes(numbers) }
        });
        let mut evidence = |x: &[f64]| {
            let off = |(i, x): (usize, &f64)| (x - searched.clamped(i, *x)).abs();
            let beyond: f64 = x.iter().enumerate().map(off).sum();
            self.evidence(m, &searched.kernel(x)) - beyond
        };
        let all = numbers + searched.further(cube).iter().sum::<usize>();
        let each = SEARCH[usize::from(all > numbers)];
        let (mut x, best, _) = best_of(&starts, each * numbers, &mut evidence);
        if !best.is_finite() {
            return None;
        }
        if all > numbers {
            x.resize(all, 0.0);
            (x, ..) = maximise(&x, &searched.axes(all), SEARCH[2] * all, &mut evidence);
        }
        Some(searched.kernel(&x))
    }
}
