//! One neck growth curve, without calibrating anything.

use std::fmt::Write as _;
use std::path::PathBuf;

use dem_core::heat::Heat;
use dem_core::{
    Curve, Kinetics, Knee, PairScene, PairSpec, Sintering, SolveError, SolverKind, SolverSettings,
    StopReason, choose_solver, contact_ratios, knee, printed, simulate_heated,
    time_to_contact_ratio,
};
use serde_json::json;

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::columns::Columns;
use crate::input::experiment::Experiment;
use crate::input::heat::HeatFields;
use crate::input::material::Material;
use crate::number::significant;
use crate::output::pretty;
use crate::pair::heat::{HeatPlan, LawPlan};
use crate::{input::observation_table, input::text_file};

/// Options of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveOptions {
    /// Built-in material.
    pub material: Option<Material>,
    /// A description, or the name of a built-in experiment.
    pub experiment: Option<PathBuf>,
    /// Final contact ratio a/R; the experiment's by default.
    pub phi: Option<f64>,
    /// Fluidity C1 \[1/(Pa s)\].
    pub c1: Option<f64>,
    /// Sintering time tau_s \[s\].
    pub tau_s: Option<f64>,
    /// Cut-off distance delta_c \[m\].
    pub delta_c: Option<f64>,
    /// Relaxation time lambda \[s\].
    pub lambda: Option<f64>,
    /// Take C1, tau_s and delta_c from Table 3 of the paper.
    pub table3: bool,
    /// How the neck grows.
    pub kinetics: Kinetics,
    /// A file with another heat than the experiment's.
    pub heat: Option<PathBuf>,
    /// How the curve is computed; the cheapest way within the tolerance by default.
    pub solver: Option<SolverKind>,
    /// Largest error of a/R allowed to the solver.
    pub tolerance: f64,
    /// Time step of the Verlet solver over the collision time.
    pub step: Option<f64>,
    /// Whether the Verlet solver starts at first contact.
    pub from_contact: bool,
    /// When the curve is wanted.
    pub times: Times,
}

/// Times of a curve.
#[derive(Debug, Clone, PartialEq)]
pub enum Times {
    /// The column `time_s` of a CSV file.
    File(PathBuf),
    /// Evenly spaced from 0.
    Even {
        /// The last time \[s\]; the last observation's by default.
        end_s: Option<f64>,
        /// Number of times.
        points: usize,
    },
}

/// A curve that was computed.
#[derive(Debug)]
pub struct Simulated {
    request: Request,
    events: Events,
    /// The curve.
    pub curve: Curve,
}

/// Computes a curve.
///
/// # Errors
///
/// [`Failure`]: a mistake in what was given, or a solver that cannot do it.
pub fn simulate(options: &CurveOptions) -> Result<Simulated, Failure> {
    let request = Request::new(options)?;
    let Request { scene, kinetics, sintering, settings, times_s, .. } = &request;
    let curve = match &request.heat {
        None => dem_core::simulate(scene, *kinetics, sintering, settings, times_s),
        Some((_, heat)) => simulate_heated(scene, (*kinetics, sintering), heat, settings, times_s),
    };
    let curve = curve.map_err(refused)?;
    Ok(Simulated { events: Events::of(&request), request, curve })
}

/// The checked request.
#[derive(Debug)]
struct Request {
    experiment: Experiment,
    scene: PairScene,
    kinetics: Kinetics,
    sintering: Sintering,
    heat: Option<(HeatPlan, Heat)>,
    from_table3: bool,
    settings: SolverSettings,
    reason: String,
    times_s: Vec<f64>,
}

impl Request {
    fn new(options: &CurveOptions) -> Result<Self, InputError> {
        let experiment = match (&options.experiment, options.material) {
            (Some(path), material) => Experiment::open(path, material, &Columns::default())?,
            (None, Some(material)) => Experiment::of_material(material)?,
            (None, None) => {
                return Err(missing("--material", "the particles").help(
                    "add --material ps|pa12|peek, or --experiment FILE for your own powder",
                ));
            }
        };
        let phi = options.phi.unwrap_or(experiment.final_contact_ratio);
        let scene = PairSpec::new(experiment.powder, phi).build().map_err(|error| {
            InputError::new(&experiment.description_name, Mistake::OutOfRange).found(error)
        })?;
        let sintering = sintering(options, &experiment)?;
        let (settings, reason) = solver(options, &scene)?;
        let times_s = times(options, &experiment)?;
        let heat = heat(options, &experiment)?;
        Ok(Self {
            heat,
            experiment,
            scene,
            kinetics: options.kinetics,
            sintering,
            from_table3: options.table3,
            settings,
            reason,
            times_s,
        })
    }
}

/// The heat of the pair: that of the experiment, or of a file, which leaves to the experiment's what it does not say.
fn heat(
    options: &CurveOptions,
    experiment: &Experiment,
) -> Result<Option<(HeatPlan, Heat)>, InputError> {
    let asked = options.heat.as_deref().map(HeatFields::open).transpose()?;
    let own = experiment.heat.as_ref();
    let Some(fields) = asked.as_ref().or(own) else { return Ok(None) };
    let mut plan = fields.plan()?;
    // A direct amplitude is that of its own pulse.
    let fits = |own: &HeatPlan| {
        let same = own.energy() == plan.energy() || plan.energy().is_none();
        own.law == plan.law && (same || own.law != LawPlan::Direct)
    };
    if let Some(own) = own.and_then(|own| own.plan().ok()).filter(fits) {
        plan.complete_with(&own);
    }
    let heat = fields.stated(&plan, experiment.powder.radius_m)?;
    Ok(Some((plan, heat)))
}

/// When things happen, in the quasi-static limit.
#[derive(Debug)]
struct Events {
    knee: Option<Knee>,
    /// When the knee is; none where its heat ends before.
    knee_s: Option<f64>,
    contact_ratio_1_s: Option<f64>,
    phi_s: Option<f64>,
    /// a/R where the heat ends, below phi.
    freezes_at: Option<f64>,
}

impl Events {
    fn of(request: &Request) -> Self {
        let Request { scene, kinetics, sintering, .. } = request;
        let heat = request.heat.as_ref().map(|(_, heat)| heat);
        let at = |reduced_s| heat.map_or(Some(reduced_s), |heat| heat.time(reduced_s));
        let when = |target| at(time_to_contact_ratio(scene, *kinetics, sintering, target)?);
        let knee = kinetics.separates_c1_from_delta_c().then(|| knee(scene, sintering));
        let end = heat.map(Heat::reduced_time_at_end).filter(|end| end.is_finite());
        let freezes_at = |end| {
            let (mut out, closed) = ([0.0], SolverSettings::of(SolverKind::ClosedForm));
            contact_ratios(scene, *kinetics, sintering, &closed, &[end], &mut out).ok()?;
            Some(out[0])
        };
        let phi_s = when(scene.final_contact_ratio());
        Self {
            knee_s: knee.and_then(|knee| at(knee.time_s)),
            knee,
            contact_ratio_1_s: when(1.0),
            phi_s,
            // Nothing freezes that has coalesced.
            freezes_at: end.filter(|_| phi_s.is_none()).and_then(freezes_at),
        }
    }
}

fn describe(knee: &Knee, time_s: Option<f64>) -> String {
    let ratio = knee.contact_ratio;
    if !knee.has_stretching {
        format!("none: a_ve/R = {ratio:.3} lies above phi, the pair zips to the end")
    } else if !knee.has_zipping {
        format!("none: a_ve/R = {ratio:.3} lies below the adhesive contact, stage 2 is absent")
    } else if let Some(time_s) = time_s {
        format!("at {} s, a/R = {ratio:.3}", significant(time_s, 4))
    } else {
        format!("never: a/R = {ratio:.3} is more than its heat gives")
    }
}

fn missing(option: &str, expected: &str) -> InputError {
    InputError::new(option, Mistake::MissingField).found("missing").expected(expected)
}

fn sintering(options: &CurveOptions, experiment: &Experiment) -> Result<Sintering, InputError> {
    if options.table3 {
        let Some(material) = experiment.material else {
            return Err(InputError::new("--table3", Mistake::Conflict)
                .found(format_args!("{} is not a material of Table 3", experiment.name))
                .help("use --material ps|pa12|peek, or give --c1, --tau-s and --delta-c"));
        };
        if options.kinetics.uses_lambda() {
            return Err(InputError::new("--table3", Mistake::Conflict)
                .found(format_args!("Table 3 has no lambda, which {} needs", options.kinetics))
                .help("give --tau-s and --lambda, or choose other kinetics"));
        }
        // tau_s belongs to the radius of Table 1.
        return Ok(material
            .table3_sintering()
            .at_radius(material.powder().radius_m, experiment.powder.radius_m));
    }
    let required = |option: &str, value: Option<f64>, what: &str| {
        value.ok_or_else(|| {
            let error = missing(option, what).help("give it in SI, in the form of eqs. 3 to 5");
            match experiment.material {
                Some(_) => error.help("or add --table3 for the values of the paper"),
                None => error,
            }
        })
    };
    let tau_s = required("--tau-s", options.tau_s, "the sintering time [s]")?;
    let kinetics = options.kinetics;
    let with_zipping = kinetics.uses_c1_delta_c();
    for (option, value, used, other) in [
        ("--c1", options.c1, with_zipping, Kinetics::ThreeStage),
        ("--delta-c", options.delta_c, with_zipping, Kinetics::ThreeStage),
        ("--lambda", options.lambda, kinetics.uses_lambda(), Kinetics::Bellehumeur),
    ] {
        if value.is_some() && !used {
            return Err(InputError::new(option, Mistake::Conflict)
                .found(format_args!("the kinetics {kinetics} do not have it"))
                .help(format_args!("leave it out, or choose --kinetics {other}")));
        }
    }
    // What the kinetics do not have is never looked at.
    let needed = |used: bool, option: &str, value: Option<f64>, what: &str| match used {
        true => required(option, value, what),
        false => Ok(f64::NAN),
    };
    Ok(Sintering {
        c1: needed(with_zipping, "--c1", options.c1, "the fluidity [1/(Pa s)]")?,
        tau_s,
        delta_c: needed(with_zipping, "--delta-c", options.delta_c, "the cut-off distance [m]")?,
        lambda: needed(
            kinetics.uses_lambda(),
            "--lambda",
            options.lambda,
            "the relaxation time of the melt [s]",
        )?,
    })
}

fn solver(
    options: &CurveOptions,
    scene: &PairScene,
) -> Result<(SolverSettings, String), InputError> {
    let (kind, reason) = match options.solver {
        None => {
            let choice = choose_solver(scene, options.kinetics, options.tolerance);
            (choice.kind, choice.reason)
        }
        Some(kind) => (kind, format!("{kind}: as asked by --solver")),
    };
    let defaults = SolverSettings::of(kind);
    for (option, given) in
        [("--step", options.step.is_some()), ("--from-contact", options.from_contact)]
    {
        if given && kind != SolverKind::Verlet {
            return Err(InputError::new(option, Mistake::Conflict)
                .found(format_args!("the solver {kind} does not have it"))
                .help("add --solver verlet, or leave it out"));
        }
    }
    let settings = SolverSettings {
        tolerance: options.tolerance,
        step_over_collision_time: options.step.unwrap_or(defaults.step_over_collision_time),
        from_contact: options.from_contact,
        ..defaults
    };
    Ok((settings, reason))
}

fn times(options: &CurveOptions, experiment: &Experiment) -> Result<Vec<f64>, InputError> {
    match &options.times {
        Times::File(path) => observation_table::parse_times(
            &path.display().to_string(),
            &text_file::read_table(path)?.0,
        ),
        Times::Even { end_s, points } => {
            let end = end_s.unwrap_or(experiment.table.span_s()[1]);
            let last = points.saturating_sub(1).max(1);
            Ok((0..*points).map(|point| end * (point as f64 / last as f64)).collect())
        }
    }
}

/// A refusal of the solver: the user's mistake where it names an option, a failed run otherwise.
fn refused(error: SolveError) -> Failure {
    let option = match &error {
        SolveError::Field { field: "c1", .. } => "--c1",
        SolveError::Field { field: "tau_s", .. } => "--tau-s",
        SolveError::Field { field: "delta_c", .. } => "--delta-c",
        SolveError::Field { field: "lambda", .. } => "--lambda",
        SolveError::Field { field: "tolerance", .. } => "--tolerance",
        SolveError::Field { field: "step_over_collision_time", .. }
        | SolveError::UnstableStep { .. } => "--step",
        _ => return RunError::new(error).into(),
    };
    InputError::new(option, Mistake::OutOfRange).found(error).into()
}

impl Simulated {
    /// The pair, the solver and what happens when, as text.
    pub fn text(&self) -> String {
        let Self { request, events, curve } = self;
        let Request { experiment, scene, sintering, kinetics, .. } = request;
        let mut text = String::new();
        let title =
            experiment.material.map_or(experiment.name.as_str(), |material| material.title());
        let mut line = |name: &str, value: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{name:<9} {value}");
        };
        line(
            "pair",
            format!(
                "{title}, R = {} um, final a/R (phi) = {}",
                significant(scene.radius_m() * 1e6, 4),
                significant(scene.final_contact_ratio(), 4)
            ),
        );
        let origin = if request.from_table3 { " (Table 3 of the paper, in SI)" } else { "" };
        line(
            "sintering",
            if kinetics.uses_c1_delta_c() {
                format!(
                    "C1 = {} 1/(Pa s), tau_s = {} s, delta_c = {} m{origin}",
                    significant(sintering.c1, 4),
                    significant(sintering.tau_s, 4),
                    significant(sintering.delta_c, 4)
                )
            } else {
                let tau_s = significant(sintering.tau_s, 4);
                let lambda = match kinetics.uses_lambda() {
                    true => format!(", lambda = {} s", significant(sintering.lambda, 4)),
                    false => String::new(),
                };
                format!("tau_s = {tau_s} s{lambda}{origin}; {kinetics} has no C1 and delta_c")
            },
        );
        if let Some((heat, _)) = &request.heat {
            line("heat", heat.in_words());
        }
        line("solver", request.reason.clone());
        let report = &curve.report;
        let steps = match report.steps {
            0 => "no steps".to_owned(),
            steps => format!("{steps} steps, {} evaluations of the law", report.force_evaluations),
        };
        let error = report
            .error_estimate
            .map_or_else(String::new, |error| format!(", a/R within about {error:.0e}"));
        let end = match report.stop {
            StopReason::Coalesced => "full coalescence",
            _ => "the last time",
        };
        line("work", format!("{steps}{error}; ended at {end}"));
        // The solver with inertia is later than its quasi-static limit, from which these come.
        let limit = if report.kind == SolverKind::Verlet { " (without inertia)" } else { "" };
        if let Some(knee) = &events.knee {
            line("knee", format!("{}{limit}", describe(knee, events.knee_s)));
        }
        let reached = |time: Option<f64>| match time {
            Some(time) => format!("at {} s{limit}", significant(time, 4)),
            None => "never".to_owned(),
        };
        line("a/R = 1", reached(events.contact_ratio_1_s));
        line("phi", reached(events.phi_s));
        if let Some(ratio) = events.freezes_at {
            line("freezes", format!("at a/R = {}{limit}", significant(ratio, 4)));
        }
        text
    }

    /// The curve as CSV.
    pub fn csv(&self) -> String {
        let curve = &self.curve;
        let mut csv = String::from("time_s,overlap_m,plastic_overlap_m,contact_ratio\n");
        for row in 0..curve.time_s.len() {
            // Writing to a String cannot fail.
            let _ = writeln!(
                csv,
                "{},{:e},{:e},{}",
                curve.time_s[row],
                curve.overlap_m[row],
                curve.plastic_overlap_m[row],
                curve.contact_ratio[row]
            );
        }
        csv
    }

    /// The curve and what happens when, as JSON.
    pub fn json(&self) -> Result<String, RunError> {
        let Self { request, events, curve } = self;
        let Request { experiment, scene, kinetics, sintering, settings, reason, .. } = request;
        let printed =
            kinetics.uses_c1_delta_c().then(|| printed::to_printed(sintering, scene.radius_m())).map(
                |printed| json!({"c1": printed.c1, "tau_s": printed.tau_s, "delta_c": printed.delta_c}),
            );
        let mut parameters =
            json!({"c1": sintering.c1, "tau_s": sintering.tau_s, "delta_c": sintering.delta_c});
        if kinetics.uses_lambda() {
            parameters["lambda"] = json!(sintering.lambda);
        }
        let mut value = json!({
            "experiment": experiment.name,
            "material": experiment.material.map(Material::name),
            "powder": scene.powder(),
            "final_contact_ratio": scene.final_contact_ratio(),
            "kinetics": kinetics.name(),
            "sintering": parameters,
            "as_printed_in_table3": printed,
            "solver": {
                "name": settings.kind.name(),
                "reason": reason,
                "steps": curve.report.steps,
                "force_evaluations": curve.report.force_evaluations,
                "error_estimate": curve.report.error_estimate,
                "coalesced": curve.report.stop == StopReason::Coalesced,
            },
            "events": {
                "knee_s": events.knee_s,
                "knee_contact_ratio": events.knee.map(|knee| knee.contact_ratio),
                "contact_ratio_1_s": events.contact_ratio_1_s,
                "final_contact_ratio_s": events.phi_s,
            },
            "curve": {
                "time_s": curve.time_s,
                "overlap_m": curve.overlap_m,
                "plastic_overlap_m": curve.plastic_overlap_m,
                "contact_ratio": curve.contact_ratio,
            },
        });
        if let Some((plan, _)) = &request.heat {
            value["heat"] = json!(plan);
            value["events"]["freezes_at"] = json!(events.freezes_at);
        }
        pretty(&value)
    }
}
