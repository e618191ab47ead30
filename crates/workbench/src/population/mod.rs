//! From finished calibrations of several members to the posterior of their population, and to the next member.

mod member;
mod next;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use smc_calib::population::{
    FEW_EFFECTIVE, Hyperprior, Member, MemberSummary, PopulationPosterior, PopulationProblem,
    calibrate_population,
};
use smc_calib::{CalibrateError, Coordinate, Settings};

use crate::careful::{self, OfPopulation, Simulations};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::output::inputs::{InputFile, Inputs, sum_of};
use crate::output::{Published, RunFolder, make_room};
use crate::plan::{PairPlan, Plan, PopulationPlan, PopulationRun};
use crate::record::{
    FILE_NAME, Marginal, MemberRecord, PopulationRecord, Record, SCHEMA_VERSION, locate,
};
use crate::report;
use crate::watch::{Unwatched, Watch};
use member::{Common, Run};

/// Fewest members whose spread is measured rather than assumed.
const FEWEST_MEMBERS: usize = 4;
/// Share of the population beyond a member's prior that is worth saying.
const BEYOND: f64 = 0.01;

/// What a population is inferred from, and under which assumptions.
#[derive(Debug, Clone, PartialEq)]
pub struct PopulationOptions {
    /// Folders of finished calibrations, or their `posterior.json`.
    pub runs: Vec<PathBuf>,
    /// Standard deviation of the half-normal prior of the spread, in decades for logarithmic parameters; of one parameter where a
    /// name is given, else of all logarithmic ones.
    pub spread: Vec<(Option<String>, f64)>,
    /// eta of the LKJ prior of the correlations; none for independent parameters.
    pub correlation: Option<f64>,
    /// Radius that the next pair has \[m\]; the mean of the pairs' radii where it is not given.
    pub radius_m: Option<f64>,
    /// Evaluations of the posterior.
    pub samples: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for PopulationOptions {
    fn default() -> Self {
        Self {
            runs: Vec::new(),
            spread: Vec::new(),
            correlation: Some(Self::CORRELATION),
            radius_m: None,
            samples: 16_384,
            seed: 1,
        }
    }
}

impl PopulationOptions {
    /// Standard deviation of the half-normal prior of a spread, in decades.
    pub const SPREAD: f64 = 0.3;
    /// The same of a parameter that is not logarithmic, as a share of the range of its mean.
    pub const LINEAR_SPREAD: f64 = 0.1;
    /// eta of the LKJ prior.
    pub const CORRELATION: f64 = 2.0;
}

/// A population to be inferred: runs that were read and found to be of one model.
pub struct PopulationJob {
    plan: Plan,
    problem: PopulationProblem,
    runs: Vec<Run>,
    common: Common,
    pair: Option<PairPlan>,
    inputs: Inputs,
}

/// An inferred population.
pub struct FoundPopulation {
    /// Contents of `posterior.json`.
    pub record: Record,
    /// The sampler's own account.
    pub posterior: PopulationPosterior,
}

impl PopulationJob {
    /// Reads the runs and checks them against each other.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for runs that are missing, damaged or not of one model: other parameters, other kinetics, another
    /// powder, the same measurements twice.
    pub fn read(options: &PopulationOptions) -> Result<Self, Failure> {
        if options.runs.len() < 2 {
            return Err(InputError::new("population", Mistake::MissingField)
                .found(format_args!("{} run", options.runs.len()))
                .expected("the folders of two or more finished calibrations")
                .help("calibrate population results/pa12-r32 results/pa12-r30")
                .into());
        }
        let runs: Vec<Run> =
            options.runs.iter().map(|path| Run::read(path)).collect::<Result<_, _>>()?;
        let radii: Option<Vec<f64>> =
            runs.iter().map(|run| run.tau_s().map(|(radius, _)| radius)).collect();
        let mean = |radii: &Vec<f64>| radii.iter().sum::<f64>() / radii.len() as f64;
        let radius_m = match (&radii, options.radius_m) {
            (None, Some(_)) => {
                return Err(InputError::new("--radius-m", Mistake::Conflict)
                    .found("runs that are not of one pair of particles each")
                    .help("leave out --radius-m")
                    .into());
            }
            (radii, given) => given.or(radii.as_ref().map(mean)),
        };
        let common = Common::new(&runs, radius_m)?;
        let hyperprior = hyperprior(options, &common, &runs)?;
        let members: Vec<Member> = runs
            .iter()
            .enumerate()
            .map(|(k, run)| common.member(run, k, options.seed))
            .collect::<Result<_, _>>()?;
        let inputs = inputs(&options.runs)?;
        let problem = PopulationProblem {
            parameters: common.parameters.clone(),
            hyperprior: hyperprior.clone(),
            members,
        };
        let population = PopulationPlan { hyperprior, radius_m, runs: named(&runs, &inputs) };
        let pair = radius_m.and_then(|radius_m| next::pair(&runs, radius_m));
        let sampler = Settings {
            samples: options.samples,
            seed: options.seed,
            path: false,
            map_simulations: 0,
            ..Settings::default()
        };
        let plan = Plan {
            name: "population".to_owned(),
            title: title(&runs),
            source: runs[0].record.plan.source.clone(),
            parameters: Vec::new(),
            prior_source: None,
            experiments: Vec::new(),
            sampler,
            design: None,
            proposal: None,
            population: Some(population),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        Ok(Self { plan, problem, runs, common, pair, inputs })
    }

    /// The population as the sampler takes it: hyperpriors and members.
    pub fn problem(&self) -> &PopulationProblem {
        &self.problem
    }

    /// Infers the population on the current thread pool; nothing is written.
    ///
    /// # Errors
    ///
    /// [`Failure`] for settings outside their range, and for members that no population explains.
    pub fn run(&self, watch: &dyn Watch) -> Result<FoundPopulation, Failure> {
        watch.begin(self.plan.sampler.samples as u64, 0, "evaluations");
        let mut stages = crate::calibration::Stages::new(watch, None);
        let found = calibrate_population(&self.problem, &self.plan.sampler, &mut stages);
        watch.end();
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        let mut posterior = found.map_err(|error| match error {
            CalibrateError::Interrupted { .. } => Failure::Interrupted,
            CalibrateError::Setting { setting, value, range } => {
                InputError::new("population", Mistake::OutOfRange)
                    .in_field(setting)
                    .found(value)
                    .expected(range)
                    .help("--independent leaves the correlations out")
                    .into()
            }
            other => RunError::new(other).into(),
        })?;
        next::add_noise(&mut posterior, &self.runs)?;
        let record = self.record(&posterior)?;
        Ok(FoundPopulation { record, posterior })
    }

    /// Infers the population and writes the folder of the run.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run); [`Failure::Run`] for a file that cannot be written. Nothing has been published then.
    pub fn publish(
        &self,
        folder: &RunFolder,
        watch: &dyn Watch,
    ) -> Result<(Record, Published), Failure> {
        let own = |run: &&Run| run.folder.canonicalize().is_ok_and(|own| own == folder.path());
        if let Some(member) = self.runs.iter().find(own) {
            return Err(InputError::new("--out", Mistake::Conflict)
                .found(format_args!(
                    "{}, the run of a member, which would be moved aside",
                    member.given
                ))
                .expected("a folder of its own")
                .help("--out results/population")
                .into());
        }
        let found = self.run(watch)?;
        let staging = folder.stage()?;
        let write =
            |name: &str, bytes: &[u8]| staging.write(folder.path(), name, bytes).map_err(make_room);
        let FoundPopulation { record, posterior } = &found;
        write("population.csv", report::population_csv(record).as_bytes())?;
        let populations = next::populations_csv(&self.common.parameters, posterior);
        write("populations.csv", populations.as_bytes())?;
        report::write_all(
            record,
            &posterior.next,
            Some(&self.inputs),
            &write,
            &Unwatched::default(),
        )?;
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        Ok((found.record, staging.publish()?))
    }

    /// The record of a posterior.
    fn record(&self, found: &PopulationPosterior) -> Result<Record, Failure> {
        let next = &found.next;
        let parameters = next.parameters.iter().map(|summary| summary.parameter.clone()).collect();
        let plan = Plan { parameters, ..self.plan.clone() };
        let trust = found.trust();
        let mut advice = self.advice(found);
        let asked = Simulations { extendable: false, of_file: false, ..plan.simulations() };
        advice.extend(trust.concerns.iter().map(|concern| careful::concern(concern, asked)));
        let pair = self.pair.as_ref().map(|pair| next::next_pair(pair, found, &self.runs));
        let population = PopulationRecord {
            mean: found.mean.clone(),
            spread: found.spread.clone(),
            correlation: found.correlation.clone(),
            members: self.members(found),
            next: pair.transpose()?,
        };
        Ok(Record {
            drawn_by_process: false,
            schema_version: SCHEMA_VERSION,
            plan,
            is_posterior: true,
            parameters: next.parameters.clone(),
            correlation: next.correlation.clone(),
            correlation_si: next.correlation_si.clone(),
            log_evidence: next.log_evidence,
            ess: next.ess,
            khat: next.khat,
            trust,
            map: next.map.clone(),
            experiments: Vec::new(),
            path: Vec::new(),
            stages: next.stages.clone(),
            failures: next.failures.clone(),
            failing: None,
            stop: next.stop,
            sensitivity: None,
            population: Some(population),
            advice,
            counters: next.counters,
        })
    }

    fn members(&self, found: &PopulationPosterior) -> Vec<MemberRecord> {
        let each = found.members.iter().zip(&self.runs).zip(&self.common.factors);
        each.map(|((found, run), factors)| MemberRecord {
            name: found.name.clone(),
            log_evidence: run.record.log_evidence.value,
            tau_s_factor: factors.iter().copied().find(|factor| *factor != 1.0).unwrap_or(1.0),
            effective: found.effective,
            effective_least: found.effective_least,
            fitted: found.fitted,
            outside: found.outside.clone(),
            alone: found.alone.iter().map(Marginal::of).collect(),
            shrunk: found.shrunk.iter().map(Marginal::of).collect(),
        })
        .collect()
    }

    /// Reasons to be careful that the sampler does not see.
    fn advice(&self, found: &PopulationPosterior) -> Vec<String> {
        let members = found.members.len();
        let mut advice = Vec::new();
        if members < FEWEST_MEMBERS {
            advice.push(OfPopulation::FewMembers { members, fewest: FEWEST_MEMBERS });
        }
        let each = || found.members.iter().zip(&self.runs);
        let names = |members: Vec<&MemberSummary>| -> Vec<String> {
            members.iter().map(|member| member.name.clone()).collect()
        };
        let of_runs = each().filter(|(_, run)| !run.record.trusted());
        let untrusted: Vec<_> = of_runs.map(|(member, _)| member).collect();
        if !untrusted.is_empty() {
            advice.push(OfPopulation::UntrustedMember { members: names(untrusted) });
        }
        let few = found.members.iter().filter(|member| member.effective_least < FEW_EFFECTIVE);
        let few: Vec<_> = few.collect();
        if !few.is_empty() {
            advice.push(OfPopulation::FewMemberSamples {
                effective: few.iter().map(|m| m.effective_least).fold(f64::INFINITY, f64::min),
                fitted: few.iter().map(|m| m.fitted).fold(0.0, f64::max),
                fewest: FEW_EFFECTIVE,
                members: names(few),
            });
        }
        for (j, (parameter, ..)) in self.common.parameters.iter().enumerate() {
            let beyond = found.members.iter().filter(|member| member.outside[j] > BEYOND);
            let beyond: Vec<_> = beyond.collect();
            if !beyond.is_empty() {
                advice.push(OfPopulation::BeyondMemberPrior {
                    share: beyond.iter().map(|m| m.outside[j]).fold(0.0, f64::max),
                    parameter: parameter.clone(),
                    members: names(beyond),
                });
            }
        }
        advice.iter().map(ToString::to_string).collect()
    }
}

/// The hyperpriors that the options ask for.
fn hyperprior(
    options: &PopulationOptions,
    common: &Common,
    runs: &[Run],
) -> Result<Hyperprior, InputError> {
    let mean = common.ranges(runs)?;
    let names = || common.parameters.iter().map(|(name, ..)| name.as_str());
    let named = options.spread.iter().filter_map(|(name, _)| name.as_deref());
    if let Some(unknown) = named.into_iter().find(|name| !names().any(|own| own == *name)) {
        return Err(InputError::new("--spread", Mistake::UnknownField)
            .found(unknown)
            .expected(format_args!("one of {}", names().collect::<Vec<_>>().join(", ")))
            .did_you_mean(unknown, names()));
    }
    let spread = common.parameters.iter().zip(&mean).map(|((name, _, coordinate), range)| {
        let own = options.spread.iter().rev().find(|(one, _)| one.as_deref() == Some(name));
        let all = options.spread.iter().rev().find(|(one, _)| one.is_none());
        match (own, coordinate, all) {
            (Some((_, own)), ..) => *own,
            (None, Coordinate::Log10, Some((_, all))) => *all,
            (None, Coordinate::Log10, None) => PopulationOptions::SPREAD,
            (None, Coordinate::Linear, _) => {
                PopulationOptions::LINEAR_SPREAD * (range[1] - range[0])
            }
        }
    });
    let spread = spread.collect();
    // One parameter has nothing to be correlated with.
    let correlation = options.correlation.filter(|_| common.parameters.len() > 1);
    Ok(Hyperprior { mean, spread, correlation })
}

/// A heading.
fn title(runs: &[Run]) -> String {
    let what = if runs.iter().all(|run| run.pair().is_some()) { "pairs" } else { "runs" };
    format!("Population of {} {what}", runs.len())
}

/// The files that the population is made of.
fn inputs(runs: &[PathBuf]) -> Result<Inputs, InputError> {
    let mut files = Vec::new();
    for run in runs {
        let record = locate(run);
        let samples = record.parent().unwrap_or(Path::new(".")).join("samples.csv");
        for (role, path) in [("posterior of a member", record), ("samples of a member", samples)] {
            let name = path.display().to_string();
            let (bytes, sha256) = sum_of(&path).map_err(|error| {
                InputError::new(&name, Mistake::Unreadable).found(error).help("copy the run again")
            })?;
            files.push(InputFile { role: role.to_owned(), name, bytes, sha256 });
        }
    }
    Ok(Inputs { files })
}

fn named(runs: &[Run], inputs: &Inputs) -> Vec<PopulationRun> {
    let records = inputs.files.iter().filter(|file| file.name.ends_with(FILE_NAME));
    let each = runs.iter().zip(records);
    each.map(|(run, file)| PopulationRun {
        name: run.record.plan.name.clone(),
        run: run.given.clone(),
        sha256: file.sha256.clone(),
    })
    .collect()
}
