//! The sintering time of a pair from a saved posterior, with its interval.
//!
//! Every posterior draw is pushed through the exact curve; nothing is calibrated again. For another radius
//! tau_s moves with it, tau_s(R) = tau_s R/R_cal; C1 and delta_c belong to the material and stay.

use dem_core::{
    Kinetics, PairScene, Sintering, SolverKind, SolverSettings, contact_ratios,
    time_to_contact_ratio,
};
use serde::Serialize;

use crate::careful::Careful;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::number::significant;
use crate::pair::draws::PairDraws;
use crate::pair::parameter::ParameterName;
use smc_calib::Weighted;

/// A quantity over the posterior draws that have it.
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

    fn text(&self, unit: &str) -> String {
        let interval =
            |[a, b]: [f64; 2]| format!("{} .. {}{unit}", significant(a, 3), significant(b, 3));
        format!(
            "{}{unit} (50 % {}, 95 % {})",
            significant(self.median, 3),
            interval(self.eti50),
            interval(self.eti95)
        )
    }
}

/// The time at which a contact ratio is reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinteringTime {
    /// The target a/R.
    pub contact_ratio: f64,
    /// The time \[s\] over the draws that reach it; none where no draw does.
    pub time_s: Option<Predicted>,
    /// Number of draws whose curve ends below the target.
    pub never: usize,
    /// Number of draws.
    pub draws: usize,
}

/// The contact ratio at a given time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactAfter {
    /// The time \[s\].
    pub time_s: f64,
    /// a/R at that time.
    pub contact_ratio: Predicted,
}

/// Sintering times and contact ratios of a pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// Name of the calibration that the draws come from.
    pub name: String,
    /// Its heading.
    #[serde(skip)]
    pub title: String,
    /// Its kinetics.
    pub kinetics: Kinetics,
    /// Radius of the predicted pair \[m\].
    pub radius_m: f64,
    /// Radius that the posterior was calibrated at \[m\].
    pub calibrated_radius_m: f64,
    /// Final contact ratio phi of the calibration.
    #[serde(skip)]
    pub final_contact_ratio: f64,
    /// Whether the posterior's own diagnostics let it be trusted.
    pub trusted: bool,
    /// Time of first contact in the clock of the table \[s\], where it was calibrated; predicted times count from it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_s: Option<Predicted>,
    /// Sintering times, one per target.
    pub sintering: Vec<SinteringTime>,
    /// Contact ratios, one per time.
    pub after: Vec<ContactAfter>,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

/// Predicts the times at which contact ratios `targets` are reached and the contact ratios at the times `after_s`, for a
/// pair of radius `radius_m` or of the calibrated one. Times count from first contact.
///
/// # Errors
///
/// [`Failure`] for a radius or target that the model cannot take, or where nothing is asked for.
pub fn predict(
    calibrated: &PairDraws,
    targets: &[f64],
    after_s: &[f64],
    radius_m: Option<f64>,
) -> Result<Prediction, Failure> {
    if targets.is_empty() && after_s.is_empty() {
        return Err(InputError::new("predict", Mistake::MissingField)
            .found("nothing to predict")
            .expected("--contact-ratio A/R, --coalescence PERCENT or --after SECONDS")
            .help("calibrate predict --posterior results/pa12 --contact-ratio 0.9")
            .into());
    }
    let PairDraws { record, pair, .. } = calibrated;
    let kinetics = pair.kinetics;
    let calibrated_radius_m = pair.powder.radius_m;
    let radius_m = radius_m.unwrap_or(calibrated_radius_m);
    let pairs = pairs(calibrated, radius_m)?;
    let sintering = targets
        .iter()
        .map(|&target| {
            let times: Vec<f64> = pairs
                .iter()
                .filter_map(|(scene, sintering)| {
                    time_to_contact_ratio(scene, kinetics, sintering, target)
                })
                .collect();
            SinteringTime {
                contact_ratio: target,
                never: pairs.len() - times.len(),
                draws: pairs.len(),
                time_s: Predicted::of(times),
            }
        })
        .collect();
    let mut advice = calibrated.advice.clone();
    if kinetics == Kinetics::Pokluda || kinetics == Kinetics::ThreeStagePokluda {
        let limit = 2f64.cbrt();
        if targets.iter().any(|target| (target - limit).abs() < 1e-3) {
            advice.push(Careful::NeverReached { kinetics: kinetics.to_string() }.to_string());
        }
    }
    Ok(Prediction {
        name: record.plan.name.clone(),
        title: record.plan.title.clone(),
        kinetics,
        radius_m,
        calibrated_radius_m,
        final_contact_ratio: pair.final_contact_ratio,
        trusted: record.trust.converged(),
        first_contact_s: Predicted::of(
            (0..calibrated.len()).filter_map(|row| calibrated.value(ParameterName::T0, row)),
        ),
        sintering,
        after: contact_after(&pairs, kinetics, after_s)?,
        advice,
    })
}

/// The pair of every draw at a radius, with its sintering parameters there.
fn pairs(calibrated: &PairDraws, radius_m: f64) -> Result<Vec<(PairScene, Sintering)>, InputError> {
    let unused = Sintering { c1: 1.0, tau_s: 1.0, delta_c: 1.0 };
    (0..calibrated.len())
        .map(|row| {
            let scene = calibrated
                .pair_of(row, radius_m)
                .map_err(|error| InputError::new("--radius-m", Mistake::OutOfRange).found(error))?;
            let sintering = calibrated.sintering(row, unused);
            Ok((scene, sintering.at_radius(calibrated.pair.powder.radius_m, radius_m)))
        })
        .collect()
}

fn contact_after(
    pairs: &[(PairScene, Sintering)],
    kinetics: Kinetics,
    after_s: &[f64],
) -> Result<Vec<ContactAfter>, Failure> {
    let settings = SolverSettings::of(SolverKind::ClosedForm);
    let mut times_s = after_s.to_vec();
    times_s.sort_by(f64::total_cmp);
    let mut columns = vec![Vec::with_capacity(pairs.len()); times_s.len()];
    let mut curve = vec![0.0; times_s.len()];
    if times_s.is_empty() {
        return Ok(Vec::new());
    }
    for (scene, sintering) in pairs {
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

impl Prediction {
    /// As text.
    pub fn text(&self) -> String {
        let elsewhere = if self.radius_m == self.calibrated_radius_m {
            String::new()
        } else {
            let calibrated_um = significant(1e6 * self.calibrated_radius_m, 3);
            format!(" (calibrated at {calibrated_um} um; tau_s moved in proportion to R)")
        };
        let radius_um = significant(1e6 * self.radius_m, 3);
        let mut lines = vec![format!(
            "{}, R = {radius_um} um, {} kinetics{elsewhere}",
            self.title, self.kinetics
        )];
        if let Some(start) = &self.first_contact_s {
            lines.push(format!(
                "  times count from first contact, at t0 = {} in the table's clock",
                start.text(" s")
            ));
        }
        for target in &self.sintering {
            let ratio = significant(target.contact_ratio, 3);
            lines.push(match &target.time_s {
                Some(time) => format!("  a/R = {ratio} is reached after {}", time.text(" s")),
                None => format!("  a/R = {ratio} is never reached"),
            });
            if target.never > 0 {
                lines.push(format!(
                    "    {} of {} draws never reach it and are not in the interval (phi = {})",
                    target.never,
                    target.draws,
                    significant(self.final_contact_ratio, 4)
                ));
            }
        }
        for after in &self.after {
            let time_s = significant(after.time_s, 4);
            lines.push(format!("  after {time_s} s a/R is {}", after.contact_ratio.text("")));
        }
        lines.extend(self.advice.iter().map(|line| format!("  careful: {line}")));
        lines.push(String::new());
        lines.join("\n")
    }

    /// As CSV, a row per prediction.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "predicted,given,unit,median,eti50_lower,eti50_upper,eti90_lower,eti90_upper,eti95_lower,eti95_upper,draws_never\n",
        );
        let mut row = |what: &str, given: f64, unit: &str, p: Option<&Predicted>, never: usize| {
            let numbers = p.map_or_else(
                || [const { String::new() }; 7],
                |p| {
                    let ([a, b], [c, d], [e, f]) = (p.eti50, p.eti90, p.eti95);
                    [p.median, a, b, c, d, e, f].map(|number| number.to_string())
                },
            );
            text.push_str(&format!("{what},{given},{unit},{},{never}\n", numbers.join(",")));
        };
        for target in &self.sintering {
            let time_s = target.time_s.as_ref();
            row("time to contact_ratio", target.contact_ratio, "s", time_s, target.never);
        }
        for after in &self.after {
            row("contact_ratio after time_s", after.time_s, "1", Some(&after.contact_ratio), 0);
        }
        text
    }
}
