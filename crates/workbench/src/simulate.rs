//! `calibrate simulate`: one neck growth curve.

use std::fmt::Write as _;
use std::io::Write as _;

use dem_core::{
    Curve, Kinetics, Knee, PairScene, PairSpec, Sintering, SolveError, SolverKind, SolverSettings,
    StopReason, choose_solver, knee, printed, time_to_contact_ratio,
};
use serde_json::{Value, json};

use crate::args::{SimulateArgs, SolverArg};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::experiment::Experiment;
use crate::material::Material;
use crate::number::significant;
use crate::{observation_table, output, text_file};

/// Computes the curve, writes it, and says on standard error what happened when.
///
/// # Errors
///
/// [`Failure`]: a mistake in what was given, or a solver that cannot do it.
pub fn run(args: &SimulateArgs) -> Result<(), Failure> {
    let request = Request::from_args(args)?;
    if let Some(out) = &args.out {
        output::check_file(out)?;
    }
    let curve = dem_core::simulate(
        &request.scene,
        request.kinetics,
        &request.sintering,
        &request.settings,
        &request.times_s,
    )
    .map_err(refused)?;
    let events = Events::of(&request);
    if !args.quiet {
        eprint!("{}", request.report(&events, &curve));
    }
    let text = if args.json { to_json(&request, &events, &curve)? } else { to_csv(&curve) };
    match &args.out {
        Some(out) => {
            output::write_file(out, text.as_bytes())?;
            if !args.quiet {
                eprintln!("curve     {} points -> {}", curve.time_s.len(), out.display());
            }
        }
        None => std::io::stdout().lock().write_all(text.as_bytes())?,
    }
    Ok(())
}

/// The checked request.
struct Request {
    experiment: Experiment,
    scene: PairScene,
    kinetics: Kinetics,
    sintering: Sintering,
    from_table3: bool,
    settings: SolverSettings,
    reason: String,
    times_s: Vec<f64>,
}

impl Request {
    fn from_args(args: &SimulateArgs) -> Result<Self, InputError> {
        let experiment = match (&args.experiment, args.material) {
            (Some(path), material) => Experiment::open(path, material)?,
            (None, Some(material)) => Experiment::of_material(material)?,
            (None, None) => {
                return Err(missing("--material", "the particles").help(
                    "add --material ps|pa12|peek, or --experiment FILE for your own powder",
                ));
            }
        };
        let phi = args.phi.unwrap_or(experiment.final_contact_ratio);
        let scene = PairSpec::new(experiment.powder, phi).build().map_err(|error| {
            InputError::new(&experiment.description_name, Mistake::OutOfRange).found(error)
        })?;
        let sintering = sintering(args, &experiment)?;
        let (settings, reason) = solver(args, &scene)?;
        let times_s = times(args, &experiment)?;
        Ok(Self {
            experiment,
            scene,
            kinetics: args.kinetics,
            sintering,
            from_table3: args.table3,
            settings,
            reason,
            times_s,
        })
    }

    fn report(&self, events: &Events, curve: &Curve) -> String {
        let Self { experiment, scene, sintering, kinetics, .. } = self;
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
        let origin = if self.from_table3 { " (Table 3 of the paper, in SI)" } else { "" };
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
                format!("tau_s = {tau_s} s{origin}; {kinetics} has no C1 and delta_c")
            },
        );
        line("solver", self.reason.clone());
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
            line("knee", format!("{}{limit}", describe(knee)));
        }
        let reached = |time: Option<f64>| match time {
            Some(time) => format!("at {} s{limit}", significant(time, 4)),
            None => "never".to_owned(),
        };
        line("a/R = 1", reached(events.contact_ratio_1_s));
        line("phi", reached(events.phi_s));
        text
    }
}

/// When things happen, in the quasi-static limit.
struct Events {
    knee: Option<Knee>,
    contact_ratio_1_s: Option<f64>,
    phi_s: Option<f64>,
}

impl Events {
    fn of(request: &Request) -> Self {
        let Request { scene, kinetics, sintering, .. } = request;
        let when = |target| time_to_contact_ratio(scene, *kinetics, sintering, target);
        Self {
            knee: kinetics.separates_c1_from_delta_c().then(|| knee(scene, sintering)),
            contact_ratio_1_s: when(1.0),
            phi_s: when(scene.final_contact_ratio()),
        }
    }
}

fn describe(knee: &Knee) -> String {
    let ratio = knee.contact_ratio;
    if !knee.has_stretching {
        format!("none: a_ve/R = {ratio:.3} lies above phi, the pair zips to the end")
    } else if !knee.has_zipping {
        format!("none: a_ve/R = {ratio:.3} lies below the adhesive contact, stage 2 is absent")
    } else {
        format!("at {} s, a/R = {ratio:.3}", significant(knee.time_s, 4))
    }
}

fn missing(option: &str, expected: &str) -> InputError {
    InputError::new(option, Mistake::MissingField).found("missing").expected(expected)
}

fn sintering(args: &SimulateArgs, experiment: &Experiment) -> Result<Sintering, InputError> {
    if args.table3 {
        let Some(material) = experiment.material else {
            return Err(InputError::new("--table3", Mistake::Conflict)
                .found(format_args!("{} is not a material of Table 3", experiment.name))
                .help("use --material ps|pa12|peek, or give --c1, --tau-s and --delta-c"));
        };
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
    let tau_s = required("--tau-s", args.tau_s, "the sintering time [s]")?;
    if !args.kinetics.uses_c1_delta_c() {
        for (option, value) in [("--c1", args.c1), ("--delta-c", args.delta_c)] {
            if value.is_some() {
                return Err(InputError::new(option, Mistake::Conflict)
                    .found(format_args!("the kinetics {} do not have it", args.kinetics))
                    .help("leave it out, or choose --kinetics three-stage"));
            }
        }
        // Never looked at by these kinetics.
        return Ok(Sintering { c1: f64::NAN, tau_s, delta_c: f64::NAN });
    }
    Ok(Sintering {
        c1: required("--c1", args.c1, "the fluidity [1/(Pa s)]")?,
        tau_s,
        delta_c: required("--delta-c", args.delta_c, "the cut-off distance [m]")?,
    })
}

fn solver(args: &SimulateArgs, scene: &PairScene) -> Result<(SolverSettings, String), InputError> {
    let (kind, reason) = match args.solver {
        SolverArg::Auto => {
            let choice = choose_solver(scene, args.kinetics, args.tolerance);
            (choice.kind, choice.reason)
        }
        SolverArg::Forced(kind) => (kind, format!("{kind}: as asked by --solver")),
    };
    let defaults = SolverSettings::of(kind);
    for (option, given) in [("--step", args.step.is_some()), ("--from-contact", args.from_contact)]
    {
        if given && kind != SolverKind::Verlet {
            return Err(InputError::new(option, Mistake::Conflict)
                .found(format_args!("the solver {kind} does not have it"))
                .help("add --solver verlet, or leave it out"));
        }
    }
    let settings = SolverSettings {
        tolerance: args.tolerance,
        step_over_collision_time: args.step.unwrap_or(defaults.step_over_collision_time),
        from_contact: args.from_contact,
        ..defaults
    };
    Ok((settings, reason))
}

fn times(args: &SimulateArgs, experiment: &Experiment) -> Result<Vec<f64>, InputError> {
    if let Some(path) = &args.times {
        return observation_table::parse_times(
            &path.display().to_string(),
            &text_file::read(path)?,
        );
    }
    let end = match args.t_end {
        Some(end) => end,
        None => experiment.table.span_s()[1],
    };
    let last = args.points - 1;
    let times = (0..args.points).map(|point| end * (point as f64 / last as f64)).collect();
    Ok(times)
}

/// What the solver refuses is the user's mistake where it names an option, a failed run otherwise.
fn refused(error: SolveError) -> Failure {
    let option = match &error {
        SolveError::Field { field: "c1", .. } => "--c1",
        SolveError::Field { field: "tau_s", .. } => "--tau-s",
        SolveError::Field { field: "delta_c", .. } => "--delta-c",
        SolveError::Field { field: "tolerance", .. } => "--tolerance",
        SolveError::Field { field: "step_over_collision_time", .. }
        | SolveError::UnstableStep { .. } => "--step",
        _ => return RunError::new(error).into(),
    };
    InputError::new(option, Mistake::OutOfRange).found(error).into()
}

fn to_csv(curve: &Curve) -> String {
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

fn to_json(request: &Request, events: &Events, curve: &Curve) -> Result<String, RunError> {
    let Request { experiment, scene, kinetics, sintering, settings, reason, .. } = request;
    let powder = scene.powder();
    let printed =
        kinetics.uses_c1_delta_c().then(|| printed::to_printed(sintering, scene.radius_m())).map(
            |printed| json!({"c1": printed.c1, "tau_s": printed.tau_s, "delta_c": printed.delta_c}),
        );
    let value: Value = json!({
        "experiment": experiment.name,
        "material": experiment.material.map(Material::name),
        "powder": {
            "radius_m": powder.radius_m,
            "youngs_modulus_pa": powder.youngs_modulus_pa,
            "surface_tension_n_per_m": powder.surface_tension_n_per_m,
            "density_kg_per_m3": powder.density_kg_per_m3,
        },
        "final_contact_ratio": scene.final_contact_ratio(),
        "kinetics": kinetics.name(),
        "sintering": {"c1": sintering.c1, "tau_s": sintering.tau_s, "delta_c": sintering.delta_c},
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
            "knee_s": events.knee.map(|knee| knee.time_s),
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
    let mut text = serde_json::to_string_pretty(&value)
        .map_err(|error| RunError::new(format_args!("cannot write JSON: {error}")))?;
    text.push('\n');
    Ok(text)
}
