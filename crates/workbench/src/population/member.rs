//! The calibrations that are members of a population: read, checked against each other, and put into common coordinates.

use std::path::{Path, PathBuf};

use campaign::Format;
use smc_calib::population::{Member, MemberSamples};
use smc_calib::{Coordinate, Parameter};

use crate::error::{Failure, InputError, Mistake};
use crate::input::data_table::DataTable;
use crate::output::checksums;
use crate::pair::parameter::ParameterName;
use crate::plan::{ObservablePlan, PairPlan};
use crate::record::{self, Record};

/// Share of a prior without bounds that is left out at either end where the range of a mean is taken from it.
const TAIL: f64 = 3e-5;

/// A finished calibration.
pub(super) struct Run {
    /// Its folder, as it was given.
    pub(super) given: String,
    pub(super) folder: PathBuf,
    pub(super) record: Record,
}

impl Run {
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let record = record::read_calibration(path)?;
        let given = path.display().to_string();
        let file = record::locate(path);
        let folder = file.parent().unwrap_or(Path::new(".")).to_owned();
        Ok(Self { given, folder, record })
    }

    /// The one pair of the run, where it is that of one.
    pub(super) fn pair(&self) -> Option<&PairPlan> {
        self.record.pair().ok().map(|pair| pair.plan)
    }

    /// Radius that its tau_s belongs to, and the name of that parameter.
    pub(super) fn tau_s(&self) -> Option<(f64, &str)> {
        let pair = self.pair()?;
        let radius_m = pair.tau_s_radius_m.unwrap_or(pair.powder.radius_m);
        Some((radius_m, pair.calibrated(ParameterName::TauS)))
    }

    fn parameter(&self, name: &str) -> Option<(usize, &Parameter)> {
        let named = self.record.plan.parameters.iter().enumerate();
        named.into_iter().find(|(_, parameter)| parameter.name == name)
    }
}

/// The parameters that all runs have, with the place of each in every run.
pub(super) struct Common {
    /// Name, unit and coordinate.
    pub(super) parameters: Vec<(String, String, Coordinate)>,
    /// Factor on each parameter of each run: tau_s goes to the radius of the population.
    pub(super) factors: Vec<Vec<f64>>,
    places: Vec<Vec<usize>>,
}

impl Common {
    /// Checks that the runs are of one model.
    pub(super) fn new(runs: &[Run], radius_m: Option<f64>) -> Result<Self, InputError> {
        one_model(runs)?;
        let first = &runs[0].record.plan.parameters;
        let mut parameters = Vec::new();
        for parameter in first {
            let each = runs.iter().map(|run| run.parameter(&parameter.name).map(|(_, own)| own));
            let own: Vec<&Parameter> = each.flatten().collect();
            let positive = own.iter().all(|own| own.prior.support().0 >= 0.0);
            let log = own.iter().any(|own| own.prior.coordinate() == Coordinate::Log10);
            let coordinate = if positive && log { Coordinate::Log10 } else { Coordinate::Linear };
            parameters.push((parameter.name.clone(), parameter.unit.clone(), coordinate));
        }
        let factor = |run: &Run, name: &str| match (radius_m, run.tau_s()) {
            (Some(to), Some((from, tau_s))) if tau_s == name => to / from,
            _ => 1.0,
        };
        let of_run = |run: &Run| parameters.iter().map(|(name, ..)| factor(run, name)).collect();
        let factors = runs.iter().map(of_run).collect();
        let place = |run: &Run, name: &str| run.parameter(name).map_or(0, |(place, _)| place);
        let of_run = |run: &Run| parameters.iter().map(|(name, ..)| place(run, name)).collect();
        let places = runs.iter().map(of_run).collect();
        Ok(Self { parameters, factors, places })
    }

    /// Ends of the prior's support of a run in the coordinates of the population.
    fn support(&self, run: &Run, k: usize) -> Vec<[f64; 2]> {
        self.each(run, k)
            .map(|(parameter, coordinate, factor)| {
                let (lower, upper) = parameter.prior.support();
                [lower, upper].map(|end| coordinate.of(end * factor))
            })
            .collect()
    }

    /// The parameters of a run with coordinate and factor, in the order of the population.
    fn each<'a>(
        &'a self,
        run: &'a Run,
        k: usize,
    ) -> impl Iterator<Item = (&'a Parameter, Coordinate, f64)> {
        let own = self.places[k].iter().map(|place| &run.record.plan.parameters[*place]);
        let factors = self.factors[k].iter().copied();
        own.zip(&self.parameters)
            .zip(factors)
            .map(|((own, (_, _, coordinate)), factor)| (own, *coordinate, factor))
    }

    /// The range that all priors have in common, parameter by parameter.
    pub(super) fn ranges(&self, runs: &[Run]) -> Result<Vec<[f64; 2]>, InputError> {
        let mut ranges = vec![[f64::NEG_INFINITY, f64::INFINITY]; self.parameters.len()];
        for (k, run) in runs.iter().enumerate() {
            for (range, (parameter, coordinate, factor)) in ranges.iter_mut().zip(self.each(run, k))
            {
                let prior = &parameter.prior;
                let (lower, upper) = prior.support();
                let [from, to] = [coordinate.of(lower), coordinate.of(upper)];
                let lower = if from.is_finite() { lower } else { prior.quantile(TAIL) };
                let upper = if to.is_finite() { upper } else { prior.quantile(1.0 - TAIL) };
                range[0] = range[0].max(coordinate.of(lower * factor));
                range[1] = range[1].min(coordinate.of(upper * factor));
            }
        }
        for ([lower, upper], (name, ..)) in ranges.iter().zip(&self.parameters) {
            if lower >= upper {
                return Err(InputError::new("population", Mistake::Conflict)
                    .found(format_args!("priors of {name} that have nothing in common"))
                    .expected("priors that overlap: a mean that all runs allow")
                    .help(format_args!("calibrate all of them with one prior of {name}")));
            }
        }
        Ok(ranges)
    }

    /// A run as a member.
    pub(super) fn member(&self, run: &Run, k: usize, seed: u64) -> Result<Member, Failure> {
        let file = run.folder.join("samples.csv");
        let mut samples =
            checksums::read_as(&file, |name, text| self.samples((name, text), run, k))?;
        samples.name = run.record.plan.name.clone();
        samples.log_evidence = run.record.log_evidence.value;
        samples.support = self.support(run, k);
        Member::new(&samples, seed).map_err(|error| {
            InputError::new(&run.given, Mistake::Damaged)
                .found(error)
                .help("run the calibration again")
                .into()
        })
    }

    /// The samples with weight, from the text of a `samples.csv`.
    fn samples(
        &self,
        (name, text): (&str, &str),
        run: &Run,
        k: usize,
    ) -> Result<MemberSamples, InputError> {
        let table = DataTable::of_format(name, text, Format::Csv)?;
        let (likelihood, weight) = (table.place("log_likelihood")?, table.place("weight")?);
        let mut samples = MemberSamples::default();
        let mut rows = 0;
        for row in table.rows() {
            rows += 1;
            let number = |place: usize| row.number(place).map_err(|error| table.refused(&error));
            // A simulation that failed has no likelihood, and no weight.
            let own = number(weight)?;
            if own <= 0.0 {
                continue;
            }
            let mut ln_prior = 0.0;
            for ((parameter, coordinate, factor), place) in self.each(run, k).zip(&self.places[k]) {
                let theta = number(*place)?;
                ln_prior += parameter.prior.ln_density(theta);
                if coordinate == Coordinate::Log10 {
                    ln_prior += (theta * std::f64::consts::LN_10).ln();
                } else {
                    // A density over the moved parameter.
                    ln_prior -= factor.ln();
                }
                samples.coordinates.push(coordinate.of(theta * factor));
            }
            samples.ln_prior.push(ln_prior);
            samples.ln_likelihood.push(number(likelihood)?);
            samples.weights.push(own);
        }
        if rows != run.record.counters.simulations {
            return Err(InputError::new(name, Mistake::Damaged)
                .found(format_args!("{rows} samples"))
                .expected(format_args!(
                    "{}, as posterior.json says",
                    run.record.counters.simulations
                ))
                .help("the file is cut off or belongs to another run: run the calibration again"));
        }
        Ok(samples)
    }
}

/// Refuses runs that are not of one model: other parameters, other kinetics, another powder, the same measurements twice.
fn one_model(runs: &[Run]) -> Result<(), InputError> {
    let Some((first, others)) = runs.split_first() else {
        return Err(InputError::new("population", Mistake::MissingField)
            .found("no runs")
            .expected("the folders of two or more finished calibrations"));
    };
    for (place, run) in others.iter().enumerate() {
        let refused = |found: String| InputError::new(&run.given, Mistake::Conflict).found(found);
        same_parameters(first, run)?;
        for parameter in &first.record.plan.parameters {
            let own = run.parameter(&parameter.name).map_or("", |(_, own)| own.unit.as_str());
            if own != parameter.unit {
                let found = format!(
                    "{} in {own}, in {} it is in {}",
                    parameter.name, first.given, parameter.unit
                );
                return Err(refused(found).help("give it in one unit in all plans"));
            }
        }
        let earlier = std::iter::once(first).chain(&others[..place]);
        for earlier in earlier {
            let mut measured = run.record.plan.observables();
            let again = |one: &ObservablePlan| {
                let mut known = earlier.record.plan.observables();
                known.any(|(_, other)| {
                    (&one.control, &one.values) == (&other.control, &other.values)
                })
            };
            if measured.any(|(_, one)| again(one)) {
                return Err(refused(format!("measurements of {} once more", earlier.given))
                    .expected("a calibration of another member for each run")
                    .help("leave one of the two out"));
            }
        }
        if let (Some(one), Some(other)) = (first.pair(), run.pair()) {
            same_pair(first, one, other, &refused)?;
        }
    }
    Ok(())
}

fn same_parameters(first: &Run, run: &Run) -> Result<(), InputError> {
    for (has, lacks) in [(first, run), (run, first)] {
        let names = has.record.plan.parameters.iter().map(|parameter| &parameter.name);
        let missing: Vec<&String> =
            names.into_iter().filter(|name| lacks.parameter(name).is_none()).collect();
        if let Some(name) = missing.first() {
            return Err(InputError::new(&lacks.given, Mistake::Conflict)
                .found(format_args!("no {name}, which is a parameter of {}", has.given))
                .expected("the same parameters in all runs")
                .help(format_args!(
                    "calibrate {} again with [{name}] in its priors, or {} without it",
                    lacks.given, has.given
                )));
        }
    }
    Ok(())
}

fn same_pair(
    first: &Run,
    one: &PairPlan,
    other: &PairPlan,
    refused: &dyn Fn(String) -> InputError,
) -> Result<(), InputError> {
    if one.kinetics != other.kinetics {
        let (own, of_first) = (other.kinetics, one.kinetics);
        return Err(refused(format!("{own} kinetics, in {} {of_first}", first.given))
            .expected("one kinetics in all runs: parameters of two laws are not the same numbers")
            .help(format_args!("calibrate it again with --kinetics {}", one.kinetics)));
    }
    let calibrated = first.parameter(one.calibrated(ParameterName::Phi)).is_some();
    let [phi, of_first] = [other.final_contact_ratio, one.final_contact_ratio];
    let cools = first.parameter(one.calibrated(ParameterName::CoolingTime)).is_some();
    let first = &first.given;
    if cools && one.cooling_radius_m() != other.cooling_radius_m() {
        return Err(refused(format!("a cooling time of another radius than that of {first}"))
            .expected("cooling times of one radius: they go with a power of R")
            .help("state the same cooling_radius_m, and a cooling_power, in [heat] of all experiments"));
    }
    if phi != of_first && !calibrated {
        return Err(refused(format!("a final contact ratio of {phi}, in {first} {of_first}"))
            .expected("one final contact ratio, or one that is calibrated in all runs")
            .help("set final_contact_ratio in the experiments, or add [phi] to the priors"));
    }
    let alike = |pair: &PairPlan| PairPlan {
        experiment: String::new(),
        powder: dem_core::Powder { radius_m: 1e-6, ..pair.powder },
        final_contact_ratio: 1.0,
        final_contact_ratio_reason: None,
        tau_s_radius_m: None,
        solver: one.solver.clone(),
        material: None,
        ..pair.clone()
    };
    if alike(one) != alike(other) {
        return Err(refused(format!("a pair of another powder or history than that of {first}"))
            .expected("pairs of one powder that differ in their radius alone")
            .help("name the runs of one powder"));
    }
    Ok(())
}
