//! A file of priors: what is assumed of the parameters before the experiment.
//!
//! TOML with one table per parameter:
//!
//! | table | | parameter | unit |
//! |---|---|---|---|
//! | `[tau_s]` | required | sintering time | s |
//! | `[c1]` | required by kinetics with stage 2 | fluidity C1 | 1/(Pa s) |
//! | `[delta_c]` | required by kinetics with stage 2 | cut-off distance of the adhesive traction | m |
//! | `[phi]` | optional | final contact ratio, calibrated instead of taken from the experiment | 1 |
//!
//! and in each the field `distribution` with what belongs to it, all required:
//!
//! | `distribution` | fields |
//! |---|---|
//! | `"log-uniform"` | `lower`, `upper` |
//! | `"uniform"` | `lower`, `upper` |
//! | `"log-normal"` | `median`, `sd_log10` (decades) |
//! | `"normal"` | `mean`, `sd`; only where mean > 8 sd, as all parameters are positive |
//! | `"truncated-normal"` | `mean`, `sd`, `lower`, `upper` |
//!
//! `title` and `source` at the top are optional text. Other fields are refused.

use std::path::Path;

use dem_core::Kinetics;
use smc_calib::{Parameter, Prior, PriorError, PriorSpec};

use crate::error::{InputError, Mistake, nearest};
use crate::experiment::is_toml;
use crate::material::Material;
use crate::parameter::ParameterName;
use crate::text_file;
use crate::toml_fields::{At, Document, Fields};

/// Checked priors.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorFile {
    /// The file, or `built-in`.
    pub file_name: String,
    /// A line for headings.
    pub title: Option<String>,
    /// Where the numbers come from.
    pub source: Option<String>,
    /// Prior of C1.
    pub c1: Option<Prior>,
    /// Prior of tau_s.
    pub tau_s: Prior,
    /// Prior of delta_c.
    pub delta_c: Option<Prior>,
    /// Prior of phi, where it is to be calibrated.
    pub phi: Option<Prior>,
}

impl PriorFile {
    /// The default priors of a material, compiled in and read by the same code as a user's.
    ///
    /// # Errors
    ///
    /// None in practice: what is compiled in is held by a test.
    pub fn of_material(material: Material) -> Result<Self, InputError> {
        let text = match material {
            Material::Ps => include_str!("../../../priors/ps.toml"),
            Material::Pa12 => include_str!("../../../priors/pa12.toml"),
            Material::Peek => include_str!("../../../priors/peek.toml"),
        };
        Self::parse(&format!("built-in priors/{material}.toml"), text)
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line, field, value and remedy.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let text = text_file::read(path)?;
        if !is_toml(path) && path.extension().is_some() {
            return Err(InputError::new(name, Mistake::Syntax)
                .found("not a .toml file")
                .expected("priors in TOML")
                .help("see priors/ps.toml for how it looks"));
        }
        Self::parse(&name, &text)
    }

    /// Reads text; `name` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line, field, value and remedy.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let document = Document::parse(name, text)?;
        let fields = document.top();
        let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
        let title = owned("title")?;
        let source = owned("source")?;
        let read = |parameter: ParameterName| match fields.table(parameter.name())? {
            Some(table) => prior(parameter, &table).map(Some),
            None => Ok(None),
        };
        let [c1, tau_s, delta_c, phi] = [
            read(ParameterName::C1)?,
            read(ParameterName::TauS)?,
            read(ParameterName::DeltaC)?,
            read(ParameterName::Phi)?,
        ];
        fields.finish()?;
        let Some(tau_s) = tau_s else {
            return Err(missing(name, ParameterName::TauS));
        };
        Ok(Self { file_name: name.to_owned(), title, source, c1, tau_s, delta_c, phi })
    }

    /// The prior of a parameter, if the file gives one.
    #[must_use]
    pub fn get(&self, parameter: ParameterName) -> Option<&Prior> {
        match parameter {
            ParameterName::C1 => self.c1.as_ref(),
            ParameterName::TauS => Some(&self.tau_s),
            ParameterName::DeltaC => self.delta_c.as_ref(),
            ParameterName::Phi => self.phi.as_ref(),
        }
    }

    /// The parameters to calibrate under these kinetics, in the order c1, tau_s, delta_c, phi.
    ///
    /// # Errors
    ///
    /// [`InputError`] where the kinetics have a parameter that the file gives no prior for.
    pub fn parameters(
        &self,
        kinetics: Kinetics,
    ) -> Result<Vec<(ParameterName, Parameter)>, InputError> {
        let mut parameters = Vec::new();
        for parameter in ParameterName::ALL {
            let of_stage_2 = matches!(parameter, ParameterName::C1 | ParameterName::DeltaC);
            if of_stage_2 && !kinetics.uses_c1_delta_c() {
                continue;
            }
            match self.get(parameter) {
                Some(prior) => parameters.push((
                    parameter,
                    Parameter::new(parameter.name(), parameter.unit(), prior.clone()),
                )),
                None if parameter == ParameterName::Phi => {}
                None => {
                    return Err(missing(&self.file_name, parameter).help(format_args!(
                        "or choose kinetics without it: --kinetics frenkel or pokluda, not {kinetics}"
                    )));
                }
            }
        }
        Ok(parameters)
    }
}

fn missing(file: &str, parameter: ParameterName) -> InputError {
    let example = match parameter {
        ParameterName::C1 => "lower = 1e-8, upper = 1e-2",
        ParameterName::TauS => "lower = 0.5, upper = 50.0",
        ParameterName::DeltaC => "lower = 1e-8, upper = 3e-6",
        ParameterName::Phi => "lower = 1.0, upper = 1.35",
    };
    let name = parameter.name();
    InputError::new(file, Mistake::MissingField)
        .in_field(format_args!("[{name}]"))
        .found("missing")
        .expected(format_args!("a prior for {name} [{}]", parameter.unit()))
        .help(format_args!("add {name} = {{ distribution = \"log-uniform\", {example} }}"))
}

const DISTRIBUTIONS: [&str; 5] =
    ["log-uniform", "uniform", "log-normal", "normal", "truncated-normal"];

fn prior(parameter: ParameterName, fields: &Fields<'_>) -> Result<Prior, InputError> {
    let prior = any_prior(fields)?;
    check_support(parameter, fields, prior.spec())?;
    Ok(prior)
}

/// A prior of any parameter, from a table whose other fields have been asked for already.
pub(crate) fn any_prior(fields: &Fields<'_>) -> Result<Prior, InputError> {
    let Some(At { value: distribution, line }) = fields.text("distribution")? else {
        return Err(fields
            .missing("distribution")
            .expected(format_args!("one of {}", DISTRIBUTIONS.join(", ")))
            .help("add distribution = \"log-uniform\""));
    };
    let number = |key: &'static str| {
        fields.number(key)?.map(|at| at.value).ok_or_else(|| {
            fields.missing(key).expected(format_args!(
                "a number, as {distribution} is given by {}",
                match distribution {
                    "log-uniform" | "uniform" => "lower and upper",
                    "log-normal" => "median and sd_log10",
                    "normal" => "mean and sd",
                    _ => "mean, sd, lower and upper",
                }
            ))
        })
    };
    let spec = match distribution {
        "log-uniform" => PriorSpec::LogUniform { lower: number("lower")?, upper: number("upper")? },
        "uniform" => PriorSpec::Uniform { lower: number("lower")?, upper: number("upper")? },
        "log-normal" => {
            PriorSpec::LogNormal { median: number("median")?, sd_log10: number("sd_log10")? }
        }
        "normal" => PriorSpec::Normal { mean: number("mean")?, sd: number("sd")? },
        "truncated-normal" => PriorSpec::TruncatedNormal {
            mean: number("mean")?,
            sd: number("sd")?,
            lower: number("lower")?,
            upper: number("upper")?,
        },
        _ => {
            return Err(fields
                .error("distribution", line, Mistake::UnknownName)
                .found(format_args!("\"{distribution}\""))
                .expected(format_args!("one of {}", DISTRIBUTIONS.join(", ")))
                .help_if(
                    nearest(distribution, DISTRIBUTIONS)
                        .map(|near| format!("did you mean \"{near}\"?")),
                ));
        }
    };
    fields.finish()?;
    Prior::new(spec).map_err(|error| refused(fields, &error))
}

/// The line of a field that was read.
fn line(fields: &Fields<'_>, key: &'static str) -> Option<usize> {
    fields.number(key).ok().flatten().map(|at| at.line)
}

fn refused(fields: &Fields<'_>, error: &PriorError) -> InputError {
    let at = |key: &'static str, mistake| {
        let mut input = fields.table_error(mistake);
        input.field = None;
        input.line = line(fields, key).or(input.line);
        input.in_field(fields.path_of(key))
    };
    match error {
        PriorError::NotFinite { field, value } => {
            at(field, Mistake::NotFinite).found(value).expected("a finite number")
        }
        PriorError::NotPositive { field, value } => {
            let mistake = if *value < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
            at(field, mistake)
                .found(value)
                .expected("a number > 0")
                .help("a logarithmic prior has no zero; choose the smallest value that makes sense")
        }
        PriorError::Bounds { lower, upper } if lower < upper => at("upper", Mistake::OutOfRange)
            .found(format_args!("{lower:e} to {upper:e}"))
            .expected("bounds whose difference is a number"),
        PriorError::Bounds { lower, upper } => at("lower", Mistake::Bounds)
            .found(format_args!("lower = {lower}, upper = {upper}"))
            .expected("lower below upper")
            .help(if lower == upper { "widen the range" } else { "swap them" }),
        other => fields.table_error(Mistake::OutOfRange).found(other),
    }
}

/// All parameters are positive, and phi is a contact ratio.
pub(crate) fn check_support(
    parameter: ParameterName,
    fields: &Fields<'_>,
    spec: &PriorSpec,
) -> Result<(), InputError> {
    let name = parameter.name();
    let at = |key: &'static str, mistake| {
        let mut input = fields.table_error(mistake).in_field(fields.path_of(key));
        input.line = line(fields, key).or(input.line);
        input
    };
    let bounds = match *spec {
        PriorSpec::Uniform { lower, upper }
        | PriorSpec::LogUniform { lower, upper }
        | PriorSpec::TruncatedNormal { lower, upper, .. } => Some([lower, upper]),
        PriorSpec::Normal { mean, sd } => {
            if mean <= 8.0 * sd {
                return Err(at("mean", Mistake::Negative)
                    .found(format_args!("mean = {mean}, sd = {sd}"))
                    .expected(format_args!("mean > 8 sd, as {name} cannot be negative"))
                    .help(
                        "use log-normal (median, sd_log10), or truncated-normal with lower = 0",
                    ));
            }
            None
        }
        PriorSpec::LogNormal { .. } => None,
    };
    let Some([lower, upper]) = bounds else { return Ok(()) };
    if lower < 0.0 {
        return Err(at("lower", Mistake::Negative)
            .found(lower)
            .expected(format_args!("a number >= 0, as {name} cannot be negative")));
    }
    if parameter == ParameterName::Phi {
        for (key, bound) in [("lower", lower), ("upper", upper)] {
            if let Err((expected, help)) = crate::experiment::checked_phi(bound) {
                return Err(at(key, Mistake::OutOfRange)
                    .found(bound)
                    .expected(expected)
                    .help(help));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TAU: &str = "tau_s = { distribution = \"log-uniform\", lower = 0.5, upper = 50 }\n";

    #[test]
    fn default_priors_are_the_documented_ones() {
        let bounds = |lower, upper| PriorSpec::LogUniform { lower, upper };
        for (material, c1, tau_s) in [
            (Material::Ps, bounds(1e-6, 1e-1), bounds(1e-2, 1.0)),
            (Material::Pa12, bounds(1e-8, 1e-2), bounds(0.5, 50.0)),
            (Material::Peek, bounds(1e-9, 1e-3), bounds(3.0, 300.0)),
        ] {
            let priors = PriorFile::of_material(material).expect("built in");
            let parameters = priors.parameters(Kinetics::ThreeStage).expect("complete");
            let specs: Vec<_> =
                parameters.iter().map(|(_, parameter)| parameter.prior.spec().clone()).collect();
            assert_eq!(specs, [c1, tau_s, bounds(1e-8, 3e-6)]);
            let names: Vec<_> = parameters.iter().map(|(name, _)| name.name()).collect();
            assert_eq!(names, ["c1", "tau_s", "delta_c"]);
        }
    }

    #[test]
    fn kinetics_ask_only_for_the_priors_they_use() {
        let priors = PriorFile::parse("p.toml", TAU).expect("valid");
        assert_eq!(priors.parameters(Kinetics::Frenkel).expect("tau_s").len(), 1);
        let error = priors.parameters(Kinetics::ThreeStage).expect_err("no c1");
        assert_eq!(error.mistake, Mistake::MissingField);
        assert!(error.to_string().contains("[c1]"), "{error}");
        let with_phi =
            format!("{TAU}[phi]\ndistribution = \"uniform\"\nlower = 1.0\nupper = 1.35\n");
        let priors = PriorFile::parse("p.toml", &with_phi).expect("valid");
        let names: Vec<_> = priors
            .parameters(Kinetics::Pokluda)
            .expect("both")
            .iter()
            .map(|(name, _)| name.name())
            .collect();
        assert_eq!(names, ["tau_s", "phi"]);
    }

    #[test]
    fn every_distribution_is_read() {
        for (fields, spec) in [
            ("\"uniform\", lower = 1, upper = 2", PriorSpec::Uniform { lower: 1.0, upper: 2.0 }),
            ("\"normal\", mean = 9, sd = 1", PriorSpec::Normal { mean: 9.0, sd: 1.0 }),
            (
                "\"log-normal\", median = 3, sd_log10 = 0.5",
                PriorSpec::LogNormal { median: 3.0, sd_log10: 0.5 },
            ),
            (
                "\"truncated-normal\", mean = 1, sd = 2, lower = 0, upper = 9",
                PriorSpec::TruncatedNormal { mean: 1.0, sd: 2.0, lower: 0.0, upper: 9.0 },
            ),
        ] {
            let text =
                format!("[tau_s]\n{}\n", format!("distribution = {fields}").replace(", ", "\n"));
            let priors = PriorFile::parse("p.toml", &text).expect(fields);
            assert_eq!(priors.tau_s.spec(), &spec);
        }
    }

    #[test]
    fn each_mistake_names_its_line_and_field() {
        let tau = |fields: &str| format!("[tau_s]\n{fields}\n");
        for (text, kind, line, says) in [
            (String::new(), Mistake::MissingField, None, "tau_s = {"),
            (tau(""), Mistake::MissingField, Some(1), "tau_s.distribution"),
            (
                tau("distribution = \"loguniform\""),
                Mistake::UnknownName,
                Some(2),
                "mean \"log-uniform\"?",
            ),
            (
                tau("distribution = \"uniform\"\nlower = 1"),
                Mistake::MissingField,
                Some(1),
                "tau_s.upper",
            ),
            (
                tau("distribution = \"uniform\"\nlower = 2\nupper = 1"),
                Mistake::Bounds,
                Some(3),
                "swap",
            ),
            (
                tau("distribution = \"uniform\"\nlower = 2\nupper = 2"),
                Mistake::Bounds,
                Some(3),
                "widen",
            ),
            (
                tau("distribution = \"log-uniform\"\nlower = 0\nupper = 1"),
                Mistake::OutOfRange,
                Some(3),
                "tau_s.lower",
            ),
            (
                tau("distribution = \"uniform\"\nlower = -1\nupper = 1"),
                Mistake::Negative,
                Some(3),
                "tau_s.lower",
            ),
            (
                tau("distribution = \"normal\"\nmean = 1\nsd = 1"),
                Mistake::Negative,
                Some(3),
                "log-normal",
            ),
            (
                tau("distribution = \"normal\"\nmean = 1\nsd = 0"),
                Mistake::OutOfRange,
                Some(4),
                "tau_s.sd",
            ),
            (
                tau("distribution = \"uniform\"\nlower = 1\nupper = inf"),
                Mistake::NotFinite,
                Some(4),
                "tau_s.upper",
            ),
            (
                tau("distribution = \"uniform\"\nlower = 1\nuper = 3\nupper = 2"),
                Mistake::UnknownField,
                Some(4),
                "did you mean tau_s.upper?",
            ),
            (
                format!("{TAU}[tau_c]\ndistribution = \"uniform\"\n"),
                Mistake::UnknownField,
                Some(2),
                "did you mean tau_s?",
            ),
            (
                format!("{TAU}[phi]\ndistribution = \"uniform\"\nlower = 1\nupper = 5\n"),
                Mistake::OutOfRange,
                Some(5),
                "phi.upper",
            ),
            ("tau_s = 3\n".to_owned(), Mistake::WrongType, Some(1), "a table [tau_s]"),
        ] {
            let error = PriorFile::parse("p.toml", &text).expect_err(&text);
            assert_eq!((error.mistake, error.line), (kind, line), "{text}\n{error}");
            assert!(error.to_string().contains(says), "{text}\n{error}");
        }
    }

    proptest! {
        #[test]
        fn arbitrary_prior_files_never_panic(text in ".*") {
            let _ = PriorFile::parse("p.toml", &text);
        }

        #[test]
        fn any_numbers_are_a_prior_or_a_mistake(
            kind in proptest::sample::select(DISTRIBUTIONS.to_vec()),
            numbers in proptest::array::uniform7(any::<f64>()),
        ) {
            let [lower, upper, mean, sd, median, sd_log10, _] = numbers;
            let mut text = format!("[tau_s]\ndistribution = \"{kind}\"\n");
            let fields: &[(&str, f64)] = match kind {
                "log-uniform" | "uniform" => &[("lower", lower), ("upper", upper)],
                "log-normal" => &[("median", median), ("sd_log10", sd_log10)],
                "normal" => &[("mean", mean), ("sd", sd)],
                _ => &[("mean", mean), ("sd", sd), ("lower", lower), ("upper", upper)],
            };
            for (name, value) in fields {
                text.push_str(&format!("{name} = {value:e}\n"));
            }
            let _ = PriorFile::parse("p.toml", &text);
        }
    }
}
