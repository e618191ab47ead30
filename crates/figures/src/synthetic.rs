//! One figure of each kind from made-up numbers, for the tests and for looking at.

use super::{
    Axes, Band, BedFigure, CompareFigure, ConvergenceFigure, ConvergenceStage, CornerFigure,
    CornerParameter, DensificationFigure, FailuresFigure, Figure, FitFigure, Knee, MarginalsFigure,
    MarginalsParameter, NamedCurve, RankedQuantity, RanksFigure, RecursionFigure,
    RecursionParameter, RegimeMapFigure, ResidualsFigure, Role, SeriesFigure, TogetherCurve,
    TogetherFigure, WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries,
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

/// Every figure with a name, with `n` observations over `end_s` seconds and with short or long names.
pub(crate) fn figures(
    n: usize,
    end_s: f64,
    long_names: bool,
) -> Vec<(&'static str, Box<dyn Figure + Sync>)> {
    let data = Data::new(n, end_s, long_names);
    let mut noise = Noise(1_000 + n as u64);
    let fit = data.fit();
    let log_axes = Axes { log_control: true, ..Axes::default() };
    let log_fit = FitFigure { axes: log_axes, ..fit.clone() };
    let corner = data.corner(&mut noise);
    let marginals = MarginalsFigure {
        title: data.title.clone(),
        names: vec!["results/one".to_owned(), "results/other".to_owned()],
        parameters: corner
            .parameters
            .iter()
            .map(|p| MarginalsParameter {
                symbol: p.symbol.clone(),
                unit: p.unit.clone(),
                log10: p.log10,
                draws: vec![p.draws.clone(), p.draws.iter().map(|draw| draw + 0.1).collect()],
            })
            .collect(),
    };
    let corner_one =
        CornerFigure { parameters: vec![corner.parameters[1].clone()], ..corner.clone() };
    let corner_three =
        CornerFigure { parameters: corner.parameters[..3].to_vec(), ..corner.clone() };
    let work_precision = data.work_precision(&mut noise);
    let grid = WorkPrecisionGrid {
        title: data.title.clone(),
        rows: vec![vec![work_precision.clone(); 2]; 2],
    };
    vec![
        ("fit", Box::new(fit)),
        ("fit-log", Box::new(log_fit)),
        ("corner", Box::new(corner_three)),
        ("corner-five", Box::new(corner)),
        ("corner-one", Box::new(corner_one)),
        ("recursion", Box::new(data.recursion())),
        ("convergence", Box::new(data.convergence())),
        ("residuals", Box::new(data.residuals())),
        ("failures", Box::new(data.failures())),
        ("regime-map", Box::new(data.regime_map())),
        ("compare", Box::new(data.compare())),
        ("together", Box::new(data.together())),
        ("series", Box::new(data.series())),
        ("densification", Box::new(data.densification())),
        ("marginals", Box::new(marginals)),
        ("ranks", Box::new(data.ranks())),
        ("work-precision", Box::new(work_precision)),
        ("work-precision-grid", Box::new(grid)),
    ]
}

/// A heap of overlapping spheres in a box.
pub(crate) fn bed() -> BedFigure {
    let mut figure = BedFigure {
        title: "27 particles".to_owned(),
        frame_m: Some([[-1e-5; 3], [5e-5; 3]]),
        range: [0.0, 1.0],
        ..BedFigure::default()
    };
    let spacing = 1.8e-5;
    for i in 0..27_usize {
        let cell = [i % 3, i / 3 % 3, i / 9];
        figure.position_m.push(cell.map(|k| k as f64 * spacing));
        figure.radius_m.push(1e-5);
        figure.contact_ratio.push(if i == 26 { f64::NAN } else { i as f64 / 25.0 });
        for (axis, stride) in [1, 3, 9].into_iter().enumerate() {
            if cell[axis] < 2 {
                let mut toward = [0.0; 3];
                toward[axis] = spacing;
                figure.contacts.push((i, toward, i + stride));
            }
        }
    }
    figure
}

/// Data shared by the figures: measurements of a curve, and the names.
struct Data {
    n: usize,
    end_s: f64,
    long_names: bool,
    title: String,
    time_s: Vec<f64>,
    truth: Vec<f64>,
    contact_ratio: Vec<f64>,
    grid_s: Vec<f64>,
    mean: Vec<f64>,
}

impl Data {
    fn new(n: usize, end_s: f64, long_names: bool) -> Data {
        let title = if long_names {
            "A material with a long name, its batch, its temperature and its history (recycled powder, 2nd build)"
        } else {
            "PA12, R = 31.5 µm"
        };
        let mut noise = Noise(7);
        let time_s = grid(0.0, end_s, n);
        let grid_s = grid(0.0, end_s, 300);
        let truth = curve(&time_s, end_s / 1.8);
        Data {
            n,
            end_s,
            long_names,
            title: title.to_owned(),
            contact_ratio: truth.iter().map(|a| a + 0.03 * noise.normal()).collect(),
            mean: curve(&grid_s, end_s / 1.8),
            truth,
            time_s,
            grid_s,
        }
    }

    /// One of two names.
    fn name(&self, short: &str, long: &str) -> String {
        if self.long_names { long } else { short }.to_owned()
    }

    fn c1_name(&self) -> String {
        self.name("C_{1}", "a parameter of the user with a long name C_{1}")
    }

    fn fit(&self) -> FitFigure {
        let (grid_s, mean, end_s) = (&self.grid_s, &self.mean, self.end_s);
        FitFigure {
            title: self.title.clone(),
            control: self.time_s.clone(),
            value: self.contact_ratio.clone(),
            grid: grid_s.clone(),
            band50: around(mean, 0.01),
            band90: around(mean, 0.025),
            predictive90: around(mean, 0.06),
            map: curve(grid_s, end_s / 1.82),
            paper: curve(grid_s, end_s / 2.1),
            frenkel: grid_s.iter().map(|t| (1.8 * t / end_s).sqrt()).collect(),
            knee: Some(Knee { time_s: 0.5, ratio: 0.5, lower: 0.45, upper: 0.55 }),
            paper_knee: Some(0.42),
            mean: mean.clone(),
            axes: Axes::default(),
        }
    }

    /// Five parameters.
    fn corner(&self, noise: &mut Noise) -> CornerFigure {
        let mut columns: [Vec<f64>; 4] = Default::default();
        for _ in 0..self.n.clamp(1, 4000) {
            let (a, b, c) = (noise.normal(), noise.normal(), noise.normal());
            columns[0].push(-8.0 + 6.0 * noise.uniform());
            columns[1].push(0.58 + 0.013 * a);
            columns[2].push(-6.6 + 0.15 * (0.8 * a + 0.6 * b + 0.3 * a * a));
            columns[3].push(1.26 + 0.02 * c + if b > 0.0 { 0.07 } else { 0.0 });
        }
        let [c1, tau_s, delta, phi] = columns;
        let tau = scaled(&tau_s, 1e-3);
        let parameter =
            |(symbol, unit): (&str, &str), log10, draws: Vec<f64>, prior: (f64, f64), paper| {
                let density = 1.0 / (prior.1 - prior.0);
                CornerParameter {
                    symbol: symbol.to_owned(),
                    unit: unit.to_owned(),
                    log10,
                    map: draws.first().copied(),
                    draws,
                    quantiles: None,
                    prior: vec![(prior.0, density), (prior.1, density)],
                    paper,
                }
            };
        let c1_name = self.c1_name();
        CornerFigure {
            title: self.title.clone(),
            parameters: vec![
                parameter((&c1_name, "Pa^{−1} s^{−1}"), true, c1, (-8.0, -2.0), Some(-4.1)),
                parameter(("τ_{s}", "s"), true, tau_s, (-0.3, 1.7), Some(0.581)),
                parameter(("δ_{c}", "m"), true, delta, (-8.0, -5.5), Some(-6.4)),
                parameter(("φ", ""), false, phi, (1.0, 1.35), None),
                parameter(("τ", "s"), false, tau, (0.0, 1e-3), Some(5.8e-4)),
            ],
            weights: Vec::new(),
        }
    }

    fn recursion(&self) -> RecursionFigure {
        let n = self.n;
        let parameter = |symbol: &str, unit: &str, [from, to, width]: [f64; 3], paper| {
            let median: Vec<f64> = (0..n)
                .map(|i| to + (from - to) * (-(i as f64) / (n as f64 / 4.0 + 1.0)).exp())
                .collect();
            let end = |z: f64| -> Vec<f64> {
                let steps = median.iter().enumerate();
                steps.map(|(i, m)| m + z * width / (1.0 + i as f64).sqrt()).collect()
            };
            RecursionParameter {
                symbol: symbol.to_owned(),
                unit: unit.to_owned(),
                log10: true,
                interval50: Band { lower: end(-0.67), upper: end(0.67) },
                interval90: Band { lower: end(-1.64), upper: end(1.64) },
                median,
                paper,
            }
        };
        RecursionFigure {
            title: self.title.clone(),
            control_name: "time t".to_owned(),
            control_unit: "s".to_owned(),
            control: self.time_s.clone(),
            log_control: false,
            parameters: vec![
                parameter(&self.c1_name(), "Pa^{−1} s^{−1}", [-5.0, -4.0, 2.0], Some(-3.5)),
                parameter("τ_{s}", "s", [0.0, 0.58, 0.4], Some(0.581)),
                parameter("δ_{c}", "m", [-7.0, -6.6, 0.3], Some(-6.5)),
            ],
            ess: (0..n).map(|i| 16384.0 / (1.0 + 0.1 * i as f64) + 20.0).collect(),
        }
    }

    fn convergence(&self) -> ConvergenceFigure {
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
        ConvergenceFigure {
            title: self.title.clone(),
            stages,
            k_hat_limit: 0.7,
            ess_target: Some(4000.0),
            k_hat_of_result: Some(0.45),
        }
    }

    fn residuals(&self) -> ResidualsFigure {
        let pairs = self.contact_ratio.iter().zip(&self.truth);
        ResidualsFigure {
            title: self.title.clone(),
            control: self.time_s.clone(),
            residual: pairs.map(|(a, b)| a - b).collect(),
            sigma: 0.03,
            axes: Axes::default(),
        }
    }

    fn failures(&self) -> FailuresFigure {
        let edges = grid(0.0, 4.0, 21);
        let bump = |x: f64| (-8.0 * (x - 2.0) * (x - 2.0)).exp();
        let middles: Vec<f64> = edges.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
        let of = |pick: fn(f64, f64) -> f64| middles.iter().map(|x| pick(*x, bump(*x))).collect();
        FailuresFigure {
            title: self.title.clone(),
            symbol: "b".to_owned(),
            unit: String::new(),
            log10: false,
            finished: of(|x, bump| if x < 1.9 { 0.0 } else { (5.0 + 60.0 * bump).round() }),
            failed: of(|x, bump| if x < 1.9 { (5.0 + 20.0 * bump).round() } else { 0.0 }),
            posterior: of(|x, bump| if x < 1.9 { 0.0 } else { 0.3 * bump }),
            edges,
        }
    }

    fn regime_map(&self) -> RegimeMapFigure {
        let grid_s: Vec<f64> = grid(-9.0, 1.0, 400).iter().map(|e| 10_f64.powf(*e)).collect();
        let (t1, t2) = ((0.03_f64 / 0.35).powi(7), (0.35 * 3.8_f64.sqrt()).powf(14.0 / 5.0));
        RegimeMapFigure {
            title: self.title.clone(),
            a0: 0.03,
            p1: Some((t1, 0.03)),
            p2: Some((t2, (t2 / 3.8).sqrt())),
            a1: grid_s.iter().map(|t| 0.35 * t.powf(1.0 / 7.0)).collect(),
            a2: grid_s.iter().map(|t| (t / 3.8).sqrt()).collect(),
            grid_s,
            final_ratio: Some(1.26),
            data_time_s: self.time_s.clone(),
            data_ratio: self.contact_ratio.clone(),
        }
    }

    fn compare(&self) -> CompareFigure {
        let names = [
            "frenkel",
            "pokluda",
            "three-stage",
            "three-stage-pokluda",
            "regime-map",
            "bellehumeur",
        ];
        let curves = names.iter().enumerate().map(|(i, name)| NamedCurve {
            name: self
                .name(name, &format!("{name} with everything the user wrote into its description")),
            role: Role::Series(i),
            curve: scaled(&self.mean, 1.0 + 0.05 * (i as f64 - 2.0)),
            at_data: scaled(&self.truth, 1.0 + 0.05 * (i as f64 - 2.0)),
        });
        CompareFigure {
            title: self.title.clone(),
            control: self.time_s.clone(),
            value: self.contact_ratio.clone(),
            grid: self.grid_s.clone(),
            curves: curves.collect(),
            axes: Axes::default(),
        }
    }

    fn together(&self) -> TogetherFigure {
        let curves = [0.4, 0.7, 1.0].iter().enumerate().map(|(i, factor)| TogetherCurve {
            name: self.name(&format!("e{i}"), &format!("e{i}, the experiment of a long name")),
            control: self.time_s.clone(),
            value: scaled(&self.contact_ratio, *factor),
            grid: self.grid_s.clone(),
            mean: scaled(&self.mean, *factor),
            band90: around(&scaled(&self.mean, *factor), 0.05),
        });
        let (title, axes) = (self.title.clone(), Axes::default());
        TogetherFigure { title, curves: curves.collect(), axes }
    }

    fn series(&self) -> SeriesFigure {
        SeriesFigure {
            title: self.title.clone(),
            time_s: self.grid_s.clone(),
            relative_density: self.mean.iter().map(|a| 0.55 + 0.2 * a).collect(),
            coordination: self.mean.iter().map(|a| 4.0 + 3.0 * a).collect(),
            mean_contact_ratio: self.mean.clone(),
            contact_ratio_10: scaled(&self.mean, 0.9),
            contact_ratio_90: scaled(&self.mean, 1.1),
            heated_from_s: Some(0.2 * self.end_s),
            pairs_end_s: Some(0.8 * self.end_s),
        }
    }

    fn densification(&self) -> DensificationFigure {
        let median: Vec<f64> = self.mean.iter().map(|a| 0.55 + 0.2 * a).collect();
        DensificationFigure {
            title: self.title.clone(),
            quantity: self
                .name("relative density", "relative density of the inner part of the bed"),
            time_s: self.grid_s.clone(),
            band50: around(&median, 0.01),
            band90: around(&median, 0.03),
            median,
            pairs_end_at: Some(0.78),
            target: 0.7,
            time_to_target_s: Some(0.5 * self.end_s),
            interval_s: [Some(0.4 * self.end_s), None],
        }
    }

    fn ranks(&self) -> RanksFigure {
        let level = grid(0.01, 0.99, 99);
        let names = ["C_{1}", "τ_{s}", "δ_{c}", "σ", "log likelihood"];
        let mut noise = Noise(3);
        let mut quantity = |name: &&str| {
            let mut ranks: Vec<f64> = (0..400).map(|_| noise.uniform()).collect();
            ranks.sort_by(f64::total_cmp);
            let share = |u: f64| ranks.partition_point(|r| *r <= u) as f64 / 400.0;
            RankedQuantity {
                name: self.name(name, &format!("{name}, ranked within a posterior of its own")),
                difference: level.iter().map(|u| share(*u) - u).collect(),
                p_value: noise.uniform(),
            }
        };
        let quantities = names.iter().map(&mut quantity).collect();
        let half: Vec<f64> = level.iter().map(|u| 2.8 * (u * (1.0 - u) / 400.0).sqrt()).collect();
        let band95 = Band { lower: scaled(&half, -1.0), upper: half };
        RanksFigure { title: self.title.clone(), level, band95, quantities }
    }

    fn work_precision(&self, noise: &mut Noise) -> WorkPrecisionFigure {
        let cost: Vec<f64> = (0..self.n.min(30)).map(|i| 300.0 * 1.3_f64.powi(i as i32)).collect();
        let methods =
            ["calibrate", "nautilus 1.0.5", "GrainLearning 2.0.5, 5 iterations", "quadrature"];
        let mut series = |i: usize, name: &str| {
            let factor = 0.4 * 3.0_f64.powi(i as i32);
            let error: Vec<f64> =
                cost.iter().map(|c| factor / c.sqrt() * (0.15 * noise.normal()).exp()).collect();
            let band = Band { lower: scaled(&error, 0.7), upper: scaled(&error, 1.4) };
            WorkPrecisionSeries {
                name: self
                    .name(name, &format!("{name}, which has a rather long name in this figure")),
                role: Role::Series(i),
                cost: cost.clone(),
                band: if i == 0 { band } else { Band::default() },
                error,
            }
        };
        WorkPrecisionFigure {
            title: self.title.clone(),
            cost_name: "simulations".to_owned(),
            cost_unit: String::new(),
            error_name: self
                .name("error of the means", "RMS error of the posterior means over 20 seeds"),
            error_unit: "posterior sd".to_owned(),
            series: methods.iter().enumerate().map(|(i, name)| series(i, name)).collect(),
            guide_slope: Some(-0.5),
        }
    }
}
