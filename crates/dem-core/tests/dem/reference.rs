//! References that share no code with the solvers: rates written out from the paper, quadrature of
//! `dt = dx/rate`, and extrapolation of the midpoint rule for the equations of motion.

use std::f64::consts::PI;

use dem_core::printed::from_printed;
use dem_core::{
    Kinetics, PairScene, PairSpec, Powder, Sintering, SolverKind, SolverSettings, paper,
};

/// The three pairs of the paper with the parameters of its Table 3, and a relaxation time.
pub(crate) fn materials() -> [(PairScene, Sintering); 3] {
    let material = |powder: Powder, table, phi| {
        let scene = PairSpec::new(powder, phi).build().expect("the paper's powders");
        let sintering = from_printed(table, powder.radius_m);
        (scene, Sintering { lambda: 0.7 * sintering.tau_s, ..sintering })
    };
    [
        material(paper::PS, &paper::PS_TABLE3, 1.08),
        material(paper::PA12, &paper::PA12_TABLE3, 2f64.cbrt()),
        material(paper::PEEK_450PF, &paper::PEEK_450PF_TABLE3, 2f64.cbrt()),
    ]
}

/// The largest difference between two curves at the same times.
pub(crate) fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

pub(crate) fn quasi_static(tolerance: f64) -> SolverSettings {
    SolverSettings { tolerance, ..SolverSettings::of(SolverKind::QuasiStatic) }
}

pub(crate) fn verlet(step_over_collision_time: f64) -> SolverSettings {
    SolverSettings { step_over_collision_time, ..SolverSettings::of(SolverKind::Verlet) }
}

/// `dx/dt` \[1/s\], from the equations as they are printed.
pub(crate) fn rate(scene: &PairScene, kinetics: Kinetics, s: &Sintering, x: f64) -> f64 {
    let r = scene.radius_m();
    let gamma = scene.powder().surface_tension_n_per_m;
    let b = 63.0 * PI.powi(3) / 16.0 * (s.delta_c / r).powi(2) * (2.0 * s.c1 * gamma / r);
    let zipping = 2.0 / 7.0 * b * x.powf(-2.5);
    let switch = switch(scene, kinetics, s);
    match kinetics {
        _ if x < switch => zipping,
        Kinetics::Pokluda | Kinetics::ThreeStagePokluda => pokluda(x) / s.tau_s,
        Kinetics::Bellehumeur => bellehumeur(x, s),
        _ => 1.0 / s.tau_s,
    }
}

/// Overlap at which zipping ends.
pub(crate) fn switch(scene: &PairScene, kinetics: Kinetics, s: &Sintering) -> f64 {
    let r = scene.radius_m();
    let gamma = scene.powder().surface_tension_n_per_m;
    match kinetics {
        Kinetics::Frenkel | Kinetics::Pokluda | Kinetics::Bellehumeur => 0.0,
        Kinetics::ThreeStage | Kinetics::ThreeStagePokluda => {
            ((63.0 * PI.powi(3)).powf(0.2) * (s.delta_c / (8.0 * r)).powf(0.4)).powi(2)
        }
        Kinetics::RegimeMap => {
            let b = 63.0 * PI.powi(3) / 16.0 * (s.delta_c / r).powi(2) * (2.0 * s.c1 * gamma / r);
            (b * s.tau_s).powf(0.4)
        }
    }
}

/// `tau_s dx/dt` of Pokluda's law, by the angle as published.
fn pokluda(x: f64) -> f64 {
    let t = angle(x);
    let c = t.cos();
    let dtheta =
        2f64.powf(-5.0 / 3.0) * c * t.sin() * (2.0 - c).cbrt() / ((1.0 - c) * (1.0 + c).cbrt());
    x * log_slope(t) * dtheta
}

/// `dx/dt` of Bellehumeur's law, by the angle: the positive root of the quadratic equation as published, alpha = 1.
fn bellehumeur(x: f64, s: &Sintering) -> f64 {
    let t = angle(x);
    let (c, sin) = (t.cos(), t.sin());
    let k1 = sin / ((1.0 + c) * (2.0 - c));
    let k2 =
        2f64.powf(-5.0 / 3.0) * c * sin / ((1.0 + c).powf(4.0 / 3.0) * (2.0 - c).powf(5.0 / 3.0));
    let squared = 8.0 * (s.lambda * k1).powi(2);
    let linear = 2.0 * s.lambda * k1 + s.tau_s * k1 * k1 / k2;
    let dtheta = 2.0 / (linear + (linear * linear + 4.0 * squared).sqrt());
    x * log_slope(t) * dtheta
}

/// Half angle of a neck at constant volume, by bisection from x.
fn angle(x: f64) -> f64 {
    let overlap = |t: f64| {
        let c = t.cos();
        (t.sin() * (4.0 / ((1.0 + c).powi(2) * (2.0 - c))).cbrt()).powi(2)
    };
    let (mut low, mut high) = (1e-9, PI / 2.0);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if overlap(middle) < x { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// `d ln(x)/d theta = 2 [cot + (2/3) sin/(1 + c) - (1/3) sin/(2 - c)]`.
fn log_slope(t: f64) -> f64 {
    let c = t.cos();
    2.0 * (c / t.sin() + 2.0 / 3.0 * t.sin() / (1.0 + c) - t.sin() / (3.0 * (2.0 - c)))
}

/// Time \[s\] from the overlap `from` to `to`, by composite Gauss-Legendre quadrature of `dx/rate`,
/// piecewise at the switch, with panels doubled until the result stops moving.
pub(crate) fn time_between(
    scene: &PairScene,
    kinetics: Kinetics,
    s: &Sintering,
    from: f64,
    to: f64,
) -> f64 {
    let switch = switch(scene, kinetics, s);
    if from < switch && switch < to {
        return smooth_time(scene, kinetics, s, from, switch * (1.0 - 1e-16))
            + smooth_time(scene, kinetics, s, switch, to);
    }
    smooth_time(scene, kinetics, s, from, to)
}

fn smooth_time(scene: &PairScene, kinetics: Kinetics, s: &Sintering, from: f64, to: f64) -> f64 {
    // Nodes and weights of the five-point rule.
    let (a, b) = (
        (5.0 - 2.0 * (10f64 / 7.0).sqrt()).sqrt() / 3.0,
        (5.0 + 2.0 * (10f64 / 7.0).sqrt()).sqrt() / 3.0,
    );
    let (wa, wb) = ((322.0 + 13.0 * 70f64.sqrt()) / 900.0, (322.0 - 13.0 * 70f64.sqrt()) / 900.0);
    let nodes = [(0.0, 128.0 / 225.0), (a, wa), (-a, wa), (b, wb), (-b, wb)];
    let integral = |panels: usize| {
        let width = (to - from) / panels as f64;
        (0..panels)
            .map(|i| {
                let centre = from + (i as f64 + 0.5) * width;
                nodes
                    .iter()
                    .map(|(at, weight)| {
                        let x = centre + 0.5 * width * at;
                        0.5 * width * weight / rate(scene, kinetics, s, x)
                    })
                    .sum::<f64>()
            })
            .sum::<f64>()
    };
    let (mut panels, mut last) = (64, integral(32));
    loop {
        let next = integral(panels);
        if (next - last).abs() <= 3e-15 * next.abs() || panels > 20_000 {
            return next;
        }
        (panels, last) = (2 * panels, next);
    }
}

/// The equations of motion of the pair, `d(x, x', p)/dt`, straight from the law.
pub(crate) fn motion(
    scene: &PairScene,
    kinetics: Kinetics,
    s: &Sintering,
    [x, v, p]: [f64; 3],
) -> [f64; 3] {
    let law = scene.law();
    let (k1, m) = (scene.k1_n_per_m(), scene.effective_mass_kg());
    let phi2 = scene.final_contact_ratio().powi(2);
    let slope = (law.k2_max - 1.0) / phi2;
    let kappa = (1.0 + slope * p).min(law.k2_max);
    let f_ep = kappa * (x - p);
    let dissipated = scene.dissipation_kg_per_s() * v / k1;
    let acceleration = k1 / m * (law.adhesion - f_ep - dissipated);
    let full = p + law.adhesion / kappa >= phi2;
    let growth = if full { 0.0 } else { rate(scene, kinetics, s, x.max(scene.x0())) };
    let equilibrium = 1.0 / (1.0 - slope * law.adhesion / (kappa * kappa));
    [v, acceleration, (f_ep + dissipated) / law.adhesion * growth * equilibrium]
}

/// Integrates `y' = f(y)` to each time by extrapolation of the modified midpoint rule (Gragg,
/// Bulirsch, Stoer) with its own step control.
pub(crate) fn integrate<const N: usize>(
    f: impl Fn([f64; N]) -> [f64; N],
    mut y: [f64; N],
    times_s: &[f64],
    tolerance: f64,
    first_step_s: f64,
) -> Vec<[f64; N]> {
    let mut t = 0.0;
    let mut step = first_step_s;
    let mut out = Vec::new();
    for &until in times_s {
        while t < until {
            let h = step.min(until - t);
            let (next, error) = extrapolate(&f, y, h);
            let relative = error / tolerance;
            if relative <= 1.0 {
                (t, y) = (if h < until - t { t + h } else { until }, next);
            }
            let change = 0.9 * relative.max(1e-10).powf(-1.0 / 13.0);
            step = h * change.clamp(0.2, 2.0).min(if relative <= 1.0 { 2.0 } else { 0.7 });
        }
        out.push(y);
    }
    out
}

fn extrapolate<const N: usize>(
    f: &impl Fn([f64; N]) -> [f64; N],
    y: [f64; N],
    h: f64,
) -> ([f64; N], f64) {
    let add =
        |a: [f64; N], s: f64, b: [f64; N]| -> [f64; N] { std::array::from_fn(|i| a[i] + s * b[i]) };
    let mut rows: Vec<Vec<[f64; N]>> = Vec::new();
    for k in 0..7 {
        let n = 2 * (k + 1);
        let g = h / n as f64;
        let (mut before, mut now) = (y, add(y, g, f(y)));
        for _ in 1..n {
            (before, now) = (now, add(before, 2.0 * g, f(now)));
        }
        let smoothed: [f64; N] = {
            let ahead = add(before, g, f(now));
            std::array::from_fn(|i| 0.5 * (now[i] + ahead[i]))
        };
        let mut row = vec![smoothed];
        for j in 1..=k {
            let ratio = ((k + 1) as f64 / (k + 1 - j) as f64).powi(2);
            let (better, lower) = (row[j - 1], rows[k - 1][j - 1]);
            row.push(std::array::from_fn(|i| better[i] + (better[i] - lower[i]) / (ratio - 1.0)));
        }
        rows.push(row);
    }
    let last = &rows[6];
    let error = (0..N).map(|i| (last[6][i] - last[5][i]).abs()).fold(0.0, f64::max);
    (last[6], error)
}
