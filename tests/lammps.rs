//! The drop test of experiments/external/lammps with LAMMPS itself, held against the closed form of its contact law.
//!
//! LAMMPS is not needed to build or test anything else, so these tests run when they are asked for:
//! `cargo test --test e2e lammps -- --ignored`. Without LAMMPS they say so and pass, unless REQUIRE_LAMMPS is set.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::sandbox::{Sandbox, root};

/// A folder of `experiments/external`, where LAMMPS is here.
fn example(name: &str) -> Option<PathBuf> {
    let found =
        Command::new("lmp").arg("-help").output().is_ok_and(|output| output.status.success());
    if !found {
        assert!(
            std::env::var_os("REQUIRE_LAMMPS").is_none(),
            "LAMMPS (lmp) must be here and is not"
        );
        eprintln!("skipped: LAMMPS (lmp) is not here; Debian: apt-get install lammps");
    }
    found.then(|| root().join("experiments/external").join(name))
}

/// A bead that falls on a linear spring and dashpot, in closed form between impacts and in them.
struct Drop {
    /// When each flight and each contact begins, and how.
    pieces: Vec<Piece>,
    /// Highest force of the plate in each impact \[N\].
    peaks: Vec<f64>,
}

struct Piece {
    begin: f64,
    motion: Motion,
}

#[derive(Clone, Copy)]
enum Motion {
    /// z = z0 + v0 t - g t^2 / 2
    Flight { z0: f64, v0: f64 },
    /// z = ze + exp(-beta t) (a cos(omega t) + b sin(omega t))
    Contact { ze: f64, beta: f64, omega: f64, a: f64, b: f64 },
}

const GRAVITY: f64 = 9.81;
const DROP_M: f64 = 0.02;

impl Motion {
    fn height(self, t: f64) -> f64 {
        match self {
            Self::Flight { z0, v0 } => z0 + v0 * t - GRAVITY * t * t / 2.0,
            Self::Contact { ze, beta, omega, a, b } => {
                ze + (-beta * t).exp() * (a * (omega * t).cos() + b * (omega * t).sin())
            }
        }
    }

    fn velocity(self, t: f64) -> f64 {
        match self {
            Self::Flight { v0, .. } => v0 - GRAVITY * t,
            Self::Contact { beta, omega, a, b, .. } => {
                let (sin, cos) = (omega * t).sin_cos();
                (-beta * t).exp() * ((b * omega - beta * a) * cos - (a * omega + beta * b) * sin)
            }
        }
    }
}

impl Drop {
    fn new(stiffness: f64, restitution: f64) -> Self {
        let mass = 2500.0 * PI / 6.0 * 0.003_f64.powi(3);
        let loss = -restitution.ln();
        let omega0 = (stiffness / mass).sqrt();
        // e = exp(-pi beta / omega), omega^2 = omega0^2 - beta^2.
        let beta = loss * omega0 / (PI * PI + loss * loss).sqrt();
        let omega = (omega0 * omega0 - beta * beta).sqrt();
        let fall = (2.0 * DROP_M / GRAVITY).sqrt();
        let mut drop = Self { pieces: Vec::new(), peaks: Vec::new() };
        drop.pieces.push(Piece { begin: 0.0, motion: Motion::Flight { z0: DROP_M, v0: 0.0 } });
        let (mut begin, mut speed) = (fall, GRAVITY * fall);
        while begin < 0.35 {
            let ze = -GRAVITY / (omega0 * omega0);
            let motion =
                Motion::Contact { ze, beta, omega, a: -ze, b: (-speed - beta * ze) / omega };
            drop.pieces.push(Piece { begin, motion });
            // The contact ends when the bead is back at the plate, after about half a period.
            let (mut early, mut late) = (0.5 * PI / omega, 1.3 * PI / omega);
            for _ in 0..100 {
                let middle = (early + late) / 2.0;
                if motion.height(middle) < 0.0 { early = middle } else { late = middle }
            }
            let force = |t: f64| {
                -mass * (omega0 * omega0 * motion.height(t) + 2.0 * beta * motion.velocity(t))
            };
            let peak = (0..=2000).map(|i| force(early * f64::from(i) / 2000.0)).fold(0.0, f64::max);
            drop.peaks.push(peak);
            begin += early;
            speed = motion.velocity(early);
            drop.pieces.push(Piece { begin, motion: Motion::Flight { z0: 0.0, v0: speed } });
            begin += 2.0 * speed / GRAVITY;
        }
        drop
    }

    fn height_mm(&self, time_s: f64) -> f64 {
        let piece = self.pieces.iter().rfind(|piece| piece.begin <= time_s).expect("begins at 0");
        1000.0 * piece.motion.height(time_s - piece.begin)
    }
}

/// The rows of a table of two columns.
fn rows(path: &Path) -> Vec<(f64, f64)> {
    let text = fs::read_to_string(path).expect("a table");
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let pair = |line: &str| {
        let (x, y) = line.split_once(',').expect("two columns");
        (x.parse().expect("a number"), y.parse().expect("a number"))
    };
    lines.map(pair).collect()
}

#[test]
fn the_closed_form_of_the_drop_test_keeps_the_restitution_and_the_data_fit_it() {
    // Without gravity in the contact the speeds after and before an impact have the ratio e; with it almost.
    let drop = Drop::new(2e4, 0.85);
    let speeds: Vec<f64> = drop
        .pieces
        .iter()
        .filter_map(|piece| match piece.motion {
            Motion::Flight { v0, .. } if v0 > 0.0 => Some(v0),
            _ => None,
        })
        .collect();
    let first = (2.0 * GRAVITY * DROP_M).sqrt();
    assert!((speeds[0] / first - 0.85).abs() < 1e-3, "{}", speeds[0] / first);
    assert!((speeds[1] / speeds[0] - 0.85).abs() < 1e-3);
    // The peak force of an undamped spring is v sqrt(k m).
    let elastic = Drop::new(2e4, 0.999_999);
    let mass = 2500.0 * PI / 6.0 * 0.003_f64.powi(3);
    assert!((elastic.peaks[0] / (first * (2e4 * mass).sqrt()) - 1.0).abs() < 2e-3);
    // The synthetic data scatter about it as they say: chi squared of 11 values within its 99.8 % interval.
    let folder = root().join("experiments/external/lammps");
    let chi_squared = chi_squared(&drop, &folder);
    assert!((1.5..31.3).contains(&chi_squared), "{chi_squared}");
}

fn chi_squared(drop: &Drop, folder: &Path) -> f64 {
    let heights = rows(&folder.join("height.csv"));
    let peaks = rows(&folder.join("peaks.csv"));
    let of_heights = heights.iter().map(|&(t, z)| ((z - drop.height_mm(t)) / 2.0).powi(2));
    let of_peaks = peaks.iter().zip(&drop.peaks).map(|(&(_, f), peak)| ((f - peak) / 0.02).powi(2));
    of_heights.chain(of_peaks).sum()
}

#[test]
#[ignore = "needs LAMMPS"]
fn lammps_gives_the_closed_form() {
    let Some(folder) = example("lammps") else { return };
    for (stiffness, restitution) in [(2e4, 0.85), (3.5e4, 0.78), (1.2e4, 0.94)] {
        let sandbox = Sandbox::new();
        let output = Command::new(folder.join("lammps-drop"))
            .args([format!("{stiffness}"), format!("{restitution}")])
            .current_dir(sandbox.path())
            .output()
            .expect("the wrapper starts");
        assert!(output.status.success(), "{output:?}");
        let drop = Drop::new(stiffness, restitution);
        let heights = rows(&sandbox.path().join("height.csv"));
        assert!(heights.len() > 3000 && heights.last().expect("rows").0 > 0.34);
        for (time_s, height_mm) in heights {
            let error = height_mm - drop.height_mm(time_s);
            // LAMMPS makes a hundred steps in a contact, so that the restitution is off by some 1e-3.
            assert!(error.abs() < 0.3, "{error} mm at {time_s} s");
        }
        let peaks = rows(&sandbox.path().join("peaks.csv"));
        assert!(peaks.len() >= 3);
        for ((_, peak), exact) in peaks.iter().zip(&drop.peaks) {
            assert!((peak / exact - 1.0).abs() < 0.02, "{peak} N, {exact} N");
        }
    }
}

#[test]
#[ignore = "needs LAMMPS"]
fn lammps_is_calibrated_by_a_plan_and_agrees_with_quadrature_of_the_closed_form() {
    let Some(folder) = example("lammps") else { return };
    let sandbox = Sandbox::new();
    let plan = folder.join("plan.toml");
    sandbox.run_args(&["--plan", plan.to_str().expect("UTF-8"), "--out", "drop"]).succeeded();
    let posterior = sandbox.posterior("drop");
    let failed: Vec<String> = sandbox
        .snapshot()
        .into_iter()
        .filter(|(path, text)| path.ends_with("stderr") && !text.is_empty())
        .map(|(_, text)| String::from_utf8_lossy(&text).into_owned())
        .collect();
    assert_eq!(posterior["failures"], serde_json::json!([]), "{failed:#?}");
    // Log-uniform stiffness, uniform restitution: a grid in these coordinates.
    let mut sums = [0.0; 5];
    let size = 120;
    for i in 0..size {
        for j in 0..size {
            let share = |i: i32| (f64::from(i) + 0.5) / f64::from(size);
            let log_k = (1.2e4_f64.ln() * (1.0 - share(i)) + 4e4_f64.ln() * share(i)) / 10_f64.ln();
            let e = 0.75 + 0.2 * share(j);
            let weight = (-chi_squared(&Drop::new(10_f64.powf(log_k), e), &folder) / 2.0).exp();
            for (sum, value) in sums.iter_mut().zip([1.0, log_k, log_k * log_k, e, e * e]) {
                *sum += weight * value;
            }
        }
    }
    for (place, name) in ["stiffness", "restitution"].into_iter().enumerate() {
        let mean = sums[1 + 2 * place] / sums[0];
        let sd = (sums[2 + 2 * place] / sums[0] - mean * mean).sqrt();
        let found = &posterior["parameters"][place];
        assert_eq!(found["parameter"]["name"], name);
        let number = |key: &str| found["in_coordinate"][key].as_f64().expect("a number");
        eprintln!(
            "{name}: mean {:.5}, sd {:.5}; by quadrature {mean:.5}, {sd:.5}",
            number("mean"),
            number("sd")
        );
        // A hundred runs: some twenty effective samples.
        assert!((number("mean") - mean).abs() < 0.75 * sd, "{name}");
        assert!((0.5..1.7).contains(&(number("sd") / sd)), "{name}");
    }
}

/// The plan in `experiments/external/lammps-pour`, with as many runs as a check has time for.
#[test]
#[ignore = "needs LAMMPS and its examples"]
fn lammps_own_granular_example_is_calibrated_by_a_plan() {
    let Some(folder) = example("lammps-pour") else { return };
    let in_pour = std::env::var_os("IN_POUR")
        .map_or_else(|| PathBuf::from("/usr/share/lammps/examples/pour/in.pour"), PathBuf::from);
    if !in_pour.is_file() {
        eprintln!(
            "skipped: {} is not here; Debian: apt-get install lammps-examples",
            in_pour.display()
        );
        return;
    }
    let sandbox = Sandbox::new();
    for file in ["pour", "changes.sed", "energies.csv"] {
        fs::copy(folder.join(file), sandbox.path().join(file)).expect("copied");
    }
    let plan = fs::read_to_string(folder.join("plan.toml")).expect("the plan");
    let short = plan.replace("samples = 300", "samples = 120");
    assert_ne!(short, plan);
    sandbox.write("plan.toml", short);
    sandbox.run("--plan plan.toml --quiet").succeeded();
    let posterior = sandbox.posterior("results/lammps-pour");
    assert_eq!(
        posterior["failures"].as_array().map(Vec::len),
        Some(0),
        "{}",
        posterior["failures"]
    );
    // The example's own friction, which the flow of another pour was made with.
    let friction = &posterior["parameters"][1];
    assert_eq!(friction["parameter"]["name"], "friction");
    let median = friction["in_coordinate"]["median"].as_f64().expect("a number");
    assert!((median - 0.5).abs() < 0.15, "friction {median}");
}
