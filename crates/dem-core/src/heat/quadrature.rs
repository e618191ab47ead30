//! Adaptive quadrature of a smooth positive function.

/// Kronrod's 15 points on -1..1 and their weights; every second point is one of Gauss's seven.
///
/// R. Piessens, E. de Doncker-Kapenga, C. Überhuber, D. Kahaner, *QUADPACK*, Springer 1983.
const POINTS: [f64; 8] = [
    0.991_455_371_120_812_6,
    0.949_107_912_342_758_5,
    0.864_864_423_359_769_1,
    0.741_531_185_599_394_4,
    0.586_087_235_467_691_1,
    0.405_845_151_377_397_2,
    0.207_784_955_007_898_47,
    0.0,
];
const KRONROD: [f64; 8] = [
    0.022_935_322_010_529_224,
    0.063_092_092_629_978_55,
    0.104_790_010_322_250_18,
    0.140_653_259_715_525_92,
    0.169_004_726_639_267_9,
    0.190_350_578_064_785_4,
    0.204_432_940_075_298_9,
    0.209_482_141_084_727_82,
];
const GAUSS: [f64; 4] = [
    0.129_484_966_168_869_7,
    0.279_705_391_489_276_64,
    0.381_830_050_505_118_9,
    0.417_959_183_673_469_4,
];

/// An interval with the integral over it and its error.
struct Panel {
    from: f64,
    to: f64,
    integral: f64,
    error: f64,
}

impl Panel {
    fn new(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> Self {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let centre = f(middle);
        let (mut kronrod, mut gauss) = (KRONROD[7] * centre, GAUSS[3] * centre);
        for (i, (point, weight)) in POINTS[..7].iter().zip(KRONROD).enumerate() {
            let both = f(middle - half * point) + f(middle + half * point);
            kronrod += weight * both;
            if i % 2 == 1 {
                gauss += GAUSS[i / 2] * both;
            }
        }
        let (integral, difference) = (kronrod * half, ((kronrod - gauss) * half).abs());
        // The error of Gauss's rule; Kronrod's is about its power 3/2, relative to the integral (QUADPACK).
        let relative = if integral > 0.0 { difference / integral } else { 0.0 };
        let error = integral * (200.0 * relative).powf(1.5).min(1.0);
        Self { from, to, integral, error }
    }
}

/// Intervals at most. It is never reached by a mobility law: one interval is the rule, ten are many.
const LARGEST_NUMBER: usize = 400;

/// The integral of a smooth positive function, to a relative or an absolute error, whichever is larger.
///
/// The interval with the largest error is halved until the sum of the errors is small enough.
pub(super) fn integrate(
    f: impl Fn(f64) -> f64,
    from: f64,
    to: f64,
    (relative, absolute): (f64, f64),
) -> f64 {
    let first = Panel::new(&f, from, to);
    if first.error <= (relative * first.integral).max(absolute) {
        return first.integral;
    }
    let mut panels = vec![first];
    loop {
        let error: f64 = panels.iter().map(|panel| panel.error).sum();
        let integral: f64 = panels.iter().map(|panel| panel.integral).sum();
        if error <= (relative * integral).max(absolute) || panels.len() >= LARGEST_NUMBER {
            return integral;
        }
        let worst = (0..panels.len()).max_by(|&a, &b| panels[a].error.total_cmp(&panels[b].error));
        let Some(worst) = worst else { return integral };
        let Panel { from, to, .. } = panels[worst];
        let middle = 0.5 * (from + to);
        panels[worst] = Panel::new(&f, from, middle);
        panels.push(Panel::new(&f, middle, to));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_of_peaks_and_decays_are_those_of_their_closed_forms() {
        let tolerance = (1e-12, 0.0);
        for steepness in [0.0, 1e-3, 1.0, 30.0, 460.0] {
            let found = integrate(|t| (-steepness * t).exp(), 0.0, 1.0, tolerance);
            let exact = if steepness == 0.0 { 1.0 } else { -(-steepness).exp_m1() / steepness };
            assert!((found / exact - 1.0).abs() < 1e-12, "{steepness}: {found} {exact}");
        }
        // A smooth step: integral of 1/(1 + exp(-a (t - 1/2))) is 1/2.
        for steepness in [1.0, 20.0, 300.0] {
            let found =
                integrate(|t| 1.0 / (1.0 + (-steepness * (t - 0.3)).exp()), 0.0, 1.0, tolerance);
            let part = |t: f64| (1.0 + (steepness * (t - 0.3)).exp()).ln() / steepness;
            let exact = part(1.0) - part(0.0);
            assert!((found / exact - 1.0).abs() < 1e-12, "{steepness}: {found} {exact}");
        }
    }
}
