//! The paper's parameters: every method, timed in turn.

use std::time::Duration;

use crate::stiff_reference::Equations;
use dem_core::{SolveError, SolverKind, SolverSettings};
use figures::Band;
use workbench::error::{Failure, RunError};
use workbench::number::significant;

use super::method::{self, Method, difference, reference};
use super::row::{self, Error, Found, Line, Row};
use crate::pair::Pair;
use crate::report;
use crate::timing::{Clock, Timing, interleaved};

/// Time steps over the collision time; the first is refused.
const STEPS: [f64; 7] = [0.3, 0.15, 0.1, 0.05, 0.02, 0.01, 0.005];

/// A method with its work, its errors and its time.
struct Point {
    method: Method,
    steps: u64,
    /// Error against the quasi-static limit.
    balance: f64,
    /// Error against the equations of motion.
    motion: f64,
    timing: Timing,
}

impl Point {
    fn kind(&self) -> SolverKind {
        self.method.settings.kind
    }
}

pub(super) fn study(pair: &Pair) -> Result<Found, Failure> {
    let (mut rows, methods) = runs(pair)?;
    let settings: Vec<SolverSettings> = methods.iter().map(|run| run.0.settings).collect();
    // Verlet once more without the early end.
    let on: Vec<SolverSettings> = settings
        .iter()
        .filter(|settings| settings.kind == SolverKind::Verlet)
        .map(|settings| SolverSettings { stop_when_coalesced: false, ..*settings })
        .collect();
    let timings = timed(pair, settings.iter().chain(&on));
    let (timings, timings_on) = timings.split_at(settings.len());
    let points: Vec<Point> = methods
        .into_iter()
        .zip(timings)
        .map(|((method, steps, [balance, motion]), &timing)| Point {
            method,
            steps,
            balance,
            motion,
            timing,
        })
        .collect();
    let mut run_on = on.into_iter().zip(timings_on);
    for point in &points {
        rows.push(row(pair, point, &point.method, point.steps, point.timing));
        if point.kind() == SolverKind::Verlet
            && let Some((settings, timing)) = run_on.next()
        {
            let mut out = vec![0.0; pair.times_s.len()];
            let steps = pair.curve(&pair.sintering, &settings, &mut out).map_err(RunError::new)?;
            let method = Method { settings, control: point.method.control.clone() };
            rows.push(row(pair, point, &method, steps, *timing));
        }
    }
    let title = format!("{}, the paper's parameters", pair.material.title());
    let figure = row::figure(title, "verlet, step 0.15 … 0.005 t_{c}", |kind, of_motion| {
        let chosen = || points.iter().filter(|point| point.kind() == kind);
        let error = |point: &Point| if of_motion { point.motion } else { point.balance };
        Line {
            cost: chosen().map(|point| point.timing.median_s).collect(),
            error: chosen().map(|point| error(point).max(1e-16)).collect(),
            band: Band::default(),
        }
    });
    Ok(Found { rows, finding: reach(pair, &points), figure })
}

/// A method with its steps and its errors against the quasi-static limit and the equations of motion.
type Run = (Method, u64, [f64; 2]);

/// The rows of methods that refuse to run, and the runs of the others.
fn runs(pair: &Pair) -> Result<(Vec<Vec<String>>, Vec<Run>), RunError> {
    let reference = |equations| {
        let found = reference(pair, equations, &pair.sintering);
        found.map_err(|error| RunError::new(format_args!("{}: {error}", pair.material)))
    };
    let balance = reference(Equations::ForceBalance)?.contact_ratio;
    let motion = reference(Equations::Motion)?.contact_ratio;
    let (mut refused, mut runs) = (Vec::new(), Vec::new());
    let mut out = vec![0.0; pair.times_s.len()];
    for method in method::all(&STEPS) {
        match pair.curve(&pair.sintering, &method.settings, &mut out) {
            Ok(steps) => {
                let errors = [&balance, &motion].map(|truth| difference(&out, truth));
                runs.push((method, steps, errors));
            }
            Err(error @ SolveError::UnstableStep { .. }) => {
                refused.push(row::refused(pair.material, &method, &error));
            }
            Err(error) => return Err(RunError::new(error)),
        }
    }
    Ok((refused, runs))
}

fn timed<'a>(pair: &Pair, all: impl Iterator<Item = &'a SolverSettings>) -> Vec<Timing> {
    let mut methods: Vec<crate::timing::Method<'_>> = all
        .map(|&settings| {
            let mut out = vec![0.0; pair.times_s.len()];
            Box::new(move || {
                std::hint::black_box(pair.curve(&pair.sintering, &settings, &mut out).is_ok());
            }) as crate::timing::Method<'_>
        })
        .collect();
    interleaved(Clock::Wall, &mut methods, 21, Duration::from_secs(4))
}

fn row(pair: &Pair, point: &Point, method: &Method, steps: u64, timing: Timing) -> Vec<String> {
    let alone = |median| Error { median, worst: None };
    let follows_motion = point.kind() == SolverKind::Verlet;
    Row {
        material: pair.material,
        parameters: "paper",
        method,
        timing,
        steps,
        balance: alone(point.balance),
        motion: follows_motion.then(|| alone(point.motion)),
        note: String::new(),
    }
    .cells()
}

/// The closed form against the paper's run, Verlet with 0.02 t_c, in a sentence.
fn reach(pair: &Pair, points: &[Point]) -> String {
    let closed_form = points.iter().find(|point| point.kind() == SolverKind::ClosedForm);
    let paper = points.iter().find(|point| {
        let settings = &point.method.settings;
        settings.kind == SolverKind::Verlet && settings.step_over_collision_time == 0.02
    });
    let (Some(chosen), Some(paper)) = (closed_form, paper) else { return String::new() };
    let (fast_s, slow_s) = (chosen.timing.median_s, paper.timing.median_s);
    format!(
        "- {}: closed form {} with error {:.1e}; the paper's run (verlet, 0.02 t_c, {} steps) {} with error {:.1e} \
         against the quasi-static limit and {:.1e} against the equations of motion: **{} times faster**.\n",
        pair.material.title(),
        report::seconds(fast_s),
        chosen.balance,
        paper.steps,
        report::seconds(slow_s),
        paper.balance,
        paper.motion,
        significant(slow_s / fast_s, 3),
    )
}
