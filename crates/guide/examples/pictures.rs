//! The guide's pictures of the model: `cargo run -p guide --example pictures -- crates/guide/pages/pictures`.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use dem_core::{
    ContactLaw, Kinetics, PairSpec, Powder, Sintering, SolverSettings, knee, paper, simulate,
};
use figures::{CurvesFigure, Figure as _, MarkedCurve, Role, Width, broken_rules};

type Done = Result<(), Box<dyn Error>>;

/// PEEK 450PF with the paper's parameters, in SI: its knee is in the middle of the curve.
const POWDER: Powder = paper::PEEK_450PF;
const SINTERING: Sintering = Sintering { c1: 7.47e-7, tau_s: 22.8, delta_c: 3.46e-7, lambda: 11.4 };
const END_S: f64 = 60.0;
/// Final contact ratio of two spheres that merge at constant volume, 2^(1/3).
const MERGED: f64 = 1.259_921_049_894_873_2;

fn main() -> Done {
    let folder = std::env::args().nth(1).map(PathBuf::from).ok_or("give a folder")?;
    write(&folder, "contact-law", &contact_law())?;
    write(&folder, "kinetics", &kinetics()?)?;
    let scaled = |factor: f64, number: &str| format!("{number}{}", times(factor));
    let c1 = |f: f64| (scaled(f, "C_{1}"), Sintering { c1: f * SINTERING.c1, ..SINTERING }, MERGED);
    let tau_s = |f: f64| {
        (scaled(f, "τ_{s}"), Sintering { tau_s: f * SINTERING.tau_s, ..SINTERING }, MERGED)
    };
    let delta_c = |f: f64| {
        let sintering = Sintering { delta_c: f * SINTERING.delta_c, ..SINTERING };
        (scaled(f, "δ_{c}"), sintering, MERGED)
    };
    let phi = |value: f64| (format!("φ = {value:.2}"), SINTERING, value);
    write(&folder, "by-c1", &growth([0.3, 1.0, 3.0].map(c1))?)?;
    write(&folder, "by-tau-s", &growth([0.5, 1.0, 2.0].map(tau_s))?)?;
    write(&folder, "by-delta-c", &growth([0.7, 1.0, 1.4].map(delta_c))?)?;
    write(&folder, "by-phi", &growth([1.0, 1.08, MERGED].map(phi))?)
}

fn times(factor: f64) -> String {
    if factor == 1.0 { String::new() } else { format!(" × {factor}") }
}

fn write(folder: &Path, name: &str, figure: &CurvesFigure) -> Done {
    let broken = broken_rules(figure, Width::Column)?;
    if !broken.is_empty() {
        return Err(broken.join("\n").into());
    }
    fs::write(folder.join(format!("{name}.svg")), figure.render(Width::Column)?.svg)?;
    Ok(())
}

/// Force against overlap while two particles are pressed together to three depths and drawn apart again, by the law itself.
fn contact_law() -> CurvesFigure {
    let law =
        ContactLaw { adhesion: 0.0, k2_max: 10.0, kc: 1.0, plastic_overlap_max: MERGED * MERGED };
    let curves = [(0, 0.5), (1, 1.1), (3, 1.9)].map(|(place, deepest)| {
        let steps = 400_u32;
        let share = |k: u32| f64::from(k) / f64::from(steps);
        let down = (0..=steps).map(|k| share(k) * deepest);
        let up = (0..=steps).map(|k| (1.0 - share(k)) * deepest);
        let mut plastic = 0.0;
        let (x, y) = down
            .chain(up)
            .map(|x| {
                let response = law.respond(x, plastic);
                plastic = response.plastic_overlap;
                (x, response.force)
            })
            .unzip();
        let name = format!("to δ/R = {deepest} and back");
        MarkedCurve { name, role: Role::Series(place), x, y, mark: None }
    });
    CurvesFigure {
        x_name: "overlap δ/R".to_owned(),
        y_name: "force f/(K_{1}R)".to_owned(),
        curves: curves.into(),
        ..CurvesFigure::default()
    }
}

/// Curves of the three-stage kinetics, each with its knee.
fn growth<const N: usize>(
    variants: [(String, Sintering, f64); N],
) -> Result<CurvesFigure, Box<dyn Error>> {
    let mut curves = Vec::new();
    for (place, (name, sintering, phi)) in variants.into_iter().enumerate() {
        let scene = PairSpec::new(POWDER, phi).build()?;
        let knee = knee(&scene, &sintering);
        let mark = Some((knee.time_s, knee.contact_ratio));
        let (x, y) = curve(Kinetics::ThreeStage, &sintering, phi)?;
        curves.push(MarkedCurve { name, role: Role::Series(place), x, y, mark });
    }
    Ok(over_time(curves))
}

/// One pair by every kinetics but the regime map, which has a figure of its own and is Frenkel's curve here.
fn kinetics() -> Result<CurvesFigure, Box<dyn Error>> {
    let mut curves = Vec::new();
    let shown = Kinetics::ALL.into_iter().filter(|kinetics| *kinetics != Kinetics::RegimeMap);
    for (place, kinetics) in shown.enumerate() {
        let (x, y) = curve(kinetics, &SINTERING, MERGED)?;
        let name = kinetics.name().to_owned();
        curves.push(MarkedCurve { name, role: Role::Series(place), x, y, mark: None });
    }
    Ok(over_time(curves))
}

fn over_time(curves: Vec<MarkedCurve>) -> CurvesFigure {
    CurvesFigure {
        x_name: "time t (s)".to_owned(),
        y_name: "contact ratio a/R".to_owned(),
        mark_name: "knee".to_owned(),
        curves,
        ..CurvesFigure::default()
    }
}

fn curve(
    kinetics: Kinetics,
    sintering: &Sintering,
    phi: f64,
) -> Result<(Vec<f64>, Vec<f64>), Box<dyn Error>> {
    let scene = PairSpec::new(POWDER, phi).build()?;
    // Denser at first, where zipping is steep.
    let times: Vec<f64> = (0..=240).map(|k| END_S * (f64::from(k) / 240.0).powi(3)).collect();
    let curve = simulate(&scene, kinetics, sintering, &SolverSettings::default(), &times)?;
    Ok((times, curve.contact_ratio))
}
