//! Observables of a plan file: the measured table, its noise, and where the simulated values are.

use std::path::{Component, Path};

use campaign::{ANSWER, Format, Interpolation, ResultSpec};
use smc_calib::{DistanceScale, FixedSigma, Noise};

use super::types::ObservablePlan;
use crate::error::{InputError, Mistake};
use crate::input::data_table::DataTable;
use crate::input::text_file;
use crate::input::toml_fields::{At, Fields};

/// Reads an observable of a command, or of a worker; `folder` is that of the plan.
pub(super) fn observable(
    folder: &Path,
    name: &str,
    fields: &Fields<'_>,
    worker: bool,
) -> Result<ObservablePlan, InputError> {
    let table_field = fields
        .text("table")?
        .ok_or_else(|| fields.missing("table").expected("the file of the measurements"))?;
    let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
    let mut observable = ObservablePlan {
        name: name.to_owned(),
        table: table_field.value.to_owned(),
        table_read: None,
        control_column: owned("control")?,
        value_column: owned("value")?.unwrap_or_else(|| name.to_owned()),
        unit: owned("unit")?.unwrap_or_default(),
        control_unit: owned("control_unit")?.unwrap_or_default(),
        window: None,
        control: Vec::new(),
        values: Vec::new(),
        sigma: None,
        lines: Vec::new(),
        noise: Noise::default(),
        result: None,
    };
    let sigma_column = owned("sigma")?;
    observable.window = window(fields)?;
    let noise_table = fields.table("noise")?;
    let result_table = fields.table("result")?;
    fields.finish()?;

    let path = folder.join(table_field.value);
    let (name, text) = (path.display().to_string(), text_file::read(&path));
    let text = text.map_err(|error| error.named_in(fields, "table", table_field.line))?;
    let table = DataTable::parse(&name, &text, "time_s,force_n\n0.5,4.98")?;
    measurements(&mut observable, fields, &table, sigma_column.as_deref())?;
    let Some(noise_table) = noise_table else {
        return Err(fields
            .missing("noise")
            .expected("how the measurements scatter")
            .help("noise = { kind = \"inferred\", nu0 = 4, s0 = ABOUT }, ABOUT in the unit of the values")
            .help("or noise = { kind = \"fixed\", sigma = KNOWN }, or { kind = \"fixed-table\" } with a sigma column"));
    };
    observable.noise = observable.scaled(noise(&noise_table)?);
    let per_point = Noise::Fixed { sigma: FixedSigma::PerPoint };
    if observable.noise == per_point && observable.sigma.is_none() {
        return Err(fields
            .missing("sigma")
            .expected("the column of the standard deviations, which noise fixed-table uses"));
    }
    observable.result = Some(match result_table {
        Some(table) => result(&table, &observable, worker)?,
        None if worker => answer(&observable),
        None => {
            return Err(fields
                .missing("result")
                .expected("where a run leaves the simulated values")
                .help("result = { file = \"out.csv\", format = \"csv\", control = \"t\", value = \"f\" }"));
        }
    });
    checked(&observable)?;
    Ok(observable)
}

/// Fills in the measurements within the window.
fn measurements(
    observable: &mut ObservablePlan,
    fields: &Fields<'_>,
    table: &DataTable<'_>,
    sigma_column: Option<&str>,
) -> Result<(), InputError> {
    let values = table.column(&observable.value_column)?;
    let sigma = sigma_column.map(|column| table.column(column)).transpose()?;
    if let (Some(column), Some(sigma)) = (sigma_column, &sigma)
        && let Some(row) = sigma.iter().position(|sigma| *sigma <= 0.0)
    {
        return Err(table
            .mistake_in(row, column, Mistake::OutOfRange)
            .expected("a standard deviation > 0"));
    }
    let control = match &observable.control_column {
        Some(column) => table.column(column)?,
        None => (0..values.len()).map(|row| row as f64).collect(),
    };
    if let Some(column) = &observable.control_column
        && let Some(row) = (1..control.len()).find(|&row| control[row] < control[row - 1])
    {
        return Err(table
            .mistake_in(row, column, Mistake::Unsorted)
            .found(format_args!("{} after {}", control[row], control[row - 1]))
            .expected("values that do not go back")
            .help(
                "sort the rows; a loading that turns back is two observables, or one over time",
            ));
    }
    let window = observable.window;
    if window.is_some() && observable.control_column.is_none() {
        return Err(fields
            .table_error(Mistake::Conflict)
            .found("a window without a control column")
            .help("name the column with control = \"...\", or leave window out"));
    }
    let within = |x: f64| window.is_none_or(|[from, to]| from <= x && x <= to);
    let keep: Vec<usize> = (0..values.len()).filter(|&row| within(control[row])).collect();
    if keep.is_empty() {
        let span = format!("{} to {}", control[0], control[control.len() - 1]);
        return Err(fields
            .table_error(Mistake::EmptyWindow)
            .found(format_args!("no row of {} in the window", table.name))
            .expected(format_args!("a window that overlaps {span}")));
    }
    let kept = |column: &[f64]| keep.iter().map(|&row| column[row]).collect::<Vec<_>>();
    observable.control = kept(&control);
    observable.values = kept(&values);
    observable.sigma = sigma.as_deref().map(kept);
    observable.lines = keep.iter().map(|&row| table.line_of(row)).collect();
    Ok(())
}

/// A window of the control variable, if there is one.
pub(super) fn window(fields: &Fields<'_>) -> Result<Option<[f64; 2]>, InputError> {
    match fields.pair("window")? {
        Some(At { value: [from, to], line }) if from > to => Err(fields
            .error("window", line, Mistake::Bounds)
            .found(format_args!("[{from}, {to}]"))
            .expected("[from, to] with from <= to")),
        window => Ok(window.map(|at| at.value)),
    }
}

/// A noise model.
pub(super) fn noise(fields: &Fields<'_>) -> Result<Noise, InputError> {
    #[derive(Clone, Copy)]
    enum Kind {
        Inferred,
        Correlated,
        Robust,
        Fixed,
        Relative,
        Table,
        EssTarget,
    }
    let kind = fields
        .choice(
            "kind",
            &[
                ("inferred", Kind::Inferred),
                ("correlated", Kind::Correlated),
                ("robust", Kind::Robust),
                ("fixed", Kind::Fixed),
                ("fixed-relative", Kind::Relative),
                ("fixed-table", Kind::Table),
                ("ess-target", Kind::EssTarget),
            ],
        )?
        .ok_or_else(|| {
            fields
                .missing("kind")
                .expected("one of inferred, correlated, robust, fixed, fixed-relative, fixed-table")
        })?
        .value;
    let needed = |key: &'static str, what: &str| {
        fields
            .positive(key, what)?
            .map(|at| at.value)
            .ok_or_else(|| fields.missing(key).expected(format_args!("a number > 0 [{what}]")))
    };
    let nu0 = || Ok::<_, InputError>(fields.positive("nu0", "1")?.map_or(4.0, |at| at.value));
    let noise = match kind {
        Kind::Inferred => Noise::Inferred { nu0: nu0()?, s0: needed("s0", "unit of the values")? },
        Kind::Robust => Noise::Robust { nu0: nu0()?, s0: needed("s0", "unit of the values")? },
        Kind::Correlated => {
            let scales = [("log", DistanceScale::Log), ("linear", DistanceScale::Linear)];
            Noise::Correlated {
                nu0: nu0()?,
                s0: needed("s0", "unit of the values")?,
                scale: fields.choice("scale", &scales)?.map(|at| at.value),
                nodes: nodes(fields)?,
            }
        }
        Kind::Fixed => {
            Noise::Fixed { sigma: FixedSigma::Absolute(needed("sigma", "unit of the values")?) }
        }
        Kind::Relative => Noise::Fixed { sigma: FixedSigma::Relative(needed("share", "1")?) },
        Kind::Table => Noise::Fixed { sigma: FixedSigma::PerPoint },
        Kind::EssTarget => Noise::EssTarget { share: needed("share", "1")? },
    };
    fields.finish()?;
    Ok(noise)
}

/// Quadrature nodes over correlation length and white share, if they are given.
fn nodes(fields: &Fields<'_>) -> Result<Option<[usize; 2]>, InputError> {
    let Some(At { value, line }) = fields.pair("nodes")? else { return Ok(None) };
    if value.iter().all(|n| (1.0..=64.0).contains(n) && n.fract() == 0.0) {
        return Ok(Some(value.map(|n| n as usize)));
    }
    Err(fields
        .error("nodes", line, Mistake::OutOfRange)
        .found(format_args!("[{}, {}]", value[0], value[1]))
        .expected("[LENGTHS, SHARES], each a whole number of 1 to 64"))
}

/// The answer of a worker, with columns that are called as those of the measurements.
fn answer(observable: &ObservablePlan) -> ResultSpec {
    let control = observable.control_column.clone();
    ResultSpec {
        file: ANSWER.to_owned(),
        format: Format::Json,
        interpolate: between(control.is_some()),
        control,
        value: observable.value_column.clone(),
    }
}

/// Whether values are interpolated where the plan does not say.
fn between(has_control: bool) -> Interpolation {
    if has_control { Interpolation::Linear } else { Interpolation::Refuse }
}

fn result(
    fields: &Fields<'_>,
    observable: &ObservablePlan,
    worker: bool,
) -> Result<ResultSpec, InputError> {
    let has_control = observable.control_column.is_some();
    let file = fields.text("file")?;
    let answered = file.is_none() && worker;
    let (file, format) = match file {
        None if worker => (ANSWER.to_owned(), Format::Json),
        file => result_file(fields, file)?,
    };
    let default = answered.then(|| answer(observable));
    let owned = |at: Option<At<&str>>| at.map(|at| at.value.to_owned());
    let value = owned(fields.text("value")?)
        .or(default.as_ref().map(|answer| answer.value.clone()))
        .ok_or_else(|| fields.missing("value").expected("the column of the simulated values"))?;
    let control = fields.text("control")?;
    let interpolate = fields.choice(
        "interpolate",
        &[("linear", Interpolation::Linear), ("refuse", Interpolation::Refuse)],
    )?;
    fields.finish()?;
    if let (false, Some(at)) = (has_control, &control) {
        return Err(fields
            .error("control", at.line, Mistake::Conflict)
            .found("a control column of the result, but none of the measurements")
            .help("name the measurements' column with control beside table"));
    }
    let control = owned(control).or(default.and_then(|answer| answer.control));
    if has_control && control.is_none() {
        return Err(fields.missing("control").expected(
            "the result's column of the control variable, as the measurements have one",
        ));
    }
    if let (false, Some(At { value: Interpolation::Linear, line })) = (has_control, interpolate) {
        return Err(fields
            .error("interpolate", line, Mistake::Conflict)
            .found("interpolation without a control variable"));
    }
    let interpolate = interpolate.map_or(between(has_control), |at| at.value);
    Ok(ResultSpec { file, format, control, value, interpolate })
}

/// The file of a result, and its format.
fn result_file(
    fields: &Fields<'_>,
    file: Option<At<&str>>,
) -> Result<(String, Format), InputError> {
    let file =
        file.ok_or_else(|| fields.missing("file").expected("a file in the folder of the run"))?;
    let relative = Path::new(file.value);
    if relative.is_absolute() || relative.components().any(|part| part == Component::ParentDir) {
        return Err(fields
            .error("file", file.line, Mistake::OutOfRange)
            .found(format_args!("\"{}\"", file.value))
            .expected("a file in the folder of the run")
            .help("every run has a folder of its own; let the command write there"));
    }
    let format = fields.choice(
        "format",
        &[("csv", Format::Csv), ("whitespace", Format::Whitespace), ("json", Format::Json)],
    )?;
    let format = match format {
        Some(at) => at.value,
        None => match relative.extension().and_then(|extension| extension.to_str()) {
            Some("csv") => Format::Csv,
            Some("json") => Format::Json,
            Some("txt" | "dat") => Format::Whitespace,
            _ => {
                return Err(fields.missing("format").expected(
                    "\"csv\", \"whitespace\" or \"json\", which the file's name does not say",
                ));
            }
        },
    };
    Ok((file.value.to_owned(), format))
}

/// The observations and the noise model go together.
pub(super) fn checked(observable: &ObservablePlan) -> Result<(), InputError> {
    let observations = observable.observations()?;
    smc_calib::Likelihood::new(&observable.noise, &observations)
        .map(drop)
        .map_err(|error| InputError::new(&observable.table, Mistake::OutOfRange).found(error))
}
