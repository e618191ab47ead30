//! Everything that a run writes beside its record: tables, samples and figures, one set for all runs.

mod details;
mod drawing;
mod noise;
mod notation;
mod of_calibration;
mod pictures;
mod points;
mod population;
mod samples;
pub(crate) mod simulated;
mod summary;
mod tables;

use std::fmt::Write as _;
use std::path::Path;

use figures::Width;
use smc_calib::Posterior;

use crate::error::{Failure, RunError};
use crate::input::sample_table;
use crate::input::text_file::{self, folder_of};
use crate::output::checksums;
use crate::output::inputs::Inputs;
use crate::output::page;
use crate::output::{WriteFile, pretty};
use crate::record::{self, FILE_NAME, Record};
use crate::watch::Watch;

pub use crate::input::data_table::quoted;
pub use details::{details, understood};
pub(crate) use drawing::draw_watched;
pub use drawing::{NamedFigures, draw_all};
pub(crate) use noise::length_unit;
pub use notation::TimeScale;
pub(crate) use notation::symbol;
pub use pictures::{fit, pictures};
pub use points::PointColumns;
pub use population::csv as population_csv;
pub(crate) use samples::DRAWS;
pub use samples::{
    DrawColumns, SampleColumns, parse_draws, parse_samples, read_draws, read_samples, read_sigma,
};
pub use simulated::read_simulated;
pub use summary::{in_folder, json, text};
pub(crate) use tables::{aligned, markdown_table};
pub use tables::{csv, markdown};

/// The text of a record, which reads back as what it was.
fn record_text(record: &Record) -> Result<String, RunError> {
    let text = pretty(record)?;
    match record::parse(FILE_NAME, &text) {
        Ok(back) if back == *record => Ok(text),
        Ok(_) => Err(RunError::new("posterior.json does not read back as it was written")),
        Err(error) => Err(RunError::new(format_args!(
            "the posterior holds a number that JSON cannot: {error}"
        ))),
    }
}

/// The report of a run that was saved, made again of its files: also for a run of a version that wrote none.
///
/// # Errors
///
/// [`Failure::Input`] for files that are missing or damaged, and for what is no calibration.
pub fn again(path: &Path) -> Result<String, Failure> {
    let record = record::read(path)?;
    let file = record::locate(path);
    let folder = folder_of(&file);
    let points = PointColumns::read(&record, folder)?;
    let unwritten = |_: &str, _: &[u8]| Ok(());
    let figures = pictures(&record, &points, TimeScale::ByData);
    let drawn = draw_all(&figures, Width::Column, &unwritten)?;
    let inputs = Inputs::read(folder)?;
    let sums = folder.join(checksums::FILE_NAME);
    let sums = if sums.is_file() { text_file::read(&sums)? } else { String::new() };
    Ok(of_calibration::page(&record, &drawn, inputs.as_ref(), &sums).html()?)
}

/// Writes everything of a finished run.
pub(crate) fn write_all(
    record: &Record,
    posterior: &Posterior,
    inputs: Option<&Inputs>,
    write: &WriteFile<'_>,
    watch: &dyn Watch,
) -> Result<(), RunError> {
    let figures = pictures(record, &PointColumns::of(posterior), TimeScale::ByData);
    watch.begin(figures.len() as u64 + 1, 0, "tables and figures");
    let tables = || {
        let written = write_tables(record, posterior, write);
        watch.advance();
        written
    };
    let (tables, drawn) =
        rayon::join(tables, || draw_watched(&figures, Width::Column, write, watch));
    let written = tables.and_then(|sums| {
        inputs.map_or(Ok(()), |inputs| inputs.write(write))?;
        write(
            page::FILE_NAME,
            of_calibration::page(record, &drawn?, inputs, &sums).html()?.as_bytes(),
        )
    });
    watch.end();
    written
}

/// Writes tables, record and samples; gives the sums of those that are read again.
fn write_tables(
    record: &Record,
    posterior: &Posterior,
    write: &WriteFile<'_>,
) -> Result<String, RunError> {
    write("table.md", markdown(record).as_bytes())?;
    write("table.csv", csv(record).as_bytes())?;
    write("fit.csv", fit_csv(record).as_bytes())?;
    let read_again = [
        (FILE_NAME, record_text(record)?),
        ("samples.csv", samples::samples_csv(posterior)),
        (DRAWS, samples::draws_csv(record, posterior)),
    ];
    let sums = checksums::write_all(&read_again, write)?;
    if record.plan.commands().next().is_some() {
        let sets = posterior.samples.iter().map(|sample| sample.theta.as_slice());
        let table = sample_table::write(&record.plan.name, &record.plan.parameter_names(), sets);
        write("samples-grainlearning.txt", table.as_bytes())?;
    }
    Ok(sums)
}

/// Measured and predicted values, row by row.
fn fit_csv(record: &Record) -> String {
    let mut text = String::from(
        "observable,control,measured,map,mean,curve90_lower,curve90_upper,noisy90_lower,noisy90_upper\n",
    );
    for (plan, found) in record.observables() {
        for band in &found.predictive {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{}",
                quoted(&found.label),
                plan.control[band.index],
                plan.values[band.index],
                found.map[band.index],
                band.mean,
                band.curve90[0],
                band.curve90[1],
                band.noisy90[0],
                band.noisy90[1],
            );
        }
    }
    text
}
