//! Local search for the maximum a posteriori point: Nelder and Mead's simplex.
//!
//! J. A. Nelder, R. Mead, "A simplex method for function minimization", Computer Journal 7 (1965) 308.

/// Maximises `value` from `start` with initial steps `step`; at most `budget` evaluations. Returns the best
/// point, its value, and the evaluations used.
pub(crate) fn maximise(
    start: &[f64],
    step: &[f64],
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
                x[i - 1] += scale * step[i - 1];
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
        let (x, v, used) = maximise(&[-1.2, 1.0], &[0.5, 0.5], 1000, &mut ridge);
        assert!((x[0] - 1.0).abs() < 1e-3 && (x[1] - 1.0).abs() < 1e-3 && v > -1e-6, "{x:?} {v}");
        assert!(used <= 1000);
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
