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

#[cfg(test)]
mod tests {
    use super::*;

    /// Distances from the middle of the cube along these steps, by the covariance that is found for 24 samples of a function.
    fn distances<const N: usize>(
        value: impl Fn(f64, f64) -> f64,
        steps: [[f64; 2]; N],
    ) -> [f64; N] {
        let part = |i: usize, by: f64| 2.0 * ((i as f64 + 0.5) * by).fract() - 1.0;
        let points: Vec<f64> =
            (0..24).flat_map(|i| [part(i, 0.754_877_67), part(i, 0.569_840_29)]).collect();
        let values: Vec<f64> = points.chunks_exact(2).map(|x| value(x[0], x[1])).collect();
        let samples = Samples { d: 2, points: &points, values: &values, nuggets: &[1e-3; 24] };
        let found = samples.searched_kernel(1, Shape::Matern, 2.0, true).expect("definite");
        let Kernel::Searched { metric, .. } = found else { panic!("{found:?}") };
        let at = |x: [f64; 2]| {
            let mut measured = [0.0; 2];
            metric.of(&x, &mut measured);
            measured
        };
        let middle = at([0.0; 2]);
        steps.map(|step| {
            let end = at(step);
            (end[0] - middle[0]).hypot(end[1] - middle[1])
        })
    }

    #[test]
    fn what_depends_on_the_sum_of_two_coordinates_is_alike_along_their_difference() {
        let [along, across] = distances(|x, y| (3.0 * (x + y)).sin(), [[0.5, -0.5], [0.5, 0.5]]);
        assert!(across > 5.0 * along, "{across} {along}");
    }

    #[test]
    fn what_changes_at_one_end_of_a_coordinate_has_shorter_lengths_there() {
        let [low, high] =
            distances(|x, y| (4.0 * x).exp() / 20.0 + 0.1 * y, [[-1.0, 0.0], [1.0, 0.0]]);
        assert!(high > 2.0 * low, "{low} {high}");
    }
}
