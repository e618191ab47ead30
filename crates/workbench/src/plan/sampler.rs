//! Settings of the sampler in a plan file.

use std::path::Path;

use smc_calib::{Parameter, Settings};

use super::types::{Design, SAMPLES};
use crate::error::{InputError, Mistake};
use crate::input::sample_table::SampleTable;
use crate::input::toml_fields::{At, Fields};

/// Number of parameter sets of a plan with commands, unless it says another.
pub(super) const COMMAND_SAMPLES: usize = 300;
/// The same of a plan with built-in simulators alone.
const BUILTIN_SAMPLES: usize = 16_384;

/// What `[sampler]` says.
pub(super) struct Sampling<'d> {
    pub(super) settings: Settings,
    pub(super) design: Option<Design>,
    /// The earlier result that `proposal` names.
    pub(super) proposal: Option<At<&'d str>>,
}

/// Reads `[sampler]`; `folder` is that of the plan.
pub(super) fn sampler<'d>(
    folder: &Path,
    fields: Option<&Fields<'d>>,
    commands: bool,
    parameters: &[Parameter],
) -> Result<Sampling<'d>, InputError> {
    let default_samples = if commands { COMMAND_SAMPLES } else { BUILTIN_SAMPLES };
    let Some(fields) = fields else {
        let settings = Settings::for_budget(default_samples);
        return Ok(Sampling { settings, design: None, proposal: None });
    };
    let (design_field, proposal) = (fields.text("design")?, fields.text("proposal")?);
    let least = design_field.as_ref().map_or(*SAMPLES.start() as u64, |_| 1);
    let samples = fields.whole("samples", least, *SAMPLES.end() as u64)?;
    let mut settings =
        Settings::for_budget(samples.as_ref().map_or(default_samples, |at| at.value as usize));
    let most_overlap = settings.samples as u64 / 4;
    let counts: [(_, &mut usize, _, _); 8] = [
        ("iterations", &mut settings.iterations, 1, 1000),
        ("batch", &mut settings.batch, 0, 10_000),
        ("overlap", &mut settings.overlap, 0, most_overlap),
        ("map_simulations", &mut settings.map_simulations, 0, 1 << 27),
        ("replicates", &mut settings.replicates, 1, 256),
        ("max_components", &mut settings.max_components, 1, 64),
        ("patches", &mut settings.patches, 0, 64),
        ("draws", &mut settings.draws, 1, 1 << 27),
    ];
    for (name, setting, least, most) in counts {
        if let Some(at) = fields.whole(name, least, most)? {
            *setting = at.value as usize;
        }
    }
    shares(fields, &mut settings)?;
    settings.seed = fields.whole("seed", 0, u64::MAX)?.map_or(settings.seed, |at| at.value);
    settings.ess_target = match fields.number("ess")? {
        Some(At { value, line }) if value < 1.0 => {
            return Err(fields
                .error("ess", line, Mistake::OutOfRange)
                .found(value)
                .expected("a number of at least 1"));
        }
        ess => ess.map(|at| at.value),
    };
    settings.mean_se_target = fields.positive("mean_se", "1")?.map(|at| at.value);
    if let Some(at) = fields.choice("surrogate", &[("on", true), ("off", false)])? {
        settings.surrogate = at.value;
    }
    fields.finish()?;
    let Some(design_field) = design_field else {
        return Ok(Sampling { settings, design: None, proposal });
    };
    let table = SampleTable::read(&folder.join(design_field.value))
        .map_err(|error| error.named_in(fields, "design", design_field.line))?;
    let sets = design(&table, parameters)?;
    if let Some(at) = samples
        && at.value != sets.len() as u64
    {
        return Err(fields
            .error("samples", at.line, Mistake::Conflict)
            .found(format_args!("{} samples beside a design of {}", at.value, sets.len()))
            .help("leave samples out: the design says how many there are"));
    }
    settings.samples = sets.len();
    let design = Some(Design { file: design_field.value.to_owned(), sets });
    Ok(Sampling { settings, design, proposal })
}

/// Reads the settings that are no whole numbers.
fn shares(fields: &Fields<'_>, settings: &mut Settings) -> Result<(), InputError> {
    let numbers: [(_, &mut f64, _, _); 6] = [
        ("max_failed_share", &mut settings.max_failed_share, 0.0, 1.0),
        ("final_share", &mut settings.final_share, 0.0, 1.0),
        ("tempering_share", &mut settings.tempering_share, 1e-6, 1.0),
        ("widening", &mut settings.widening, 1e-3, 1e3),
        ("degrees_of_freedom", &mut settings.degrees_of_freedom, 1.0, 1e6),
        ("defensive_share", &mut settings.defensive_share, 1e-6, 1.0),
    ];
    for (name, setting, least, most) in numbers {
        if let Some(At { value, line }) = fields.number(name)? {
            if !(least..=most).contains(&value) {
                return Err(fields
                    .error(name, line, Mistake::OutOfRange)
                    .found(value)
                    .expected(format_args!("a number from {least} to {most}")));
            }
            *setting = value;
        }
    }
    Ok(())
}

/// The given parameter sets, which the priors must allow.
fn design(table: &SampleTable, parameters: &[Parameter]) -> Result<Vec<Vec<f64>>, InputError> {
    let names: Vec<String> = parameters.iter().map(|parameter| parameter.name.clone()).collect();
    let mut sets = table.in_order(&names)?;
    if sets.len() < 2 {
        return Err(InputError::new(&table.name, Mistake::Empty)
            .found("one parameter set")
            .expected("at least two, or there is nothing to weight"));
    }
    for (row, set) in sets.iter_mut().enumerate() {
        for (value, parameter) in set.iter_mut().zip(parameters) {
            let (lower, upper) = parameter.prior.support();
            *value = onto_bound(*value, lower, upper);
            if !(lower..=upper).contains(&*value) {
                return Err(InputError::new(&table.name, Mistake::OutOfRange)
                    .at_line(table.line_of(row))
                    .in_column(&parameter.name)
                    .found(*value)
                    .expected(format_args!("a value the prior allows, {lower} to {upper}"))
                    .help("widen the prior, or leave the row out"));
            }
        }
    }
    Ok(sets)
}

/// A value that lies beyond a bound by no more than the rounding of whoever made the table, moved onto the bound.
///
/// # Formula
///
/// 1e-12 times the larger of the bounds' distance, where it is finite, and the bound.
pub(super) fn onto_bound(value: f64, lower: f64, upper: f64) -> f64 {
    let width = if (upper - lower).is_finite() { upper - lower } else { 0.0 };
    let near = |bound: f64| (value - bound).abs() <= 1e-12 * width.max(bound.abs());
    if value < lower && near(lower) {
        lower
    } else if value > upper && near(upper) {
        upper
    } else {
        value
    }
}
