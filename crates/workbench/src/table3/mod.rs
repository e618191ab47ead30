//! The paper's Table 3 regenerated, with everything needed to judge it.
//!
//! PS, PA12 and PEEK 450PF are calibrated as by `calibrate --material`, and from their posteriors follow
//!
//! - the table, in the printed form and in SI, with the position of the paper's values (`record`),
//! - the errors of the paper's parameters, ours, and the traditional one-parameter models (`record`),
//! - the paper's statements of section 4 under both (`statements`),
//! - how Table 3 must be read, beside the readings that fail (`readings`),
//! - a prediction of a pair that was not fitted (`unfitted`),
//! - Figures 2, 4, 5 and 6 (`figures`).
//!
//! The same seed gives the same bytes; only `README.md` also names the revision of the source.

mod calibrated;
mod figures;
mod page;
mod readings;
mod record;
pub mod render;
mod statements;
mod unfitted;

use dem_core::Kinetics;

use crate::error::Failure;
use crate::input::material::Material;
use crate::output::page::FILE_NAME;
use crate::output::{Published, RunFolder, pretty};
use crate::report::{NamedFigures, draw_all};
use crate::watch::{Watch, Within};
use ::figures::Width;
pub use calibrated::Calibrated;
pub use record::Report;

/// The record of a regenerated table.
pub const RECORD: &str = crate::output::kinds::TABLE3;

/// The table, and the figures that belong to it.
pub struct Table3 {
    /// Contents of `table3.json`.
    pub report: Report,
    figures: NamedFigures,
}

impl Table3 {
    /// Calibrates the materials and makes the table of them.
    pub fn regenerate(samples: usize, seed: u64, watch: &dyn Watch) -> Result<Self, Failure> {
        watch.begin(Material::ALL.len() as u64 + 2, 0, "calibrations");
        let one = |material: Material, kinetics: Kinetics| {
            let within = Within::new(watch, format!("{}, {}", material.title(), kinetics.name()));
            Calibrated::new(material, kinetics, samples, seed, &within).inspect(|_| watch.advance())
        };
        let calibrated: Vec<Calibrated> = Material::ALL
            .into_iter()
            .map(|material| one(material, Kinetics::ThreeStage))
            .collect::<Result<_, _>>()?;
        let map = one(Material::Peek, Kinetics::RegimeMap)?;
        let (unfitted, predicted) = unfitted::predict(
            &calibrated,
            &Within::new(watch, "a pair that was not fitted".to_owned()),
        )?;
        watch.advance();
        let report = Report::new(samples, seed, &calibrated, unfitted)?;
        let mut figures: NamedFigures =
            vec![("figure2".to_owned(), Box::new(figures::regime_map(&map)?))];
        for one in &calibrated {
            if let Some((name, figure)) = figures::sintering_curve(one) {
                figures.push((name.to_owned(), Box::new(figure)));
            }
        }
        figures.push(("pa12-r30".to_owned(), Box::new(predicted)));
        watch.end();
        Ok(Self { report, figures })
    }

    /// Writes the folder of the table. `revision` is that of the source of this program.
    ///
    /// # Errors
    ///
    /// [`Failure::Run`] for a file that cannot be written; nothing has been published then.
    pub fn publish(&self, folder: &RunFolder, revision: &str) -> Result<Published, Failure> {
        let report = &self.report;
        let staging = folder.stage()?;
        let write = |name: &str, bytes: &[u8]| staging.write(folder.path(), name, bytes);
        write(RECORD, pretty(report)?.as_bytes())?;
        write("table3.md", render::table_markdown(report).as_bytes())?;
        write("table3.csv", render::table_csv(report).as_bytes())?;
        write("table3.tex", render::table_latex(report).as_bytes())?;
        write("document.tex", render::DOCUMENT.as_bytes())?;
        write("report.md", render::report_markdown(report).as_bytes())?;
        write("README.md", render::readme(&report.plan, revision).as_bytes())?;
        let drawn = draw_all(&self.figures, Width::Column, &write)?;
        write(FILE_NAME, page::page(report, &drawn).html()?.as_bytes())?;
        Ok(staging.publish()?)
    }
}
