//! The search for the covariance of largest evidence, times the prior of its metric, among those with a metric.

use super::kernel::{Kernel, Samples, Shape};
use super::metric::{MOST_BENT, Metric};
use crate::nelder_mead::{Start, best_of, maximise};

/// Lengths that the search starts from; the prior's cube is two wide.
const STARTS: [f64; 3] = [0.5, 1.5, 4.0];
/// First step of the search, of logarithms, mixes and bends alike.
const STEP: f64 = 0.7;
/// Logarithms that lengths and the factor on the nuggets stay between.
const LN_LENGTH: [f64; 2] = [-4.0, 4.0];
const LN_NUGGET: [f64; 2] = [-5.0, 0.0];
/// The same of the scale over the values' root mean square, which it starts from (one where that is less): log likelihoods in the
/// prior are thousands below the best one.
const LN_SCALE: [f64; 2] = [-6.0, 6.0];
/// Evaluations of the evidence per number that is searched: for lengths alone, for lengths that a further search begins from, and in
/// that further search. Three times as many give no better answers at 50 simulations.
const SEARCH: [usize; 3] = [40, 20, 30];
/// Most parameters whose coordinates are mixed and bent, where there are several columns. One column (log likelihoods, failures) says
/// too little of that: with mixes and bends the bounded ridge was .08 posterior standard deviations off by 100 simulations, without
/// them .03; the banana .03 and .01.
const MOST_MIXED: usize = 4;

/// What the numbers of a point of the search stand for: logarithms of the scale, of the lengths and of the factor on the nuggets; then
/// how coordinates are mixed and bent.
struct Searched {
    d: usize,
    shape: Shape,
    size: f64,
    /// What the scale is measured in.
    unit: f64,
    /// Whether coordinates are mixed and bent.
    mixed: bool,
}

impl Searched {
    /// Numbers of lengths alone.
    fn numbers(&self) -> usize {
        self.d + 2
    }

    /// Numbers of how coordinates are mixed.
    fn mixes(&self) -> usize {
        if self.mixed { self.d * (self.d - 1) / 2 } else { 0 }
    }

    /// Numbers of how those of a cube are bent.
    fn bends(&self) -> usize {
        if self.mixed { self.d } else { 0 }
    }

    /// The nearest number within its limits; mixes have none, their prior holds them.
    fn clamped(&self, i: usize, x: f64) -> f64 {
        let [least, most] = match i {
            0 => LN_SCALE,
            i if i <= self.d => LN_LENGTH,
            i if i == self.d + 1 => LN_NUGGET,
            i if i < self.numbers() + self.mixes() => return x,
            _ => [-MOST_BENT, MOST_BENT],
        };
        x.clamp(least, most)
    }

    fn kernel(&self, x: &[f64]) -> Kernel {
        let Self { d, shape, size, unit, .. } = *self;
        let at = |i: usize| self.clamped(i, x[i]);
        let first = self.numbers();
        let bent = x.len().min(first + self.mixes());
        let metric = Metric {
            lengths: (1..=d).map(|i| at(i).exp()).collect(),
            mixed: (first..bent).map(at).collect(),
            bent: (bent..x.len()).map(at).collect(),
        };
        Kernel { shape, size, scale: unit * at(0).exp(), metric, nugget: at(d + 1).exp() }
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
    /// The covariance of this shape of largest evidence, times the prior of its metric: its lengths first, and from there, of several
    /// columns, with coordinates that are mixed and, those of a cube, bent.
    pub(super) fn searched_kernel(
        &self,
        m: usize,
        shape: Shape,
        size: f64,
        cube: bool,
    ) -> Option<Kernel> {
        let mixed = m > 1 && self.d <= MOST_MIXED;
        // The size of coefficients is one more than the mean square.
        let unit = (size - 1.0).sqrt().max(1.0);
        let searched = Searched { d: self.d, shape, size, unit, mixed };
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
        let all = numbers + searched.mixes() + if cube { searched.bends() } else { 0 };
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

    /// The metric that is found for 24 samples of `m` equal columns, a function of the first two of `d` coordinates.
    fn metric([d, m]: [usize; 2], cube: bool, value: impl Fn(f64, f64) -> f64) -> Metric {
        const STEPS: [f64; 5] =
            [0.754_877_67, 0.569_840_29, 0.414_213_56, 0.732_050_81, 0.236_067_98];
        let points: Vec<f64> = (0..24)
            .flat_map(|i| STEPS[..d].iter().map(move |by| (f64::from(i) + 0.5) * by))
            .map(|x| 2.0 * x.fract() - 1.0)
            .collect();
        let values: Vec<f64> =
            points.chunks_exact(d).flat_map(|x| vec![value(x[0], x[d.min(2) - 1]); m]).collect();
        let samples = Samples { d, points: &points, values: &values, nuggets: &[1e-3; 24] };
        samples.searched_kernel(m, Shape::Matern, 2.0, cube).expect("definite").metric
    }

    #[test]
    fn of_several_columns_up_to_four_coordinates_are_mixed_and_those_of_a_cube_are_bent() {
        for d in 1..=5 {
            for (m, cube) in [(1, false), (1, true), (2, false), (2, true)] {
                let metric = metric([d, m], cube, |x, y| x * y);
                let mixed = if d > 4 || m == 1 { 0 } else { d * (d - 1) / 2 };
                let bent = if d > 4 || m == 1 || !cube { 0 } else { d };
                assert_eq!((metric.lengths.len(), metric.mixed.len()), (d, mixed));
                assert_eq!(metric.bent.len(), bent, "{d} {m} {cube}");
            }
        }
    }

    /// Distances from the middle of the cube along these steps, by the metric that is found.
    fn distances<const N: usize>(
        value: impl Fn(f64, f64) -> f64,
        steps: [[f64; 2]; N],
    ) -> [f64; N] {
        let metric = metric([2, 2], true, value);
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
