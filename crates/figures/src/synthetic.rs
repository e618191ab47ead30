//! One figure of each kind from made-up numbers, for the tests and for looking at.

use super::{
    Axes, Band, CompareFigure, ConvergenceFigure, ConvergenceStage, CornerFigure, CornerParameter,
    Figure, FitFigure, Knee, NamedCurve, RecursionFigure, RecursionParameter, RegimeMapFigure,
    ResidualsFigure, Role, WorkPrecisionFigure, WorkPrecisionSeries,
};

/// Numbers that look random and are the same everywhere.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

fn grid(first: f64, last: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| first + (last - first) * i as f64 / (count.max(2) - 1) as f64).collect()
}

fn curve(times: &[f64], tau_s: f64) -> Vec<f64> {
    times
        .iter()
        .map(|t| (0.05 + 0.17 * (t / tau_s).min(0.4).powf(0.15) + 0.8 * t / tau_s).sqrt().min(1.26))
        .collect()
}

fn scaled(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|v| v * factor).collect()
}

fn around(values: &[f64], width: f64) -> Band {
    Band {
        lower: values.iter().map(|v| v - width).collect(),
        upper: values.iter().map(|v| v + width).collect(),
    }
}

/// All figures with `n` observations over `end_s` seconds, with short or with long names.
pub(super) fn figures(
    n: usize,
    end_s: f64,
    long_names: bool,
) -> Vec<(&'static str, Box<dyn Figure + Sync>)> {
    let title = if long_names {
        "A material with a long name, its batch, its temperature and its history (recycled powder, 2nd build)".to_owned()
    } else {
        "PA12, R = 31.5 µm".to_owned()
    };
    let mut noise = Noise(7);
    let time_s = grid(0.0, end_s, n);
    let truth = curve(&time_s, end_s / 1.8);
    let contact_ratio: Vec<f64> = truth.iter().map(|a| a + 0.03 * noise.normal()).collect();
    let grid_s = grid(0.0, end_s, 300);
    let mean = curve(&grid_s, end_s / 1.8);
    let fit = FitFigure {
        title: title.clone(),
        time_s: time_s.clone(),
        contact_ratio: contact_ratio.clone(),
        grid_s: grid_s.clone(),
        band50: around(&mean, 0.01),
        band90: around(&mean, 0.025),
        predictive90: around(&mean, 0.06),
        map: curve(&grid_s, end_s / 1.82),
        paper: curve(&grid_s, end_s / 2.1),
        frenkel: grid_s.iter().map(|t| (1.8 * t / end_s).sqrt()).collect(),
        knee: Some(Knee { time_s: 0.5, ratio: 0.5, lower: 0.45, upper: 0.55 }),
        paper_knee: Some(0.42),
        mean: mean.clone(),
        axes: Axes::default(),
        log_time: false,
    };
    let log_fit = FitFigure { log_time: true, ..fit.clone() };

    let draws = n.clamp(1, 4000);
    let mut columns: [Vec<f64>; 4] = Default::default();
    for _ in 0..draws {
        let (a, b, c) = (noise.normal(), noise.normal(), noise.normal());
        columns[0].push(-8.0 + 6.0 * noise.uniform());
        columns[1].push(0.58 + 0.013 * a);
        columns[2].push(-6.6 + 0.15 * (0.8 * a + 0.6 * b + 0.3 * a * a));
        columns[3].push(1.26 + 0.02 * c + if b > 0.0 { 0.07 } else { 0.0 });
    }
    let [c1, tau, delta, phi] = columns;
    let parameter = |symbol: &str, unit: &str, log10, draws: &[f64], prior: (f64, f64), paper| {
        CornerParameter {
            symbol: symbol.to_owned(),
            unit: unit.to_owned(),
            log10,
            draws: draws.to_vec(),
            prior: vec![(prior.0, 1.0 / (prior.1 - prior.0)), (prior.1, 1.0 / (prior.1 - prior.0))],
            paper,
            map: draws.first().copied(),
        }
    };
    let c1_name =
        if long_names { "a parameter of the user with a long name C_{1}" } else { "C_{1}" };
    let corner = CornerFigure {
        title: title.clone(),
        parameters: vec![
            parameter(c1_name, "Pa^{−1} s^{−1}", true, &c1, (-8.0, -2.0), Some(-4.1)),
            parameter("τ_{s}", "s", true, &tau, (-0.3, 1.7), Some(0.581)),
            parameter("δ_{c}", "m", true, &delta, (-8.0, -5.5), Some(-6.4)),
        ],
        weights: Vec::new(),
    };
    let mut corner_five = corner.clone();
    corner_five.parameters.push(parameter("φ", "", false, &phi, (1.0, 1.35), None));
    corner_five.parameters.push(parameter(
        "τ",
        "s",
        false,
        &scaled(&tau, 1e-3),
        (0.0, 1e-3),
        Some(5.8e-4),
    ));
    let corner_one =
        CornerFigure { parameters: vec![corner.parameters[1].clone()], ..corner.clone() };

    let narrowing = |from: f64, to: f64, width: f64| {
        let median: Vec<f64> = (0..n)
            .map(|i| to + (from - to) * (-(i as f64) / (n as f64 / 4.0 + 1.0)).exp())
            .collect();
        let spread = |z: f64| Band {
            lower: median
                .iter()
                .enumerate()
                .map(|(i, m)| m - z * width / (1.0 + i as f64).sqrt())
                .collect(),
            upper: median
                .iter()
                .enumerate()
                .map(|(i, m)| m + z * width / (1.0 + i as f64).sqrt())
                .collect(),
        };
        (median.clone(), spread(0.67), spread(1.64))
    };
    let recursion_parameter =
        |symbol: &str, unit: &str, (median, interval50, interval90), paper| RecursionParameter {
            symbol: symbol.to_owned(),
            unit: unit.to_owned(),
            log10: true,
            median,
            interval50,
            interval90,
            paper,
        };
    let recursion = RecursionFigure {
        title: title.clone(),
        control_name: "time t".to_owned(),
        control_unit: "s".to_owned(),
        control: time_s.clone(),
        log_control: false,
        parameters: vec![
            recursion_parameter(c1_name, "Pa^{−1} s^{−1}", narrowing(-5.0, -4.0, 2.0), Some(-3.5)),
            recursion_parameter("τ_{s}", "s", narrowing(0.0, 0.58, 0.4), Some(0.581)),
            recursion_parameter("δ_{c}", "m", narrowing(-7.0, -6.6, 0.3), Some(-6.5)),
        ],
        ess: (0..n).map(|i| 16384.0 / (1.0 + 0.1 * i as f64) + 20.0).collect(),
    };
    let stages = (1..=8)
        .map(f64::from)
        .map(|i| ConvergenceStage {
            simulations: 1024.0 * i + if i > 7.0 { 8192.0 } else { 0.0 },
            beta: (i / 5.0).powi(2).min(1.0),
            ess: 60.0 * i.powf(2.2),
            log_evidence: 71.3 - 4.0 / i.powi(3),
            log_evidence_error: if i < 2.0 { f64::NAN } else { 0.8 / i },
            components: (2.0 * i.sqrt()).round(),
            k_hat: if i < 3.0 { f64::NAN } else { 1.1 / i.sqrt() },
        })
        .collect();
    let convergence = ConvergenceFigure {
        title: title.clone(),
        stages,
        k_hat_limit: 0.7,
        ess_target: Some(4000.0),
    };
    let residual: Vec<f64> = contact_ratio.iter().zip(&truth).map(|(a, b)| a - b).collect();
    let residuals = ResidualsFigure {
        title: title.clone(),
        time_s: time_s.clone(),
        residual,
        sigma: 0.03,
        axes: Axes::default(),
        log_time: false,
    };

    let decades: Vec<f64> =
        (0..400).map(|i| 10_f64.powf(-9.0 + 10.0 * f64::from(i) / 399.0)).collect();
    let a1: Vec<f64> = decades.iter().map(|t| 0.35 * t.powf(1.0 / 7.0)).collect();
    let a2: Vec<f64> = decades.iter().map(|t| (t / 3.8).sqrt()).collect();
    let (t1, t2) = ((0.03_f64 / 0.35).powi(7), (0.35 * 3.8_f64.sqrt()).powf(14.0 / 5.0));
    let regime_map = RegimeMapFigure {
        title: title.clone(),
        grid_s: decades,
        a0: 0.03,
        p1: Some((t1, 0.03)),
        p2: Some((t2, (t2 / 3.8).sqrt())),
        a1,
        a2,
        final_ratio: Some(1.26),
        data_time_s: time_s.clone(),
        data_ratio: contact_ratio.clone(),
    };
    let names = ["frenkel", "pokluda", "three-stage", "three-stage-pokluda", "regime-map"];
    let curves = names
        .iter()
        .enumerate()
        .map(|(i, name)| NamedCurve {
            name: if long_names {
                format!("{name} with everything the user wrote into its description")
            } else {
                (*name).to_owned()
            },
            role: Role::Series(i),
            curve: scaled(&mean, 1.0 + 0.05 * (i as f64 - 2.0)),
            at_data: scaled(&truth, 1.0 + 0.05 * (i as f64 - 2.0)),
        })
        .collect();
    let compare = CompareFigure {
        title: title.clone(),
        time_s,
        contact_ratio,
        grid_s,
        curves,
        log_time: false,
    };
    let cost: Vec<f64> = (0..n.min(30)).map(|i| 300.0 * 1.3_f64.powi(i as i32)).collect();
    let methods =
        ["calibrate", "nautilus 1.0.5", "GrainLearning 2.0.5, 5 iterations", "quadrature"];
    let series = methods
        .iter()
        .enumerate()
        .map(|(i, name)| {
            let error: Vec<f64> = cost
                .iter()
                .map(|c| 3.0_f64.powi(i as i32) * 0.4 / c.sqrt() * (0.15 * noise.normal()).exp())
                .collect();
            WorkPrecisionSeries {
                name: if long_names {
                    format!("{name}, which has a rather long name in this figure")
                } else {
                    (*name).to_owned()
                },
                role: Role::Series(i),
                cost: cost.clone(),
                band: if i == 0 {
                    Band { lower: scaled(&error, 0.7), upper: scaled(&error, 1.4) }
                } else {
                    Band::default()
                },
                error,
            }
        })
        .collect();
    let work_precision = WorkPrecisionFigure {
        title,
        cost_name: "simulations".to_owned(),
        cost_unit: String::new(),
        error_name: if long_names {
            "RMS error of the posterior means over 20 seeds".to_owned()
        } else {
            "error of the means".to_owned()
        },
        error_unit: "posterior sd".to_owned(),
        series,
        guide_slope: Some(-0.5),
    };
    vec![
        ("fit", Box::new(fit)),
        ("fit-log", Box::new(log_fit)),
        ("corner", Box::new(corner)),
        ("corner-five", Box::new(corner_five)),
        ("corner-one", Box::new(corner_one)),
        ("recursion", Box::new(recursion)),
        ("convergence", Box::new(convergence)),
        ("residuals", Box::new(residuals)),
        ("regime-map", Box::new(regime_map)),
        ("compare", Box::new(compare)),
        ("work-precision", Box::new(work_precision)),
    ]
}
