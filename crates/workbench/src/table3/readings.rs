//! Ways to read Table 3, each compared with the paper's statements on its curves.

use dem_core::printed::{self, PrintedTable3};
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios, knee,
    time_to_contact_ratio,
};
use serde::Serialize;

use crate::error::{InputError, Mistake};
use crate::input::experiment::Experiment;
use crate::input::material::Material;
use crate::record::FitError;

/// The eight numbers of section 4 that a reading must give: material, quantity, number.
pub(crate) const STATED: [(Material, Quantity, f64); 8] = [
    (Material::Ps, Quantity::KneeTime, 0.03),
    (Material::Ps, Quantity::EndTime, 0.11),
    (Material::Pa12, Quantity::KneeTime, 0.4),
    (Material::Pa12, Quantity::KneeHeight, 0.2),
    (Material::Pa12, Quantity::TimeToOne, 4.0),
    (Material::Pa12, Quantity::EndTime, 6.1),
    (Material::Peek, Quantity::KneeTime, 14.0),
    (Material::Peek, Quantity::KneeHeight, 0.4),
];

/// The quantity of a statement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// Time of the knee \[s\].
    KneeTime,
    /// Contact ratio of the knee.
    KneeHeight,
    /// Time at which a/R = 1 \[s\].
    TimeToOne,
    /// Time at which growth ends \[s\].
    EndTime,
}

impl Quantity {
    /// Its value on a three-stage curve; none for a time that never comes.
    pub(crate) fn of(self, scene: &PairScene, sintering: &Sintering) -> Option<f64> {
        let time = |target| time_to_contact_ratio(scene, Kinetics::ThreeStage, sintering, target);
        match self {
            Self::KneeTime => Some(knee(scene, sintering).time_s),
            Self::KneeHeight => Some(knee(scene, sintering).contact_ratio),
            Self::TimeToOne => time(1.0),
            Self::EndTime => time(scene.final_contact_ratio()),
        }
    }
}

/// A way to read Table 3.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// Short name.
    pub name: String,
    /// Its interpretation of the printed numbers.
    pub meaning: String,
    /// The SI parameters of eqs. 3 to 5 it leads to: PS, PA12, PEEK; each C1, tau_s, delta_c.
    pub sintering: [[f64; 3]; 3],
    /// The stated quantities under it, in the order of `STATED`.
    pub values: Vec<f64>,
    /// Root mean square of the natural logarithm of value over statement.
    pub rms_ln: f64,
    /// RMSE of its curves against the measurements: PS, PA12, PEEK.
    pub rmse: [f64; 3],
}

/// A reading as a function: printed numbers and radius to SI.
type Read = fn(&PrintedTable3, f64) -> Sintering;

const READINGS: [(&str, &str, Read); 6] = [
    ("literal", "C1, tau_s and delta_c as printed are those of eqs. 3 to 5", |p, _| Sintering {
        c1: p.c1,
        tau_s: p.tau_s,
        delta_c: p.delta_c,
        lambda: 0.0,
    }),
    (
        "tau_s = R/(8 C1 gamma)",
        "C1 and delta_c as printed, tau_s from the identity printed below eq. 5",
        |p, radius_m| {
            // The surface tension is the same within 16 % for the three powders; each has its own.
            let gamma = Material::ALL
                .into_iter()
                .map(Material::powder)
                .find(|powder| powder.radius_m == radius_m)
                .map_or(f64::NAN, |powder| powder.surface_tension_n_per_m);
            Sintering {
                c1: p.c1,
                tau_s: radius_m / (8.0 * p.c1 * gamma),
                delta_c: p.delta_c,
                lambda: 0.0,
            }
        },
    ),
    (
        "tau_s / R",
        "only stretching carries the factor R; C1 and delta_c as printed",
        |p, radius_m| Sintering {
            c1: p.c1,
            tau_s: p.tau_s / radius_m,
            delta_c: p.delta_c,
            lambda: 0.0,
        },
    ),
    (
        "all rates times R",
        "both rates carry the factor R, eq. 4 and the knee otherwise as printed",
        |p, radius_m| Sintering {
            c1: p.c1 * radius_m,
            tau_s: p.tau_s / radius_m,
            delta_c: p.delta_c,
            lambda: 0.0,
        },
    ),
    (
        "knee at delta_c/(2R)",
        "as the last one, but with the knee of a public copy of the code, (1/2)(63 pi^3)^(1/5) (delta_c/(2R))^(2/5)",
        |p, radius_m| Sintering {
            c1: p.c1 * radius_m * radius_m / (512.0 * p.delta_c),
            tau_s: p.tau_s / radius_m,
            delta_c: p.delta_c / std::f64::consts::SQRT_2,
            lambda: 0.0,
        },
    ),
    (
        "this program's",
        "both rates carry the factor R, radius R* = R/2, knee (1/2)(63 pi^3)^(1/5) (delta_c/(4R))^(2/5), B = (63 pi^3/16) gamma delta_c C1/(512 R)",
        printed::from_printed,
    ),
];

/// All readings, the worst first and ours last.
pub(crate) fn all() -> Result<Vec<Reading>, InputError> {
    READINGS
        .iter()
        .map(|(name, meaning, read)| {
            let sintering =
                Material::ALL.map(|material| read(&material.table3(), material.powder().radius_m));
            let mut values = Vec::new();
            for (material, quantity, _) in STATED {
                let scene = scene(&Experiment::of_material(material)?)?;
                let value = quantity.of(&scene, &sintering[material as usize]);
                values.push(value.unwrap_or(f64::INFINITY));
            }
            let squares: f64 = values
                .iter()
                .zip(STATED)
                .map(|(value, (_, _, stated))| (value / stated).ln().powi(2))
                .sum();
            Ok(Reading {
                name: (*name).to_owned(),
                meaning: (*meaning).to_owned(),
                sintering: sintering.map(|s| [s.c1, s.tau_s, s.delta_c]),
                rms_ln: (squares / values.len() as f64).sqrt(),
                rmse: [
                    rmse(Material::Ps, &sintering[0])?,
                    rmse(Material::Pa12, &sintering[1])?,
                    rmse(Material::Peek, &sintering[2])?,
                ],
                values,
            })
        })
        .collect()
}

fn scene(experiment: &Experiment) -> Result<PairScene, InputError> {
    PairSpec::new(experiment.powder, experiment.final_contact_ratio).build().map_err(|error| {
        InputError::new(&experiment.description_name, Mistake::OutOfRange).found(error)
    })
}

fn rmse(material: Material, sintering: &Sintering) -> Result<f64, InputError> {
    let experiment = Experiment::of_material(material)?;
    let observed = experiment.observations(None)?;
    let mut curve = vec![0.0; observed.time_s.len()];
    contact_ratios(
        &scene(&experiment)?,
        Kinetics::ThreeStage,
        sintering,
        &SolverSettings::of(SolverKind::ClosedForm),
        &observed.time_s,
        &mut curve,
    )
    .map_err(|error| InputError::new("Table 3", Mistake::OutOfRange).found(error))?;
    Ok(FitError::of(&observed.contact_ratio, &curve).rmse)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_reading_gives_every_statement_within_half_and_every_other_one_fails_by_a_factor_of_two()
    {
        let readings = all().expect("readings");
        let (ours, others) = readings.split_last().expect("readings");
        for (value, (material, quantity, stated)) in ours.values.iter().zip(STATED) {
            let factor = (value / stated).max(stated / value);
            assert!(factor < 1.5, "{material} {quantity:?}: {value}, stated {stated}");
        }
        assert!(ours.rms_ln < 0.2, "{}", ours.rms_ln);
        for other in others {
            let worst = other
                .values
                .iter()
                .zip(STATED)
                .map(|(value, (_, _, stated))| (value / stated).max(stated / value))
                .fold(0.0, f64::max);
            assert!(worst > 2.0, "{} fails nothing by more than {worst}", other.name);
            assert!(other.rms_ln > 2.0 * ours.rms_ln, "{}: {}", other.name, other.rms_ln);
            let sum = |reading: &Reading| reading.rmse.iter().sum::<f64>();
            assert!(sum(other) > sum(ours), "{} fits the measurements better", other.name);
        }
        // "thirty thousand times too soon": 6.1 s against 2.0e-4 s.
        let literal = &readings[0].values[5];
        assert!((6.1 / literal / 3.0e4 - 1.0).abs() < 0.05, "{literal}");
    }

    #[test]
    fn the_knee_of_the_public_copy_is_what_its_reading_gives() {
        // R* = R/2 and 2 a/R = (63 pi^3)^(1/5) ((1/8) delta_c / (R*/2))^(2/5).
        let readings = all().expect("readings");
        let radius_m = Material::Pa12.powder().radius_m;
        let delta_c = Material::Pa12.table3().delta_c;
        let threshold = (63.0 * std::f64::consts::PI.powi(3)).powf(0.2)
            * (delta_c / 8.0 / (0.25 * radius_m)).powf(0.4);
        assert!((readings[4].values[3] / (0.5 * threshold) - 1.0).abs() < 1e-12);
        // Its zipping rate is that of our reading: the same B.
        let b = |s: &[f64; 3]| s[0] * s[2] * s[2];
        let (copy, ours) = (&readings[4].sintering[1], &readings[5].sintering[1]);
        assert!((b(copy) / b(ours) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_zipping_rate_of_the_public_copy_integrates_to_the_b_of_our_reading() {
        // Step by step as the code does, with R* = R/2, at an overlap of 2 % of R, in equilibrium:
        // force over adhesion parameter is fa/(fa/R) = R.
        use std::f64::consts::PI;
        for material in Material::ALL {
            let powder = material.powder();
            let (radius_m, gamma) = (powder.radius_m, powder.surface_tension_n_per_m);
            let table = material.table3();
            let effective = 0.5 * radius_m;
            let overlap = 0.02 * radius_m;
            let factor = (63.0 * PI.powi(3) / 16.0).powf(2.0 / 7.0)
                * (table.delta_c / effective).powf(2.0 / 7.0)
                * (table.c1 * gamma / effective).powf(2.0 / 7.0);
            let time = (8.0 * overlap / (effective * factor)).powf(3.5);
            let rate = effective * factor * 2.0 / 7.0 * time.powf(-5.0 / 7.0) * radius_m;
            // dx/dt = (2/7) B x^(-5/2)
            let x: f64 = overlap / radius_m;
            let b = 3.5 * rate / radius_m * x.powf(2.5);
            let stated =
                63.0 * PI.powi(3) / 16.0 * gamma * table.delta_c * table.c1 / (512.0 * radius_m);
            assert!((b / stated - 1.0).abs() < 1e-12, "{material}: {b} {stated}");
            let si = material.table3_sintering();
            let eq4 = 63.0 * PI.powi(3) / 16.0
                * (si.delta_c / radius_m).powi(2)
                * (2.0 * si.c1 * gamma / radius_m);
            assert!((b / eq4 - 1.0).abs() < 1e-12, "{material}: {b} {eq4}");
        }
    }
}
