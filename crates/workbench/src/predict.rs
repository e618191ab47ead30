//! `calibrate predict`: the sintering time of a pair from a saved posterior, with its interval.
//!
//! Every posterior draw is pushed through the exact curve; nothing is calibrated again. For another radius
//! tau_s moves with it, tau_s(R) = tau_s R/R_cal; C1 and delta_c belong to the material and stay.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use dem_core::{
    Kinetics, PairSpec, Powder, Sintering, SolverKind, SolverSettings, contact_ratios,
    time_to_contact_ratio,
};
use serde::Serialize;

use crate::args::PredictArgs;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::number::significant;
use crate::posterior_file::{self, PosteriorFile};
use crate::parameter::ParameterName;
use crate::run::read_draws;
use crate::weighted::Weighted;
use crate::{output, summary};

/// A quantity under the posterior, over the draws that have it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Predicted {
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
}

impl Predicted {
    fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let draws = Weighted::new(values.into_iter().map(|value| (value, 1.0)));
        let median = draws.quantile(0.5);
        median.is_finite().then(|| Self {
            median,
            eti50: draws.interval(0.5),
            eti90: draws.interval(0.9),
            eti95: draws.interval(0.95),
        })
    }
}

/// When a contact ratio is reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinteringTime {
    /// The target a/R.
    pub contact_ratio: f64,
    /// The time \[s\] over the draws that reach it; none where no draw does.
    pub time_s: Option<Predicted>,
    /// Draws that never reach it, as their curve ends below.
    pub never: usize,
    /// All draws.
    pub draws: usize,
}

/// The contact ratio after a given time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAfter {
    /// The time \[s\].
    pub time_s: f64,
    /// a/R then.
    pub contact_ratio: Predicted,
}

/// What was predicted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// The run that the draws come from.
    pub name: String,
    /// Its kinetics.
    pub kinetics: String,
    /// Radius of the predicted pair \[m\].
    pub radius_m: f64,
    /// Radius that the posterior was calibrated at \[m\].
    pub calibrated_radius_m: f64,
    /// Whether the posterior's own diagnostics let it be trusted.
    pub trusted: bool,
    /// Sintering times, one per target.
    pub sintering: Vec<SinteringTime>,
    /// Contact ratios, one per time.
    pub after: Vec<ContactAfter>,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

/// One posterior draw as the pair model takes it, at the predicted radius.
struct PairDraw {
    scene: dem_core::PairScene,
    sintering: Sintering,
}

/// Runs the command.
///
/// # Errors
///
/// [`Failure`] for files that are missing or cut off, and for targets that make no sense.
pub fn run(args: &PredictArgs) -> Result<(), Failure> {
    let path = posterior_file::locate(&args.posterior);
    let file = posterior_file::read(&path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let theta = read_draws(&file, folder)?;
    let mut targets = args.contact_ratio.clone();
    // The paper counts coalescence in percent of a/R = 1.
    targets.extend(args.coalescence.iter().map(|percent| percent / 100.0));
    if targets.is_empty() && args.after.is_empty() {
        return Err(InputError::new("predict", Mistake::MissingField)
            .found("nothing to predict")
            .expected("--contact-ratio A/R, --coalescence PERCENT or --after SECONDS")
            .help("calibrate predict --posterior results/pa12 --contact-ratio 0.9")
            .into());
    }
    let prediction = predict(&file, &theta, &targets, &args.after, args.radius_m)?;
    if let Some(out) = &args.out {
        output::write_file(out, csv(&prediction).as_bytes())?;
    }
    let mut stdout = std::io::stdout().lock();
    if args.json {
        let json = serde_json::to_string_pretty(&prediction).map_err(RunError::new)?;
        writeln!(stdout, "{json}")?;
    } else {
        write!(stdout, "{}", sentences(&file, &prediction))?;
    }
    Ok(())
}

/// Predicts from draws, one column per parameter of `file`.
///
/// # Errors
///
/// [`Failure`] for a radius or target that the model cannot take.
pub fn predict(
    file: &PosteriorFile,
    theta: &[Vec<f64>],
    targets: &[f64],
    after_s: &[f64],
    radius_m: Option<f64>,
) -> Result<Prediction, Failure> {
    let plan = &file.plan;
    let kinetics = plan.kinetics()?;
    let calibrated_radius_m = plan.experiment.radius_m;
    let radius_m = radius_m.unwrap_or(calibrated_radius_m);
    let draws = pair_draws(file, theta, radius_m)?;
    let sintering = targets
        .iter()
        .map(|&target| {
            let times: Vec<f64> = draws
                .iter()
                .filter_map(|draw| {
                    time_to_contact_ratio(&draw.scene, kinetics, &draw.sintering, target)
                })
                .collect();
            SinteringTime {
                contact_ratio: target,
                never: draws.len() - times.len(),
                draws: draws.len(),
                time_s: Predicted::of(times),
            }
        })
        .collect();
    let after = contact_after(&draws, kinetics, after_s)?;
    let mut advice = file.advice.clone();
    if !file.is_posterior {
        advice.insert(0, "the draws are not of a posterior: the noise was tuned".to_owned());
    }
    if kinetics == Kinetics::Pokluda || kinetics == Kinetics::ThreeStagePokluda {
        let limit = 2f64.cbrt();
        if targets.iter().any(|target| (target - limit).abs() < 1e-3) {
            advice.push(format!(
                "under the {kinetics} kinetics a/R approaches 2^(1/3) for ever: times to it have no meaning"
            ));
        }
    }
    Ok(Prediction {
        name: plan.name.clone(),
        kinetics: plan.kinetics.clone(),
        radius_m,
        calibrated_radius_m,
        trusted: summary::trusted(file),
        sintering,
        after,
        advice,
    })
}

fn pair_draws(
    file: &PosteriorFile,
    theta: &[Vec<f64>],
    radius_m: f64,
) -> Result<Vec<PairDraw>, Failure> {
    let plan = &file.plan;
    let names = plan.parameter_names()?;
    let powder = Powder { radius_m, ..plan.powder() };
    let count = theta.first().map_or(0, Vec::len);
    let value = |name: ParameterName, draw: usize| {
        names.iter().position(|known| *known == name).map(|place| theta[place][draw])
    };
    (0..count)
        .map(|draw| {
            let phi =
                value(ParameterName::Phi, draw).unwrap_or(plan.experiment.final_contact_ratio);
            let scene = PairSpec::new(powder, phi)
                .build()
                .map_err(|error| InputError::new("--radius-m", Mistake::OutOfRange).found(error))?;
            let or_unused = |name| value(name, draw).unwrap_or(1.0);
            let sintering = Sintering {
                c1: or_unused(ParameterName::C1),
                tau_s: or_unused(ParameterName::TauS),
                delta_c: or_unused(ParameterName::DeltaC),
            };
            let sintering = sintering.at_radius(plan.experiment.radius_m, radius_m);
            Ok(PairDraw { scene, sintering })
        })
        .collect()
}

fn contact_after(
    draws: &[PairDraw],
    kinetics: Kinetics,
    after_s: &[f64],
) -> Result<Vec<ContactAfter>, Failure> {
    let settings = SolverSettings::of(SolverKind::ClosedForm);
    let mut times_s = after_s.to_vec();
    times_s.sort_by(f64::total_cmp);
    let mut columns = vec![Vec::with_capacity(draws.len()); times_s.len()];
    let mut curve = vec![0.0; times_s.len()];
    if times_s.is_empty() {
        return Ok(Vec::new());
    }
    for PairDraw { scene, sintering } in draws {
        contact_ratios(scene, kinetics, sintering, &settings, &times_s, &mut curve)
            .map_err(RunError::new)?;
        for (column, value) in columns.iter_mut().zip(&curve) {
            column.push(*value);
        }
    }
    times_s
        .into_iter()
        .zip(columns)
        .map(|(time_s, column)| {
            let contact_ratio = Predicted::of(column)
                .ok_or_else(|| RunError::new("the posterior holds no draw to predict from"))?;
            Ok(ContactAfter { time_s, contact_ratio })
        })
        .collect()
}

/// What a person reads.
fn sentences(file: &PosteriorFile, prediction: &Prediction) -> String {
    let mut text = String::new();
    let radius = format!("R = {} um", significant(1e6 * prediction.radius_m, 3));
    let _ = writeln!(
        text,
        "{}, {radius}, {} kinetics{}",
        file.plan.title,
        prediction.kinetics,
        if prediction.radius_m == prediction.calibrated_radius_m {
            String::new()
        } else {
            format!(
                " (calibrated at {} um; tau_s moved in proportion to R)",
                significant(1e6 * prediction.calibrated_radius_m, 3)
            )
        }
    );
    for target in &prediction.sintering {
        let ratio = significant(target.contact_ratio, 3);
        match &target.time_s {
            Some(time) => {
                let _ = writeln!(
                    text,
                    "  a/R = {ratio} is reached after {} s (50 % {} .. {} s, 95 % {} .. {} s)",
                    significant(time.median, 3),
                    significant(time.eti50[0], 3),
                    significant(time.eti50[1], 3),
                    significant(time.eti95[0], 3),
                    significant(time.eti95[1], 3),
                );
            }
            None => {
                let _ = writeln!(text, "  a/R = {ratio} is never reached");
            }
        }
        if target.never > 0 {
            let _ = writeln!(
                text,
                "    {} of {} draws never reach it and are not in the interval (phi = {})",
                target.never,
                target.draws,
                significant(file.plan.experiment.final_contact_ratio, 4)
            );
        }
    }
    for after in &prediction.after {
        let ratio = &after.contact_ratio;
        let _ = writeln!(
            text,
            "  after {} s a/R is {} (50 % {} .. {}, 95 % {} .. {})",
            significant(after.time_s, 4),
            significant(ratio.median, 3),
            significant(ratio.eti50[0], 3),
            significant(ratio.eti50[1], 3),
            significant(ratio.eti95[0], 3),
            significant(ratio.eti95[1], 3),
        );
    }
    for line in &prediction.advice {
        let _ = writeln!(text, "  careful: {line}");
    }
    text
}

/// One line per prediction.
fn csv(prediction: &Prediction) -> String {
    let mut text = String::from(
        "predicted,given,unit,median,eti50_lower,eti50_upper,eti90_lower,eti90_upper,eti95_lower,eti95_upper,draws_never\n",
    );
    let row = |what: &str, given: f64, unit: &str, p: Option<&Predicted>, never: usize| {
        let numbers = p.map_or_else(
            || ",,,,,,".to_owned(),
            |p| {
                format!(
                    "{},{},{},{},{},{},{}",
                    p.median,
                    p.eti50[0],
                    p.eti50[1],
                    p.eti90[0],
                    p.eti90[1],
                    p.eti95[0],
                    p.eti95[1]
                )
            },
        );
        format!("{what},{given},{unit},{numbers},{never}\n")
    };
    for target in &prediction.sintering {
        text.push_str(&row(
            "time to contact_ratio",
            target.contact_ratio,
            "s",
            target.time_s.as_ref(),
            target.never,
        ));
    }
    for after in &prediction.after {
        text.push_str(&row(
            "contact_ratio after time_s",
            after.time_s,
            "1",
            Some(&after.contact_ratio),
            0,
        ));
    }
    text
}
