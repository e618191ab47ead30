//! Maximum of a function of several variables: Nelder and Mead's simplex from several starts.
//!
//! J. A. Nelder, R. Mead, "A simplex method for function minimization", Computer Journal 7 (1965) 308.

use crate::cholesky::add_multiple;

/// A place to start from and the axes of its first simplex, row by row: start + axis is a corner.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    pub point: Vec<f64>,
    pub axes: Vec<f64>,
}

/// Maximises `value` from several starts with at most about `budget` evaluations in all.
///
/// In rounds: every start is searched a little, the better half goes on from where it is with smaller simplices,
/// until one is left, which gets the rest. Ties go to the earlier start. Returns the best point, its value, and
/// the evaluations used.
pub(crate) fn best_of(
    starts: &[Start],
    budget: usize,
    value: &mut dyn FnMut(&[f64]) -> f64,
) -> (Vec<f64>, f64, usize) {
    let mut rounds = 1;
    while starts.len() >> rounds > 0 {
        rounds += 1;
    }
    let share = budget / rounds;
    let mut field: Vec<(Start, f64)> =
        starts.iter().map(|s| (s.clone(), f64::NEG_INFINITY)).collect();
    let mut used = 0;
    let mut best = (starts.first().map_or_else(Vec::new, |s| s.point.clone()), f64::NEG_INFINITY);
    while !field.is_empty() && used < budget {
        let last = field.len() == 1;
        let each = if last { budget - used } else { share / field.len() };
        for (start, reached) in &mut field {
            let (x, v, n) = maximise(&start.point, &start.axes, each, value);
            used += n;
            if v > *reached {
                (start.point, *reached) = (x, v);
            }
            start.axes.iter_mut().for_each(|a| *a *= 0.5);
        }
        // Stable: equal values stay in the order of their starts.
        field.sort_by(|a, b| b.1.total_cmp(&a.1));
        if field[0].1 > best.1 {
            best = (field[0].0.point.clone(), field[0].1);
        }
        if last {
            break;
        }
        field.truncate(field.len().div_ceil(2));
    }
    (best.0, best.1, used)
}

/// Maximises `value` from `start`, the first simplex along `axes` (row by row); at most about `budget`
/// evaluations. Returns the best point, its value, and the evaluations used.
fn maximise(
    start: &[f64],
    axes: &[f64],
    budget: usize,
    value: &mut dyn FnMut(&[f64]) -> f64,
) -> (Vec<f64>, f64, usize) {
    let d = start.len();
    let mut used = 0;
    let mut best = (start.to_vec(), f64::NEG_INFINITY);
    let mut scale = 1.0;
    // A collapsed simplex is started again, smaller, until that finds nothing better.
    while used < budget {
        let before = best.1;
        let mut call = |x: &[f64], used: &mut usize| {
            *used += 1;
            let v = value(x);
            if v.is_nan() { f64::NEG_INFINITY } else { v }
        };
        let mut simplex: Vec<(Vec<f64>, f64)> = Vec::with_capacity(d + 1);
        for i in 0..=d {
            let mut x = best.0.clone();
            if i > 0 {
                add_multiple(&mut x, scale, &axes[(i - 1) * d..i * d]);
            }
            let v = call(&x, &mut used);
            simplex.push((x, v));
        }
        loop {
            simplex.sort_by(|a, b| b.1.total_cmp(&a.1));
            let spread = simplex[0].1 - simplex[d].1;
            if used >= budget || spread.abs() < 1e-9 {
                break;
            }
            let centre: Vec<f64> = (0..d)
                .map(|j| simplex[..d].iter().map(|s| s.0[j]).sum::<f64>() / d as f64)
                .collect();
            let along = |t: f64| -> Vec<f64> {
                (0..d).map(|j| centre[j] + t * (simplex[d].0[j] - centre[j])).collect()
            };
            let reflected = along(-1.0);
            let r = call(&reflected, &mut used);
            if r > simplex[0].1 {
                let expanded = along(-2.0);
                let e = call(&expanded, &mut used);
                simplex[d] = if e > r { (expanded, e) } else { (reflected, r) };
            } else if r > simplex[d - 1].1 {
                simplex[d] = (reflected, r);
            } else {
                let contracted = if r > simplex[d].1 { along(-0.5) } else { along(0.5) };
                let c = call(&contracted, &mut used);
                if c > simplex[d].1.max(r) {
                    simplex[d] = (contracted, c);
                } else {
                    let head = simplex[0].0.clone();
                    for s in &mut simplex[1..] {
                        for (x, h) in s.0.iter_mut().zip(&head) {
                            *x = h + 0.5 * (*x - h);
                        }
                        s.1 = call(&s.0, &mut used);
                    }
                }
            }
        }
        if simplex[0].1 > best.1 {
            best = simplex.swap_remove(0);
        }
        if best.1 - before < 1e-6 {
            break;
        }
        scale *= 0.3;
    }
    (best.0, best.1, used)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_top_of_a_curved_ridge() {
        let mut ridge = |x: &[f64]| -(100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2));
        let (x, v, used) = maximise(&[-1.2, 1.0], &[0.5, 0.0, 0.0, 0.5], 1000, &mut ridge);
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] - 1.0).abs() < 1e-3 && v > -1e-6, "{x:?} {v}");
        assert!(used <= 1000);
    }

    #[test]
    fn the_higher_of_two_separated_peaks_wins_even_where_the_search_starts_lower() {
        // A wide peak of height 0 at (-2, 0) and a narrow one of height 0.02 at (3, 1); started at their feet, the
        // narrow one's far below.
        let mut peaks = |x: &[f64]| {
            let wide = -0.5 * ((x[0] + 2.0).powi(2) + x[1].powi(2));
            let narrow = 0.02 - 50.0 * ((x[0] - 3.0).powi(2) + (x[1] - 1.0).powi(2));
            wide.max(narrow)
        };
        let at = |point: [f64; 2], size: f64| Start {
            point: point.to_vec(),
            axes: vec![size, 0.0, 0.0, size],
        };
        let starts = [at([-1.9, 0.1], 0.5), at([-2.6, -0.4], 0.5), at([3.1, 1.15], 0.05)];
        let (x, v, used) = best_of(&starts, 400, &mut peaks);
        assert!((x[0] - 3.0).abs() < 1e-3 && (x[1] - 1.0).abs() < 1e-3, "{x:?} {v}");
        assert!(used <= 410, "{used}");
        let (x, ..) = best_of(&starts[..2], 400, &mut peaks);
        assert!((x[0] + 2.0).abs() < 1e-3, "{x:?}");
    }

    #[test]
    fn keeps_to_its_budget_and_survives_nan() {
        let mut calls = 0;
        let (_, v, used) = maximise(&[0.0], &[1.0], 17, &mut |x| {
            calls += 1;
            if x[0] > 0.5 { f64::NAN } else { -x[0] * x[0] }
        });
        assert!(used <= 19 && used == calls && v == 0.0, "{used} {v}");
    }
}
