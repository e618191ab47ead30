//! Maximum of a smooth function within a box, from its slopes: the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno, with
//! steps that end at the sides of the box.
//!
//! J. Nocedal, S. J. Wright, Numerical Optimization (2006), section 6.1; D. P. Bertsekas, SIAM J. Control Optim. 20 (1982) 221.

use crate::cholesky::dot;

/// Largest change of a number by one step, and by the first.
const MOST: f64 = 1.5;
const FIRST: f64 = 0.5;
/// Share of what its slope promises that a step must give.
const LEAST_GAIN: f64 = 1e-4;
/// What a step that gives less is shortened by, at most and at least.
const SHORTER: [f64; 2] = [0.1, 0.5];
/// Promised gain below which nothing is left to be done.
const SETTLED: f64 = 1e-3;

/// A value of a function, and its slopes there.
pub(crate) type Sloped = (f64, Vec<f64>);

/// Maximises a function from `start`, every number between two limits, with at most so many evaluations of it and its slopes, one at least;
/// the best point and its value, which is `NEG_INFINITY` where the function has none at the start.
pub(crate) fn climb(
    start: &[f64],
    limits: &[[f64; 2]],
    evaluations: usize,
    of: &mut dyn FnMut(&[f64]) -> Option<Sloped>,
) -> (Vec<f64>, f64) {
    let mut x = start.to_vec();
    let Some((mut value, mut slopes)) = of(&x) else { return (x, f64::NEG_INFINITY) };
    let mut inverse = Inverse::new(x.len());
    let mut used = 1;
    while used < evaluations {
        let held = |i: usize| {
            let [least, most] = limits[i];
            x[i] <= least && slopes[i] < 0.0 || x[i] >= most && slopes[i] > 0.0
        };
        let free: Vec<bool> = (0..x.len()).map(|i| !held(i)).collect();
        let of_free = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&free).map(|(v, free)| if *free { *v } else { 0.0 }).collect()
        };
        let step = of_free(&inverse.times(&of_free(&slopes)));
        let promised = dot(&step, &slopes);
        if promised.is_nan() || promised < SETTLED {
            break;
        }
        let longest = step.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
        let mut length = (MOST / longest).min(1.0);
        let found = loop {
            if used == evaluations || length * promised < SETTLED {
                break None;
            }
            let ends = x.iter().zip(&step).zip(limits);
            let next: Vec<f64> =
                ends.map(|((x, s), [least, most])| (x + length * s).clamp(*least, *most)).collect();
            let moved: Vec<f64> = next.iter().zip(&x).map(|(next, x)| next - x).collect();
            let by_slope = dot(&moved, &slopes);
            used += 1;
            let at_next = of(&next);
            match at_next {
                Some((v, s)) if v - value >= LEAST_GAIN * by_slope.max(0.0) => {
                    break Some((next, moved, v, s));
                }
                Some((v, _)) => {
                    // The top of the parabola through both values and the slope.
                    let bent = 2.0 * (by_slope - (v - value));
                    let shorter = if bent > 0.0 { by_slope / bent } else { SHORTER[1] };
                    length *= shorter.clamp(SHORTER[0], SHORTER[1]);
                }
                None => length *= SHORTER[0],
            }
        };
        let Some((next, moved, next_value, next_slopes)) = found else { break };
        let bent: Vec<f64> = slopes.iter().zip(&next_slopes).map(|(a, b)| a - b).collect();
        inverse.update(&moved, &of_free(&bent));
        (x, value, slopes) = (next, next_value, next_slopes);
    }
    (x, value)
}

/// Inverse of the negative curvature, row by row; nothing is known of it before the first step.
struct Inverse {
    rows: Vec<f64>,
    known: bool,
}

impl Inverse {
    fn new(n: usize) -> Self {
        Self { rows: vec![0.0; n * n], known: false }
    }

    /// Its product with some slopes; before anything is known of it they are taken to a largest change of [`FIRST`].
    fn times(&self, slopes: &[f64]) -> Vec<f64> {
        if self.known {
            return self.rows.chunks_exact(slopes.len()).map(|row| dot(row, slopes)).collect();
        }
        let steepest = slopes.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
        slopes.iter().map(|s| if steepest > 0.0 { FIRST * s / steepest } else { 0.0 }).collect()
    }

    /// With what a step along `moved` has shown: slopes fell by `bent`. The first one gives it its scale.
    fn update(&mut self, moved: &[f64], bent: &[f64]) {
        let (n, along) = (moved.len(), dot(moved, bent));
        if along.is_nan() || along <= 1e-9 * (dot(moved, moved) * dot(bent, bent)).sqrt() {
            return;
        }
        if !self.known {
            let scale = along / dot(bent, bent);
            (0..n).for_each(|i| self.rows[i * n + i] = scale);
            self.known = true;
        }
        let by: Vec<f64> = self.rows.chunks_exact(n).map(|row| dot(row, bent)).collect();
        let factor = (1.0 + dot(&by, bent) / along) / along;
        for (i, row) in self.rows.chunks_exact_mut(n).enumerate() {
            for (j, h) in row.iter_mut().enumerate() {
                *h += factor * moved[i] * moved[j] - (by[i] * moved[j] + moved[i] * by[j]) / along;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_bent_ridge_is_found_within_its_sides() {
        let ridge = |x: &[f64]| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            let slopes = vec![2.0 * a + 80.0 * b * x[0], -40.0 * b];
            Some((-a * a - 20.0 * b * b, slopes))
        };
        let climbed = |most: f64| climb(&[-1.2, 1.0], &[[-2.0, most]; 2], 80, &mut { ridge });
        let (x, value) = climbed(2.0);
        assert!((x[0] - 1.0).abs() < 0.05 && (x[1] - 1.0).abs() < 0.1, "{x:?} {value}");
        assert!(value > -1e-3, "{value}");
        // At a side the best along it.
        let (x, _) = climbed(0.5);
        assert!(x[0] == 0.5 && (x[1] - 0.25).abs() < 0.01, "{x:?}");
    }

    #[test]
    fn numbers_at_a_side_that_would_go_beyond_it_have_no_part_in_the_others() {
        // However steep it is there.
        let mut steep =
            |x: &[f64]| Some((1e4 * x[1] - (x[0] - 1.0).powi(2), vec![-2.0 * (x[0] - 1.0), 1e4]));
        let (x, _) = climb(&[0.0; 2], &[[-9.0, 9.0], [-9.0, 0.0]], 20, &mut steep);
        assert!((x[0] - 1.0).abs() < 0.05, "{x:?}");
        // However its slope changes with the others.
        let mut changing = |x: &[f64]| {
            let fall = (-x[0]).exp();
            let value = 100.0 * x[2] * fall - (x[0] - 3.0).powi(2) - 0.1 * (x[1] - 3.0).powi(2);
            let by_first = -2.0 * (x[0] - 3.0) - 100.0 * x[2] * fall;
            Some((value, vec![by_first, -0.2 * (x[1] - 3.0), 100.0 * fall]))
        };
        let limits = [[-9.0, 9.0], [-9.0, 9.0], [-9.0, 0.0]];
        let (x, _) = climb(&[0.0; 3], &limits, 20, &mut changing);
        assert!((x[0] - 3.0).abs() < 0.1 && (x[1] - 3.0).abs() < 0.2, "{x:?}");
    }

    #[test]
    fn the_scale_is_that_of_the_first_step_that_was_taken_however_often_it_was_shortened() {
        let stiff = |i: usize| 1000.0 * (i + 1) as f64;
        let mut bowl = |x: &[f64]| {
            let value = x.iter().enumerate().map(|(i, x)| -0.5 * stiff(i) * x * x).sum();
            Some((value, x.iter().enumerate().map(|(i, x)| -stiff(i) * x).collect()))
        };
        let (_, value) = climb(&[1.0; 5], &[[-9.0, 9.0]; 5], 12, &mut bowl);
        assert!(value > -0.05, "{value}");
    }

    #[test]
    fn nothing_is_asked_outside_the_box_or_more_often_than_is_allowed() {
        for most in 1..40 {
            let mut asked = 0;
            let mut plane = |x: &[f64]| {
                asked += 1;
                assert!(x.iter().all(|x| (-1.0..=1.0).contains(x)), "{x:?}");
                Some((3.0 * x[0] - x[1], vec![3.0, -1.0]))
            };
            let (x, value) = climb(&[0.0, 0.0], &[[-1.0, 1.0]; 2], most, &mut plane);
            assert!(asked <= most, "{asked} {most}");
            if most >= 9 {
                assert!((x[0] - 1.0).hypot(x[1] + 1.0) < 1e-12 && value > 4.0 - 1e-9, "{x:?}");
            }
        }
        let (x, value) = climb(&[0.3], &[[-1.0, 1.0]], 9, &mut |_| None);
        assert_eq!((x, value), (vec![0.3], f64::NEG_INFINITY));
    }

    #[test]
    fn where_the_function_ends_steps_are_shortened() {
        // A logarithm that ends at 0; its top is where 1/x = 4.
        let mut value =
            |x: &[f64]| (x[0] > 0.0).then(|| (x[0].ln() - 4.0 * x[0], vec![1.0 / x[0] - 4.0]));
        let (x, _) = climb(&[1.2], &[[-9.0, 9.0]], 40, &mut value);
        assert!((x[0] - 0.25).abs() < 0.02, "{x:?}");
    }
}
