//! `calibrate table3`: the paper's Table 3 regenerated, with everything needed to judge it.
//!
//! PS, PA12 and PEEK 450PF are calibrated as by `calibrate --material`, and from their posteriors follow
//!
//! - the table, in the printed form and in SI, with the position of the paper's values ([`report`]),
//! - the errors of the paper's parameters, ours, and the traditional one-parameter models ([`report`]),
//! - the paper's statements of section 4 under both ([`statements`]),
//! - how Table 3 must be read, beside the readings that fail ([`readings`]),
//! - a prediction of a pair that was not fitted ([`unfitted`]),
//! - Figures 2, 4, 5 and 6 ([`figures`]).
//!
//! The same seed gives the same bytes; only `README.md` also names the revision of the source.

pub mod figures;
pub mod readings;
pub mod render;
pub mod report;
pub mod statements;
pub mod unfitted;

use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use crate::args::{RunArgs, Table3Args};
use crate::calibration::Calibration;
use crate::error::Failure;
use crate::material::Material;
use crate::output::RunFolder;
use crate::plan::Planned;
use crate::run::{NamedFigures, announce, draw_all, pool, pretty};
use ::figures::Width;
use report::Report;

/// The record of a regenerated table.
pub const RECORD: &str = "table3.json";

/// A material calibrated with the paper's kinetics.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// Which one.
    pub material: Material,
    /// What was asked.
    pub planned: Planned,
    /// What was found.
    pub calibration: Calibration,
}

impl Calibrated {
    /// Calibrates a material with its own priors, `samples` simulations and a seed.
    ///
    /// # Errors
    ///
    /// As [`Calibration::run`].
    pub fn new(
        material: Material,
        kinetics: dem_core::Kinetics,
        samples: usize,
        seed: u64,
    ) -> Result<Self, Failure> {
        let args = RunArgs {
            material: Some(material),
            kinetics,
            samples,
            seed,
            quiet: true,
            ..RunArgs::default()
        };
        let planned = Planned::from_args(&args)?;
        let calibration = Calibration::run(&planned, &mut (), &|| true)?;
        Ok(Self { material, planned, calibration })
    }
}

/// Regenerates the table.
///
/// # Errors
///
/// [`Failure`] with the reason; nothing has been written then.
pub fn run(args: &Table3Args) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, RECORD)?;
    let pool = pool(args.threads)?;
    let (report, pictures) = pool.install(|| regenerate(args.samples, args.seed))?;
    let staging = folder.stage()?;
    let write = |name: &str, bytes: &[u8]| staging.write(&args.out, name, bytes);
    write(RECORD, pretty(&report)?.as_bytes())?;
    write("table3.md", render::table_markdown(&report).as_bytes())?;
    write("table3.csv", render::table_csv(&report).as_bytes())?;
    write("table3.tex", render::table_latex(&report).as_bytes())?;
    write("document.tex", render::DOCUMENT.as_bytes())?;
    write("report.md", render::report_markdown(&report).as_bytes())?;
    write("README.md", render::readme(args, &revision()).as_bytes())?;
    pool.install(|| draw_all(&pictures, Width::Column, &write))?;
    let published = staging.publish()?;
    announce(&published, &args.out, args.quiet);
    for material in &report.materials {
        for line in &material.advice {
            eprintln!("warning: {}: {line}", material.name);
        }
    }
    if !args.quiet {
        let mut out = std::io::stdout().lock();
        write!(out, "{}", render::terminal(&report))?;
        writeln!(
            out,
            "files: {}/ (table3.md, .csv, .json, .tex; report.md; figure2, 4, 5, 6)",
            args.out.display()
        )?;
    }
    Ok(())
}

/// The report and its figures.
///
/// # Errors
///
/// As [`Calibration::run`].
pub fn regenerate(samples: usize, seed: u64) -> Result<(Report, NamedFigures), Failure> {
    let three_stage = dem_core::Kinetics::ThreeStage;
    let calibrated: Vec<Calibrated> = Material::ALL
        .into_iter()
        .map(|material| Calibrated::new(material, three_stage, samples, seed))
        .collect::<Result<_, _>>()?;
    let map = Calibrated::new(Material::Peek, dem_core::Kinetics::RegimeMap, samples, seed)?;
    let (unfitted, predicted) = unfitted::predict(&calibrated)?;
    let report = Report::new(samples, seed, &calibrated, unfitted)?;
    let mut pictures: NamedFigures =
        vec![("figure2".to_owned(), Box::new(figures::regime_map(&map)?))];
    for one in &calibrated {
        let (name, figure) = figures::sintering_curve(one);
        pictures.push((name.to_owned(), Box::new(figure)));
    }
    pictures.push(("pa12-r30".to_owned(), Box::new(predicted)));
    Ok((report, pictures))
}

/// The commit of the source that this program was built from, as far as it can be told: the last one that
/// touched it, and whether it was changed since.
fn revision() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let git = |arguments: &[&str]| {
        let paths = ["--", "crates", "priors", "experiments", "Cargo.toml", "Cargo.lock"];
        let output = Command::new("git")
            .arg("-C")
            .arg(&root)
            .args(arguments)
            .args(paths)
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match git(&["log", "-1", "--format=%h of %cs"]) {
        Some(commit) if !commit.is_empty() => {
            let clean = git(&["status", "--porcelain"]).is_some_and(|changes| changes.is_empty());
            if clean { commit } else { format!("{commit}, with changes that were not committed") }
        }
        _ => format!("version {}", env!("CARGO_PKG_VERSION")),
    }
}
