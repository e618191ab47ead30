//! Time per curve against error of a/R, for every solver and a sweep of its control.
//!
//! Two errors are kept apart, each the largest over the observation times and against a reference that
//! shares no code with the solvers ([`studies::stiff_reference`]): against the quasi-static limit, which is what
//! is calibrated, and against the equations of motion, which shows the error of the time step alone.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolveError, SolverKind, SolverSettings,
    contact_ratios, verlet_batch,
};
use rayon::prelude::*;

use super::draws;
use super::report::{self, Header, Table};
use super::timing::{Clock, Method, Timing, interleaved};
use crate::args::SimulatorArgs;
use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionSeries};
use studies::stiff_reference::{Equations, Problem, Reference};
use workbench::error::{Failure, InputError, Mistake, RunError};
use workbench::experiment::Experiment;
use workbench::material::Material;
use workbench::number::significant;
use workbench::output;

/// A series of a figure: name, role, seconds, errors, spread of the errors.
type NamedSeries<'a> = (&'a str, Role, Vec<f64>, Vec<f64>, Band);

const KINETICS: Kinetics = Kinetics::ThreeStage;

/// Time steps over the collision time; the first must be refused, the last runs the paper's parameters only.
const STEPS: [f64; 7] = [0.3, 0.15, 0.1, 0.05, 0.02, 0.01, 0.005];

/// What the reference must have settled to.
const BALANCE_SETTLED: f64 = 1e-9;
const MOTION_SETTLED: f64 = 1e-8;
const MOST_STEPS: u64 = 5_000_000;

pub(super) fn run(args: &SimulatorArgs) -> Result<(), Failure> {
    report::folder(&args.out)?;
    let header = Header::now("cargo run --release -p studies -- simulator");
    let mut table = Table::new(&[
        "material",
        "parameters",
        "solver",
        "control",
        "stops when coalesced",
        "time per curve [s]",
        "lower quartile [s]",
        "upper quartile [s]",
        "steps",
        "error against quasi-static limit, median",
        "worst",
        "error against equations of motion, median",
        "worst",
        "note",
    ]);
    let mut findings = String::new();
    for material in Material::ALL {
        let case = Case::of(material)?;
        eprintln!("{material}: the paper's parameters");
        let paper = case.paper(&mut table, &mut findings)?;
        report::figure(&args.out, &format!("simulator-{material}"), &paper)?;
        eprintln!("{material}: {} draws from the prior", args.draws);
        let drawn = case.drawn(args.draws, &mut table, &mut findings)?;
        report::figure(&args.out, &format!("simulator-{material}-prior"), &drawn)?;
    }
    output::write_file(&args.out.join("simulator.csv"), table.csv(&header).as_bytes())?;
    order(&mut findings)?;
    let text = format!(
        "# Simulator: time per curve against error of a/R\n\n{}\n{TEXT}\n{findings}\n{}",
        header.lines("- "),
        table.markdown()
    );
    output::write_file(&args.out.join("simulator.md"), text.as_bytes())?;
    Ok(())
}

const TEXT: &str = "\
Error: the largest |a/R - reference| over the observation times. Against the *quasi-static limit*, which is what is
calibrated (force balance, Radau IIA, tolerance tightened until it moves by less than 1e-9 twice running, for a few draws 1e-7): that is the error
that counts. Against the *equations of motion* (likewise, settled to 1e-8, where the long run of PEEK keeps it from that to 1e-6): the error of the time step alone. The difference
of the two is the inertia of the soft contact, which no smaller step removes. The reference has errors
too: after the knee up to 30 times what it settled to, because an error of the time of the knee is carried into the
faster stage. Where closed form and quasi-static solver at 1e-12, which share no formula, show the same error, it
is the reference's.

Time: wall time of one curve on one core up to the last observation, median over interleaved rounds with quartiles; for
draws from the prior the mean over the draws, for verlet in batches of eight lanes. `stops when coalesced`:
whether the run ends with full coalescence (quasi-static and closed form have nothing to run after it).

Which solver: the closed form, wherever the kinetics have one (all five do): nothing is faster, and its error is rounding. The
quasi-static solver to check it, and for a law without a closed form. Verlet for what the paper ran, with its inertia.
";

/// A material as it is calibrated.
struct Case {
    material: Material,
    scene: PairScene,
    times_s: Vec<f64>,
}

/// A solver with a control.
struct Control {
    settings: SolverSettings,
    shown: String,
}

/// The errors of one method over the parameter vectors.
#[derive(Default)]
struct Errors {
    balance: Vec<f64>,
    motion: Vec<f64>,
}

impl Case {
    fn of(material: Material) -> Result<Self, InputError> {
        let experiment = Experiment::of_material(material)?;
        let times_s = experiment.observations(None)?.time_s;
        let scene = PairSpec::new(experiment.powder, experiment.final_contact_ratio)
            .build()
            .map_err(|error| InputError::new("material", Mistake::OutOfRange).found(error))?;
        Ok(Self { material, scene, times_s })
    }

    fn solve(
        &self,
        s: &Sintering,
        settings: &SolverSettings,
        out: &mut [f64],
    ) -> Result<u64, SolveError> {
        contact_ratios(&self.scene, KINETICS, s, settings, &self.times_s, out)
            .map(|report| report.steps)
    }

    fn reference(&self, equations: Equations, s: &Sintering) -> Result<Reference, RunError> {
        let wanted = match equations {
            Equations::Motion => [MOTION_SETTLED, 100.0 * MOTION_SETTLED],
            Equations::ForceBalance => [BALANCE_SETTLED, 100.0 * BALANCE_SETTLED],
        };
        let problem = Problem {
            equations,
            scene: &self.scene,
            kinetics: KINETICS,
            sintering: s,
            times_s: &self.times_s,
        };
        problem
            .settled(wanted[0], MOST_STEPS)
            .or_else(|_| problem.settled(wanted[1], MOST_STEPS))
            .map_err(|error| RunError::new(format_args!("{}: {error}", self.material)))
    }

    fn paper(
        &self,
        table: &mut Table,
        findings: &mut String,
    ) -> Result<WorkPrecisionFigure, Failure> {
        let s = self.material.table3_sintering();
        let balance = self.reference(Equations::ForceBalance, &s)?.contact_ratio;
        let motion = self.reference(Equations::Motion, &s)?.contact_ratio;
        let mut out = vec![0.0; self.times_s.len()];
        let mut points = Vec::new();
        for control in controls(&STEPS) {
            match self.solve(&s, &control.settings, &mut out) {
                Ok(steps) => {
                    let (quasi, own) = (difference(&out, &balance), difference(&out, &motion));
                    points.push((control, steps, quasi, own));
                }
                Err(error @ SolveError::UnstableStep { .. }) => {
                    table.push(self.refused(&control, &error));
                }
                Err(error) => return Err(RunError::new(error).into()),
            }
        }
        // Verlet once more without the early end.
        let without: Vec<SolverSettings> = points
            .iter()
            .filter(|point| point.0.settings.kind == SolverKind::Verlet)
            .map(|point| SolverSettings { stop_when_coalesced: false, ..point.0.settings })
            .collect();
        let all = points.iter().map(|point| point.0.settings).chain(without.iter().copied());
        let mut methods: Vec<Method<'_>> = all
            .map(|settings| {
                let mut out = vec![0.0; self.times_s.len()];
                Box::new(move || {
                    std::hint::black_box(self.solve(&s, &settings, &mut out).is_ok());
                }) as Method<'_>
            })
            .collect();
        let timings = interleaved(Clock::Wall, &mut methods, 21, Duration::from_secs(4));
        drop(methods);
        let (with, mut rest) = timings.split_at(points.len());
        for (point, timing) in points.iter().zip(with) {
            let (control, steps, quasi, own) = point;
            let is_verlet = control.settings.kind == SolverKind::Verlet;
            let own = is_verlet.then_some(*own);
            table.push(self.row(
                "paper",
                control,
                "yes",
                timing,
                *steps,
                Some((*quasi, None)),
                own.map(|e| (e, None)),
                "",
            ));
            if is_verlet && let [timing, more @ ..] = rest {
                let settings = SolverSettings { stop_when_coalesced: false, ..control.settings };
                let steps = self.solve(&s, &settings, &mut out).map_err(RunError::new)?;
                table.push(self.row(
                    "paper",
                    control,
                    "no",
                    timing,
                    steps,
                    Some((*quasi, None)),
                    own.map(|e| (e, None)),
                    "",
                ));
                rest = more;
            }
        }
        self.reach(&points, &timings, findings);
        let line = |kind: SolverKind, error: fn(&(Control, u64, f64, f64)) -> f64| {
            let chosen = || points.iter().zip(with).filter(move |(p, _)| p.0.settings.kind == kind);
            (
                chosen().map(|(_, t)| t.median_s).collect::<Vec<f64>>(),
                chosen().map(|(p, _)| error(p).max(1e-16)).collect::<Vec<f64>>(),
            )
        };
        let series = [
            ("closed form", Role::Series(0), line(SolverKind::ClosedForm, |p| p.2)),
            (
                "quasi-static, tolerance 1e-2 … 1e-12",
                Role::Series(1),
                line(SolverKind::QuasiStatic, |p| p.2),
            ),
            ("verlet, step 0.15 … 0.005 t_{c}", Role::Series(3), line(SolverKind::Verlet, |p| p.2)),
            (
                "verlet against the equations of motion",
                Role::Series(2),
                line(SolverKind::Verlet, |p| p.3),
            ),
        ];
        Ok(self.figure(
            format!("{}, the paper's parameters", self.material.title()),
            series.map(|(name, role, (cost, error))| (name, role, cost, error, Band::default())),
        ))
    }

    fn drawn(
        &self,
        count: usize,
        table: &mut Table,
        findings: &mut String,
    ) -> Result<WorkPrecisionFigure, Failure> {
        let draws = draws::from_prior(self.material, count)?;
        let balance: Vec<Option<Reference>> =
            draws.par_iter().map(|s| self.reference(Equations::ForceBalance, s).ok()).collect();
        let unsettled = balance.iter().filter(|reference| reference.is_none()).count();
        let motion: Vec<Option<Reference>> =
            draws.par_iter().map(|s| self.reference(Equations::Motion, s).ok()).collect();
        let missing = motion.iter().filter(|reference| reference.is_none()).count();
        let width = self.times_s.len();
        let mut lines: Vec<(SolverKind, f64, Errors)> = Vec::new();
        let parameters = format!("{count} prior draws");
        for control in controls(&STEPS[1..STEPS.len() - 1]) {
            let mut out = vec![0.0; width * draws.len()];
            let start = Instant::now();
            let steps: Vec<Result<u64, SolveError>> = if control.settings.kind == SolverKind::Verlet
            {
                verlet_batch(
                    &self.scene,
                    KINETICS,
                    &draws,
                    &control.settings,
                    &self.times_s,
                    &mut out,
                )
                .map_err(RunError::new)?
                .into_iter()
                .map(|result| result.map(|report| report.steps))
                .collect()
            } else {
                draws
                    .iter()
                    .zip(out.chunks_mut(width))
                    .map(|(s, out)| self.solve(s, &control.settings, out))
                    .collect()
            };
            let each_s = start.elapsed().as_secs_f64() / draws.len() as f64;
            let mut errors = Errors::default();
            let mut failed = 0;
            let mut total = 0;
            for (i, (steps, out)) in steps.iter().zip(out.chunks(width)).enumerate() {
                let Ok(steps) = steps else {
                    failed += 1;
                    continue;
                };
                total += steps;
                if let Some(balance) = &balance[i] {
                    errors.balance.push(difference(out, &balance.contact_ratio));
                }
                if let Some(motion) = &motion[i] {
                    errors.motion.push(difference(out, &motion.contact_ratio));
                }
            }
            let kind = control.settings.kind;
            let timing = Timing { median_s: each_s, lower_s: each_s, upper_s: each_s };
            let is_verlet = kind == SolverKind::Verlet;
            let note = if failed > 0 { format!("{failed} draws refused") } else { String::new() };
            let own = is_verlet.then(|| (median(&errors.motion), Some(worst(&errors.motion))));
            let quasi = Some((median(&errors.balance), Some(worst(&errors.balance))));
            table.push(self.row(
                &parameters,
                &control,
                "yes",
                &timing,
                total / count as u64,
                quasi,
                own,
                &note,
            ));
            lines.push((kind, each_s, errors));
        }
        let _ = writeln!(
            findings,
            "- {}, {count} draws: the quasi-static limit has a reference for {} of them (settled to 1e-7 or better; none \
             where a knee from very slow to very fast growth enlarges every error of time), the equations of motion \
             for {} (none where the motion leaves the elastic branch either).",
            self.material.title(),
            count - unsettled,
            count - missing
        );
        let line = |kind: SolverKind, errors: fn(&Errors) -> &Vec<f64>| {
            let chosen = || lines.iter().filter(move |line| line.0 == kind);
            let floor = |value: f64| value.max(1e-16);
            let cost: Vec<f64> = chosen().map(|line| line.1).collect();
            let middle: Vec<f64> = chosen().map(|line| floor(median(errors(&line.2)))).collect();
            let upper = chosen().map(|line| floor(worst(errors(&line.2)))).collect();
            let band = Band { lower: middle.clone(), upper };
            (cost, middle, band)
        };
        let series = [
            ("closed form", Role::Series(0), line(SolverKind::ClosedForm, |e| &e.balance)),
            (
                "quasi-static, tolerance 1e-2 … 1e-12",
                Role::Series(1),
                line(SolverKind::QuasiStatic, |e| &e.balance),
            ),
            (
                "verlet in batches, step 0.15 … 0.01 t_{c}",
                Role::Series(3),
                line(SolverKind::Verlet, |e| &e.balance),
            ),
            (
                "verlet against the equations of motion",
                Role::Series(2),
                line(SolverKind::Verlet, |e| &e.motion),
            ),
        ];
        Ok(self.figure(
            format!(
                "{}, {count} draws from the prior: median, and up to the worst",
                self.material.title()
            ),
            series.map(|(name, role, (cost, error, band))| (name, role, cost, error, band)),
        ))
    }

    /// What the issue of speed is about: the chosen solver against the paper's run.
    fn reach(
        &self,
        points: &[(Control, u64, f64, f64)],
        timings: &[Timing],
        findings: &mut String,
    ) {
        let find = |kind: SolverKind, step: Option<f64>| {
            points.iter().zip(timings).find(|(point, _)| {
                let settings = &point.0.settings;
                settings.kind == kind
                    && step.is_none_or(|step| settings.step_over_collision_time == step)
            })
        };
        let (Some((chosen, fast)), Some((paper, slow))) =
            (find(SolverKind::ClosedForm, None), find(SolverKind::Verlet, Some(0.02)))
        else {
            return;
        };
        let _ = writeln!(
            findings,
            "- {}: closed form {} with error {:.1e}; the paper's run (verlet, 0.02 t_c, {} steps) {} with error {:.1e} \
             against the quasi-static limit and {:.1e} against the equations of motion: **{} times faster**.",
            self.material.title(),
            report::seconds(fast.median_s),
            chosen.2,
            paper.1,
            report::seconds(slow.median_s),
            paper.2,
            paper.3,
            significant(slow.median_s / fast.median_s, 3),
        );
    }

    #[allow(clippy::too_many_arguments, reason = "one per column")]
    fn row(
        &self,
        parameters: &str,
        control: &Control,
        stops: &str,
        timing: &Timing,
        steps: u64,
        balance: Option<(f64, Option<f64>)>,
        motion: Option<(f64, Option<f64>)>,
        note: &str,
    ) -> Vec<String> {
        let time = |seconds: f64| format!("{seconds:.3e}");
        let error =
            |error: Option<f64>| error.map_or_else(String::new, |error| format!("{error:.2e}"));
        vec![
            self.material.to_string(),
            parameters.to_owned(),
            control.settings.kind.to_string(),
            control.shown.clone(),
            stops.to_owned(),
            time(timing.median_s),
            time(timing.lower_s),
            time(timing.upper_s),
            steps.to_string(),
            error(balance.map(|both| both.0)),
            error(balance.and_then(|both| both.1)),
            error(motion.map(|both| both.0)),
            error(motion.and_then(|both| both.1)),
            note.to_owned(),
        ]
    }

    fn refused(&self, control: &Control, error: &SolveError) -> Vec<String> {
        let mut row = vec![String::new(); 14];
        row[0] = self.material.to_string();
        row[1] = "paper".to_owned();
        row[2] = control.settings.kind.to_string();
        row[3].clone_from(&control.shown);
        row[13] = format!("refused: {error}");
        row
    }

    fn figure<const N: usize>(
        &self,
        title: String,
        series: [NamedSeries<'_>; N],
    ) -> WorkPrecisionFigure {
        WorkPrecisionFigure {
            title,
            cost_name: "time per curve".to_owned(),
            cost_unit: "s".to_owned(),
            error_name: "largest error of a/R".to_owned(),
            error_unit: String::new(),
            series: series
                .into_iter()
                .map(|(name, role, cost, error, band)| WorkPrecisionSeries {
                    name: name.to_owned(),
                    role,
                    cost,
                    error,
                    band,
                })
                .collect(),
            guide_slope: None,
        }
    }
}

/// Order of verlet where the solution is smooth: stretching alone, up to 0.9 a/R, without knee or singular start.
fn order(findings: &mut String) -> Result<(), Failure> {
    let case = Case::of(Material::Pa12)?;
    let s = case.material.table3_sintering();
    let times_s: Vec<f64> = (1..=20).map(|i| 0.02 * s.tau_s * f64::from(i) / 20.0).collect();
    let smooth = Problem {
        equations: Equations::Motion,
        scene: &case.scene,
        kinetics: Kinetics::Frenkel,
        sintering: &s,
        times_s: &times_s,
    };
    let truth =
        smooth.settled(1e-9, MOST_STEPS).map_err(|error| RunError::new(error.to_string()))?;
    let steps = [0.1, 0.05, 0.025, 0.0125];
    let mut errors = Vec::new();
    for step in steps {
        let settings = SolverSettings {
            step_over_collision_time: step,
            ..SolverSettings::of(SolverKind::Verlet)
        };
        let mut out = vec![0.0; times_s.len()];
        contact_ratios(&case.scene, Kinetics::Frenkel, &s, &settings, &times_s, &mut out)
            .map_err(RunError::new)?;
        errors.push(difference(&out, &truth.contact_ratio));
    }
    let slope = (errors[0] / errors[3]).log2() / 3.0;
    let shown: Vec<String> = errors.iter().map(|error| format!("{error:.2e}")).collect();
    let _ = writeln!(
        findings,
        "- verlet where the solution is smooth (PA12, Frenkel's law from rest, steps {steps:?} t_c): errors {} against the equations of motion, **order {slope:.2}**. At the knee the rate bends within a step: first order once.",
        shown.join(", ")
    );
    Ok(())
}

fn controls(steps: &[f64]) -> Vec<Control> {
    let mut controls = vec![Control { settings: SolverSettings::default(), shown: String::new() }];
    controls.extend((2..=12).map(|digits| {
        let tolerance = 10f64.powi(-digits);
        let settings = SolverSettings { tolerance, ..SolverSettings::of(SolverKind::QuasiStatic) };
        Control { settings, shown: format!("tolerance {tolerance:.0e}") }
    }));
    controls.extend(steps.iter().map(|&step| {
        let settings = SolverSettings {
            step_over_collision_time: step,
            ..SolverSettings::of(SolverKind::Verlet)
        };
        Control { settings, shown: format!("step {step} t_c") }
    }));
    controls
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

fn median(errors: &[f64]) -> f64 {
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}
