//! Two calibrations in numbers.

use std::path::{Path, PathBuf};

use figures::{MarginalsFigure, MarginalsParameter};
use serde::Serialize;

use super::plans::{self, Difference};
use crate::error::{Failure, InputError};
use crate::input::files_read::noted;
use crate::input::text_file::folder_of;
use crate::output::checksums::hex;
use crate::output::inputs::Inputs;
use crate::output::on_one_line;
use crate::plan::{ObservablePlan, Plan, shell_word};
use crate::record::{self, Record};
use crate::report::{NamedFigures, read_draws, symbol};

/// Version of the layout of `diff.json`.
const SCHEMA_VERSION: u32 = 1;

/// The two runs, which decide the result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiffPlan {
    /// The runs, as they were named.
    pub runs: [PathBuf; 2],
    /// SHA-256 of the `posterior.json` of each.
    pub sha256: [String; 2],
}

/// A parameter that both runs have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Its name.
    pub name: String,
    /// Its unit in each.
    pub units: [String; 2],
    /// Posterior median of each, SI.
    pub median: [f64; 2],
    /// Equal-tailed 95 % interval of each, SI.
    pub eti95: [[f64; 2]; 2],
    /// Mean of the other minus that of the first, in standard deviations of the first, in the prior's coordinate. None where the
    /// coordinates are not the same.
    pub shift_sd: Option<f64>,
    /// Monte Carlo standard error of that. None where there is no such difference, or where the verdict on one of the runs is NOT TO BE
    /// TRUSTED, which then does not know its standard errors.
    pub shift_se: Option<f64>,
    /// Standard deviation of the other over that of the first.
    pub widening: Option<f64>,
    /// Why there is no such difference; none where there is one.
    pub not_comparable: Option<String>,
}

/// Log evidences side by side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvidenceBeside {
    /// Of each.
    pub log_evidence: [f64; 2],
    /// Standard error of each, as computed: not to be believed of a run whose verdict is NOT TO BE TRUSTED.
    pub standard_error: [f64; 2],
    /// Other minus first; none where they are not evidences of the same data.
    pub difference: Option<f64>,
    /// Its standard error.
    pub difference_se: Option<f64>,
    /// Why they cannot be compared; none where they can.
    pub not_comparable: Option<String>,
}

/// `diff.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diff {
    /// Version of the layout.
    pub schema_version: u32,
    /// The two runs.
    pub plan: DiffPlan,
    /// Titles of the runs.
    pub titles: [String; 2],
    /// Fields of the plans that differ.
    pub plans: Vec<Difference>,
    /// Parameters that both have.
    pub parameters: Vec<Moved>,
    /// Parameters that one of them has alone.
    pub only: [Vec<String>; 2],
    /// The evidence of each.
    pub evidence: EvidenceBeside,
    /// The seed, where both runs have the same: their errors are not independent then, as the standard errors of differences take
    /// them.
    pub same_seed: Option<u64>,
    /// Whether each is to be trusted.
    pub trusted: [bool; 2],
    /// Reasons to be careful with the comparison.
    pub advice: Vec<String>,
}

/// Two runs that were compared, with their figure.
pub struct Compared {
    /// Contents of `diff.json`.
    pub diff: Diff,
    pub(super) inputs: Inputs,
    pub(super) figures: NamedFigures,
}

/// Compares two runs.
///
/// # Errors
///
/// [`Failure::Input`] for a run that cannot be read.
pub fn compare(one: &Path, other: &Path) -> Result<Compared, Failure> {
    let files = [record::locate(one), record::locate(other)];
    let run = |path: &Path, file: &Path| -> Result<_, InputError> {
        let record = record::read(path)?;
        let draws = read_draws(&record, folder_of(file))?;
        Ok((record, draws))
    };
    let (runs, read) = noted(|| Ok([run(one, &files[0])?, run(other, &files[1])?]));
    let [(a, of_a), (b, of_b)] = runs.map_err(|error: InputError| error)?;
    let (records, draws) = ([a, b], [of_a, of_b]);
    let sum = |file: &PathBuf| read.of(file).map_or_else(String::new, |(_, sum)| hex(&sum));
    let sha256 = [sum(&files[0]), sum(&files[1])];
    let plan = DiffPlan { runs: [one.to_owned(), other.to_owned()], sha256 };
    let figure = figure(&records, &draws, &plan);
    let figures: NamedFigures = vec![("diff".to_owned(), Box::new(figure))];
    let roles = ["first posterior", "other posterior"];
    let inputs = Inputs::of(roles.into_iter().zip(files), None, &read);
    Ok(Compared { diff: Diff::new(plan, &records), inputs, figures })
}

impl Diff {
    fn new(plan: DiffPlan, [one, other]: &[Record; 2]) -> Self {
        let has = |record: &Record, name: &str| {
            record.parameters.iter().any(|summary| summary.parameter.name == name)
        };
        let only = |record: &Record, twin: &Record| -> Vec<String> {
            let names = record.parameters.iter().map(|summary| summary.parameter.name.clone());
            names.filter(|name| !has(twin, name)).collect()
        };
        let trusted = [one.trusted(), other.trusted()];
        let mut advice = Vec::new();
        for (run, trusted) in plan.runs.iter().zip(trusted) {
            if !trusted {
                let run = run.display().to_string();
                advice.push(format!(
                    "{} is not to be trusted as it stands: what it differs by may be its own error (calibrate inspect {})",
                    on_one_line(&run),
                    shell_word(&run)
                ));
            }
        }
        Self {
            schema_version: SCHEMA_VERSION,
            titles: [one.plan.title.clone(), other.plan.title.clone()],
            plans: plans::differences(&one.plan, &other.plan),
            parameters: moved(one, other),
            only: [only(one, other), only(other, one)],
            evidence: evidence(one, other),
            same_seed: Some(one.plan.sampler.seed).filter(|seed| *seed == other.plan.sampler.seed),
            trusted,
            advice,
            plan,
        }
    }
}

fn moved(one: &Record, other: &Record) -> Vec<Moved> {
    let pairs = one.parameters.iter().filter_map(|summary| {
        let same =
            |twin: &&smc_calib::ParameterSummary| twin.parameter.name == summary.parameter.name;
        Some((summary, other.parameters.iter().find(same)?))
    });
    let errors_known = one.errors_known() && other.errors_known();
    pairs
        .map(|(a, b)| {
            let (old, new) = (&a.in_coordinate, &b.in_coordinate);
            let (unit, other_unit) = (&a.parameter.unit, &b.parameter.unit);
            let not_comparable = if unit != other_unit {
                Some(format!("its units are not the same, {unit} and {other_unit}"))
            } else if a.coordinate != b.coordinate {
                Some("its priors have other coordinates".to_owned())
            } else if old.sd > 0.0 {
                None
            } else {
                Some("it does not vary in the first run".to_owned())
            };
            let alike = not_comparable.is_none().then_some(old.sd);
            Moved {
                name: a.parameter.name.clone(),
                units: [unit.clone(), other_unit.clone()],
                median: [a.in_si.median, b.in_si.median],
                eti95: [a, b].map(|one| [one.in_si.eti95.lower, one.in_si.eti95.upper]),
                shift_sd: alike.map(|sd| (new.mean - old.mean) / sd),
                shift_se: alike
                    .filter(|_| errors_known)
                    .map(|sd| old.mean_se.hypot(new.mean_se) / sd),
                widening: alike.map(|sd| new.sd / sd),
                not_comparable,
            }
        })
        .collect()
}

/// Why the evidences of two plans are not of the same data; none where they are.
fn other_data(one: &Plan, other: &Plan) -> Option<String> {
    let (mut ones, mut others) = (one.observables(), other.observables());
    loop {
        match (ones.next(), others.next()) {
            (None, None) => return None,
            (Some((_, a)), Some((_, b))) => {
                let units = |plan: &ObservablePlan| (plan.unit.clone(), plan.control_unit.clone());
                if units(a) != units(b) {
                    return Some(format!("the units of {} are not the same", a.name));
                }
                if (&a.control, &a.values) != (&b.control, &b.values) {
                    let (m, n) = (a.values.len(), b.values.len());
                    return Some(match m == n {
                        true => format!("the data are not the same ({} of {m} values)", a.name),
                        false => {
                            format!("the data are not the same ({m} and {n} values of {})", a.name)
                        }
                    });
                }
            }
            _ => return Some("the data are not the same (not as many observables)".to_owned()),
        }
    }
}

fn evidence(one: &Record, other: &Record) -> EvidenceBeside {
    let (a, b) = (&one.log_evidence, &other.log_evidence);
    let not_comparable = if !(one.is_posterior && other.is_posterior) {
        Some("tuned noise has no evidence".to_owned())
    } else if !(one.errors_known() && other.errors_known()) {
        Some("the error of one of them is not known".to_owned())
    } else {
        other_data(&one.plan, &other.plan)
    };
    let comparable = not_comparable.is_none();
    EvidenceBeside {
        log_evidence: [a.value, b.value],
        standard_error: [a.se, b.se],
        difference: comparable.then_some(b.value - a.value),
        difference_se: comparable.then_some(a.se.hypot(b.se)),
        not_comparable,
    }
}

/// The marginals of all parameters that both have, or one alone.
fn figure(records: &[Record; 2], draws: &[Vec<Vec<f64>>; 2], plan: &DiffPlan) -> MarginalsFigure {
    const MOST: usize = 24;
    let mut parameters: Vec<MarginalsParameter> = Vec::new();
    let all = records.iter().flat_map(|record| &record.parameters);
    for summary in all {
        let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
        if parameters.len() == MOST || parameters.iter().any(|one| one.symbol == symbol) {
            continue;
        }
        let column = |(record, draws): (&Record, &Vec<Vec<f64>>)| {
            let name = &summary.parameter.name;
            let place = record.parameters.iter().position(|one| {
                one.parameter.name == *name && one.parameter.unit == summary.parameter.unit
            });
            let column = place.and_then(|place| draws.get(place)).cloned().unwrap_or_default();
            column.iter().map(|value| summary.coordinate.of(*value)).collect()
        };
        parameters.push(MarginalsParameter {
            symbol,
            unit,
            log10: summary.coordinate == smc_calib::Coordinate::Log10,
            draws: records.iter().zip(draws).map(column).collect(),
        });
    }
    MarginalsFigure {
        title: "Marginal posteriors".to_owned(),
        names: plan.runs.iter().map(|run| on_one_line(&run.display().to_string())).collect(),
        parameters,
    }
}
