//! The workers of experiments/external/worker, whose posterior and evidence have a closed form.
//!
//! That of Python runs wherever there is a python3. UM-Bridge is not needed to build or test anything else, so its test runs when
//! it is asked for: `cargo test --test e2e um_bridge -- --ignored`. Where it cannot be installed it says so and passes, unless
//! REQUIRE_UMBRIDGE is set.

use std::f64::consts::TAU;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use crate::sandbox::{Sandbox, root};

fn folder() -> PathBuf {
    root().join("experiments/external/worker")
}

/// Mean and standard deviation of stiffness and preload, and the log evidence: normal priors and errors, a linear model.
///
/// # Formula
///
/// With rows (x, 1), P = sum (x, 1)^T (x, 1)/s^2 + diag(1/s_0^2), m = P^-1 (sum (x, 1) y/s^2 + m_0/s_0^2),
/// ln Z = ln p(y | m) + ln p(m) + ln 2 pi - ln |P|/2.
fn exact() -> ([[f64; 2]; 2], f64) {
    let text = fs::read_to_string(folder().join("spring.csv")).expect("the table");
    let rows: Vec<(f64, f64)> = text
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| line.split_once(',').expect("two columns"))
        .map(|(x, y)| (x.parse().expect("a number"), y.parse().expect("a number")))
        .collect();
    assert_eq!(rows.len(), 8);
    let (sigma, priors): (f64, [(f64, f64); 2]) = (0.2, [(0.5, 0.2), (0.0, 0.5)]);
    let [mut kk, mut kf, mut ff] = [priors[0].1.powi(-2), 0.0, priors[1].1.powi(-2)];
    let [mut k, mut f] = [kk * priors[0].0, ff * priors[1].0];
    for (x, y) in &rows {
        let weight = sigma.powi(-2);
        (kk, kf, ff) = (kk + weight * x * x, kf + weight * x, ff + weight);
        (k, f) = (k + weight * x * y, f + weight * y);
    }
    let determinant = kk * ff - kf * kf;
    let mean = [(ff * k - kf * f) / determinant, (kk * f - kf * k) / determinant];
    let log_normal =
        |x: f64, mean: f64, sd: f64| -0.5 * ((x - mean) / sd).powi(2) - 0.5 * (TAU * sd * sd).ln();
    let likelihood: f64 =
        rows.iter().map(|(x, y)| log_normal(*y, mean[1] + mean[0] * x, sigma)).sum();
    let prior: f64 = priors.iter().zip(mean).map(|((at, sd), m)| log_normal(m, *at, *sd)).sum();
    let log_evidence = likelihood + prior + TAU.ln() - 0.5 * determinant.ln();
    let sd = [(ff / determinant).sqrt(), (kk / determinant).sqrt()];
    ([[mean[0], sd[0]], [mean[1], sd[1]]], log_evidence)
}

/// Holds a calibration by 400 runs against the closed form.
#[track_caller]
fn agrees(posterior: &Value) {
    let (moments, log_evidence) = exact();
    for ([mean, sd], found) in
        moments.into_iter().zip(posterior["parameters"].as_array().expect("a list"))
    {
        let number = |key: &str| found["in_coordinate"][key].as_f64().expect("a number");
        let name = &found["parameter"]["name"];
        eprintln!("{name}: {} +- {}, exactly {mean} +- {sd}", number("mean"), number("sd"));
        assert!((number("mean") - mean).abs() < 0.2 * sd, "{name}");
        assert!((number("sd") / sd - 1.0).abs() < 0.15, "{name}");
    }
    let found = posterior["log_evidence"]["value"].as_f64().expect("a number");
    assert!((found - log_evidence).abs() < 0.15, "{found}, exactly {log_evidence}");
}

fn path(of: &Path) -> &str {
    of.to_str().expect("UTF-8")
}

#[test]
fn a_worker_in_python_gives_the_posterior_in_closed_form() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: python3 is not here");
        return;
    }
    let sandbox = Sandbox::new();
    let plan = folder().join("spring.toml");
    sandbox.run_args(&["--plan", path(&plan), "--out", "spring", "--quiet"]).succeeded();
    agrees(&sandbox.posterior("spring"));
    let worker = fs::read_to_string(folder().join("spring.py")).expect("the worker");
    assert!(worker.lines().filter(|line| !line.is_empty()).count() <= 12, "ten lines and a title");
}

/// A Python with UM-Bridge, in a folder of its own.
fn python_with_um_bridge(sandbox: &Sandbox) -> Option<PathBuf> {
    let environment = sandbox.path().join("venv");
    let made = Command::new("python3").args(["-m", "venv", path(&environment)]).status();
    let python = environment.join("bin/python");
    let installs = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "umbridge"];
    let there = made.is_ok_and(|status| status.success())
        && Command::new(&python).args(installs).status().is_ok_and(|status| status.success());
    if !there {
        assert!(
            std::env::var_os("REQUIRE_UMBRIDGE").is_none(),
            "UM-Bridge must be here and is not"
        );
        eprintln!(
            "SKIPPED: UM-Bridge cannot be installed here (python3 -m venv, pip install umbridge)"
        );
    }
    there.then_some(python)
}

/// A process that is ended with the test.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[ignore = "installs UM-Bridge"]
fn a_model_of_um_bridge_gives_the_posterior_in_closed_form_and_the_bits_of_the_worker() {
    let sandbox = Sandbox::new();
    let Some(python) = python_with_um_bridge(&sandbox) else { return };
    let port = {
        let free = TcpListener::bind("127.0.0.1:0").expect("a port");
        free.local_addr().expect("its number").port()
    };
    for file in ["umbridge-worker.py", "spring.csv", "spring.py", "spring.toml"] {
        fs::copy(folder().join(file), sandbox.path().join(file)).expect("copied");
    }
    let plan = fs::read_to_string(folder().join("umbridge.toml")).expect("the plan");
    assert!(plan.contains(":4242") && plan.contains("\"python3\""));
    let plan = plan.replace(":4242", &format!(":{port}"));
    sandbox.write("umbridge.toml", plan.replace("\"python3\"", &format!("{:?}", path(&python))));
    sandbox.run("check umbridge.toml").succeeded();
    // The server comes late, and is waited for.
    let driver = Command::new(env!("CARGO_BIN_EXE_calibrate"))
        .current_dir(sandbox.path())
        .args(["--plan", "umbridge.toml", "--quiet"])
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    std::thread::sleep(std::time::Duration::from_secs(3));
    let model = folder().join("umbridge-model.py");
    let log = || fs::File::create(sandbox.path().join("log")).expect("a file");
    let _server = Server(
        Command::new(&python)
            .args([path(&model), &port.to_string()])
            .stdout(log())
            .stderr(log())
            .spawn()
            .expect("the server starts"),
    );
    let ended = driver.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    agrees(&sandbox.posterior("results/umbridge"));
    sandbox.run("--plan spring.toml --quiet").succeeded();
    let samples = |name: &str| fs::read(sandbox.path().join(name).join("samples.csv")).expect(name);
    assert!(samples("results/umbridge") == samples("results/spring"));
}
