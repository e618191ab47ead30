//! The types of a plan.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use campaign::slurm::SlurmSettings;
use campaign::{Call, CommandSpec, OutputSpec, ResultSpec};
use dem_core::{Kinetics, PairScene, PairSpec, Powder, SolverKind, SolverSettings};
use serde::{Deserialize, Serialize};
use smc_calib::{
    Concern, DistanceScale, FixedSigma, Group, Noise, ObservationError, Observations, Parameter,
    Settings,
};

use super::earlier::EarlierPosterior;
use super::population::PopulationPlan;
use crate::careful::{self, Careful, Simulations};
use crate::error::{InputError, Mistake};
use crate::input::material::Material;
use crate::output::inputs::Inputs;
use crate::pair::heat::HeatPlan;
use crate::pair::parameter::ParameterName;

/// A calibration: parameters, experiments, sampler.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Name of the run and of its folder.
    pub name: String,
    /// Heading of tables and figures.
    pub title: String,
    /// Who measured the data.
    pub source: Option<String>,
    /// The parameters in the order of calibration, each with its unit and prior.
    pub parameters: Vec<Parameter>,
    /// Where the priors come from.
    pub prior_source: Option<String>,
    /// The experiments, each with its simulator and its measurements.
    pub experiments: Vec<ExperimentPlan>,
    /// Settings of the sampler, the seed among them.
    pub sampler: Settings,
    /// Given parameter sets, evaluated instead of drawn ones.
    pub design: Option<Design>,
    /// The earlier posterior that the first samples are drawn from; without it they are drawn from the prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proposal: Option<EarlierPosterior>,
    /// The runs and the hyperpriors of a population; none for a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationPlan>,
    /// Version of this program.
    pub version: String,
}

/// One experiment.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentPlan {
    /// Name of the experiment.
    pub name: String,
    /// Simulator of the experiment.
    pub simulator: SimulatorPlan,
    /// Measured quantities, in the order in which the simulator gives them.
    pub observables: Vec<ObservablePlan>,
}

/// Simulator of an experiment.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SimulatorPlan {
    /// Neck growth of a pair of particles, computed in this program.
    Builtin(PairPlan),
    /// A program of the user's, run once per parameter set in a folder of its own.
    Command(Call),
    /// A function of the program that uses this library: only that program can call it.
    Function {
        /// Name of the function.
        name: String,
    },
}

/// Neck growth of a pair of particles. All SI.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairPlan {
    /// File of the experiment's description, or the name of a built-in experiment.
    pub experiment: String,
    /// Built-in material, if the powder is one.
    pub material: Option<Material>,
    /// Powder, with the radius R of the model.
    pub powder: Powder,
    /// Final contact ratio phi; not used where phi is calibrated.
    pub final_contact_ratio: f64,
    /// Reason for the value of phi.
    pub final_contact_ratio_reason: Option<String>,
    /// Law of neck growth.
    pub kinetics: Kinetics,
    /// Solver of the curve.
    pub solver: SolverPlan,
    /// Radius that the calibrated tau_s belongs to \[m\]: this pair sinters with tau_s R / `tau_s_radius_m`. Without it
    /// tau_s is that of this pair.
    pub tau_s_radius_m: Option<f64>,
    /// Name of the calibrated parameter for each parameter of the model that is called otherwise (`phi = "phi_r30"`).
    pub parameters: BTreeMap<ParameterName, String>,
    /// Heat of the pair; one temperature, that of C1 and tau_s, where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatPlan>,
}

/// Solver of a neck growth curve.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverPlan {
    /// The solver.
    pub name: SolverKind,
    /// Whether the user asked for it.
    pub forced: bool,
    /// Reason for the choice.
    pub reason: String,
    /// Largest error of a/R allowed.
    pub tolerance: f64,
}

/// A measured quantity: its values, their noise, and where the simulated values are.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservablePlan {
    /// Name of the observable.
    pub name: String,
    /// File of the measurements.
    pub table: String,
    /// How the table was read, where it is not in the documented form: columns, units, decimals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table_read: Option<String>,
    /// Column of the control variable; none where the rows are in no order.
    pub control_column: Option<String>,
    /// Column of the measured values.
    pub value_column: String,
    /// Unit of the values; empty where they have none.
    pub unit: String,
    /// Unit of the control variable.
    pub control_unit: String,
    /// Fitted window of the control variable; all rows where there is none.
    pub window: Option<[f64; 2]>,
    /// Control values; row numbers from 0 where there is no control column.
    pub control: Vec<f64>,
    /// Measured values.
    pub values: Vec<f64>,
    /// Standard deviations of the values, where the table states them.
    pub sigma: Option<Vec<f64>>,
    /// Line of each value in the table.
    #[serde(default)]
    pub lines: Vec<usize>,
    /// Noise model.
    pub noise: Noise,
    /// Where a run leaves the simulated values; none for the built-in simulator.
    pub result: Option<ResultSpec>,
}

/// Given parameter sets.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// File of the sample table.
    pub file: String,
    /// The sets, in the order of the plan's parameters.
    pub sets: Vec<Vec<f64>>,
}

/// How the runs are executed. No part of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ExecutorPlan {
    /// Threads of this process, for built-in simulators.
    Threads {
        /// Number of threads; all cores where not given.
        threads: Option<usize>,
    },
    /// Processes on this machine.
    Local {
        /// Number of runs at a time; as many as cores where not given.
        parallel: Option<usize>,
    },
    /// Job arrays of a Slurm cluster.
    Slurm(SlurmSettings),
}

/// A checked plan, how its runs are executed, and the file that says the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The plan, which decides the result.
    pub plan: Plan,
    /// How the runs are executed.
    pub executor: ExecutorPlan,
    /// Warnings on allowed input.
    pub warnings: Vec<String>,
    /// The plan file, which relative names in it begin at; none for a plan of options.
    pub path: Option<PathBuf>,
    /// The text of the plan file.
    pub text: String,
    /// What was read of the files that the plan is made of; none where that was not noted.
    pub inputs: Option<Inputs>,
}

impl Planned {
    /// The plan file that does the same; relative names in the text of a plan file begin at its folder.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a plan in JSON, which is a plan file already.
    pub fn toml(&self) -> Result<String, InputError> {
        match &self.path {
            Some(path) if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("json")) => {
                Err(InputError::new(path.display().to_string(), Mistake::Conflict)
                    .found("a plan in JSON, which is a plan file already")
                    .help("leave out --toml"))
            }
            _ => Ok(self.text.clone()),
        }
    }

    /// Adds the warning that the run itself would give, for a plan that is only printed.
    pub(crate) fn warned(mut self) -> Self {
        let (observations, parameters) = (self.plan.observations(), self.plan.parameters.len());
        if observations < parameters {
            let few = Concern::FewObservations { observations, parameters };
            self.warnings.push(careful::concern(&few, self.plan.simulations()));
        }
        let per_point = Noise::Fixed { sigma: FixedSigma::PerPoint };
        for (experiment, observable) in self.plan.observables() {
            if observable.sigma.is_some() && observable.noise != per_point {
                let unused = Careful::UnusedSigma {
                    observable: self.plan.label(experiment, observable),
                    table: observable.table.clone(),
                    noise: observable.noise.kind().to_owned(),
                };
                self.warnings.push(unused.to_string());
            }
        }
        self
    }
}

/// Whether a parameter, experiment or observable can be called so: the name goes into file names and placeholders.
pub(super) fn is_word(name: &str) -> bool {
    let begins = name.starts_with(|c: char| c.is_ascii_alphabetic());
    let rest = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    begins && rest && name.len() <= 64
}

impl ExperimentPlan {
    /// The command of a program, whose input files begin at `folder`.
    pub(crate) fn command(&self, folder: &Path, mut call: Call) -> CommandSpec {
        for file in &mut call.files {
            let from = folder.join(&file.from);
            file.from = std::path::absolute(&from).unwrap_or(from).display().to_string();
        }
        let outputs = self.observables.iter().filter_map(|observable| {
            let result = observable.result.clone()?;
            Some(OutputSpec { result, at: observable.control.clone() })
        });
        CommandSpec { name: self.name.clone(), call, outputs: outputs.collect() }
    }
}

impl ObservablePlan {
    /// A noise model with the scale that it takes here: rows in no order have no logarithm.
    pub fn scaled(&self, noise: Noise) -> Noise {
        match noise {
            Noise::Correlated { nu0, s0, scale: None, nodes } if self.control_column.is_none() => {
                Noise::Correlated { nu0, s0, scale: Some(DistanceScale::Linear), nodes }
            }
            other => other.at(&self.control),
        }
    }
}

impl Plan {
    /// Names of the parameters, in order.
    pub fn parameter_names(&self) -> Vec<String> {
        self.parameters.iter().map(|parameter| parameter.name.clone()).collect()
    }

    /// The name of a parameter, experiment or observable that no plan file and no options can give.
    pub(crate) fn odd_name(&self) -> Option<&str> {
        let parameters = self.parameters.iter().map(|parameter| &parameter.name);
        let experiments = self.experiments.iter().map(|experiment| &experiment.name);
        let observables = self.observables().map(|(_, observable)| &observable.name);
        let mut names = parameters.chain(experiments).chain(observables);
        names.find(|name| !is_word(name)).map(String::as_str)
    }

    /// Whether the name of the run can be that of a folder, on one line.
    pub(crate) fn has_plain_name(&self) -> bool {
        !self.name.contains(|c: char| c.is_control() || c == '/' || c == '\\') && self.name != ".."
    }

    /// The simulations that it asks for.
    pub(crate) fn simulations(&self) -> Simulations {
        let of_programs = self.commands().next().is_some();
        // Options name a file of priors.
        let of_file = of_programs || self.prior_source.is_none();
        let of_function = self.function().is_some();
        let extendable = self.design.is_none() && !of_function && !self.is_tuned();
        Simulations { number: self.budget(), of_programs, of_function, of_file, extendable }
    }

    /// Whether the noise is tuned for an effective sample size.
    pub(crate) fn is_tuned(&self) -> bool {
        self.observables().any(|(_, seen)| seen.noise.is_tuned())
    }

    /// Experiments that a program of the user's simulates, with their places among the experiments.
    pub fn commands(&self) -> impl Iterator<Item = (usize, &ExperimentPlan, &Call)> {
        self.experiments.iter().enumerate().filter_map(|(place, experiment)| {
            match &experiment.simulator {
                SimulatorPlan::Command(call) => Some((place, experiment, call)),
                _ => None,
            }
        })
    }

    /// The experiment that a function of the calling program simulates, and the name of the function.
    pub fn function(&self) -> Option<(&ExperimentPlan, &str)> {
        self.experiments.iter().find_map(|experiment| match &experiment.simulator {
            SimulatorPlan::Function { name } => Some((experiment, name.as_str())),
            _ => None,
        })
    }

    /// The calls of [`commands`](Self::commands).
    pub(crate) fn calls_mut(&mut self) -> impl Iterator<Item = &mut Call> {
        self.experiments.iter_mut().filter_map(|experiment| match &mut experiment.simulator {
            SimulatorPlan::Command(call) => Some(call),
            _ => None,
        })
    }

    /// The observables as groups of observations, in the order of the simulated values.
    ///
    /// # Errors
    ///
    /// [`InputError`] for measurements that cannot be observations.
    pub fn groups(&self) -> Result<Vec<Group>, InputError> {
        self.observables()
            .map(|(experiment, observable)| {
                let name = self.label(experiment, observable);
                Ok(Group::new(name, observable.observations()?, observable.noise.clone()))
            })
            .collect()
    }

    /// Every observable with its experiment, in the order of the simulated values.
    pub fn observables(&self) -> impl Iterator<Item = (&ExperimentPlan, &ObservablePlan)> {
        self.experiments.iter().flat_map(|experiment| {
            experiment.observables.iter().map(move |observable| (experiment, observable))
        })
    }

    /// The pair of particles of a plan with one experiment, simulated by this program.
    ///
    /// # Errors
    ///
    /// [`InputError`] that says what the plan has instead.
    pub fn pair(&self) -> Result<(&PairPlan, &ObservablePlan), InputError> {
        let refused = |found: String| {
            InputError::new(&self.name, Mistake::Conflict)
                .found(found)
                .expected("the run of one pair of particles with the built-in simulator")
                .help("calibrate --material ps makes one")
        };
        let [experiment] = &self.experiments[..] else {
            return Err(refused(format!("a run with {} experiments", self.experiments.len())));
        };
        match (&experiment.simulator, &experiment.observables[..]) {
            (SimulatorPlan::Builtin(pair), [observable]) => Ok((pair, observable)),
            (SimulatorPlan::Function { name }, _) => {
                Err(refused(format!("{}, which the function {name} simulates", experiment.name)))
            }
            _ => Err(refused(format!("{}, which a program simulates", experiment.name))),
        }
    }

    /// Label of an observable in tables and file names: with its experiment where there are several.
    pub fn label(&self, experiment: &ExperimentPlan, observable: &ObservablePlan) -> String {
        if self.experiments.len() > 1 {
            format!("{}.{}", experiment.name, observable.name)
        } else {
            observable.name.clone()
        }
    }

    /// Number of measured values.
    pub fn observations(&self) -> usize {
        self.observables().map(|(_, observable)| observable.values.len()).sum()
    }

    /// Settings with the first proposal of the plan.
    pub(crate) fn begun(&self, settings: Settings) -> Settings {
        let first_proposal = self.proposal.as_ref().map(|earlier| earlier.first.mixture.clone());
        Settings { first_proposal, ..settings }
    }

    /// Number of parameter sets that are simulated.
    pub fn budget(&self) -> usize {
        self.design.as_ref().map_or(self.sampler.samples, |design| design.sets.len())
    }
}

impl ExperimentPlan {
    /// Number of simulated values of one parameter set.
    pub fn width(&self) -> usize {
        self.observables.iter().map(|observable| observable.values.len()).sum()
    }
}

impl PairPlan {
    /// The pair at the plan's phi.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a powder or phi that no scene can be built of.
    pub fn scene(&self) -> Result<PairScene, InputError> {
        PairSpec::new(self.powder, self.final_contact_ratio)
            .build()
            .map_err(|error| InputError::new(&self.experiment, Mistake::OutOfRange).found(error))
    }

    /// The radius that the cooling time of its pulse belongs to \[m\]; none without a pulse.
    pub fn cooling_radius_m(&self) -> Option<f64> {
        self.heat.as_ref()?.cooling_radius_m(self.powder.radius_m)
    }

    /// Name of the calibrated parameter that stands for one of the model's.
    pub fn calibrated(&self, parameter: ParameterName) -> &str {
        self.parameters.get(&parameter).map_or(parameter.name(), String::as_str)
    }
}

/// Numbers of simulations that can be asked for: at least two sub-nets of eight points each, as fewer have no standard
/// error.
pub const SAMPLES: RangeInclusive<usize> = 16..=100_000_000;

impl SolverPlan {
    /// Error of a/R allowed to a solver unless another is asked for.
    pub const DEFAULT_TOLERANCE: f64 = 1e-4;
    /// Errors of a/R that can be allowed to a solver.
    pub const TOLERANCES: RangeInclusive<f64> = 1e-12..=0.1;

    /// Settings of the solver.
    pub fn settings(&self) -> SolverSettings {
        SolverSettings { tolerance: self.tolerance, ..SolverSettings::of(self.name) }
    }
}

impl ObservablePlan {
    /// The observations as the sampler takes them.
    ///
    /// # Errors
    ///
    /// [`InputError`] that names the table, for values that are no observations.
    pub fn observations(&self) -> Result<Observations, InputError> {
        let refused = |error: ObservationError| {
            InputError::new(&self.table, Mistake::OutOfRange).found(error)
        };
        let observations =
            Observations::new(self.control.clone(), self.values.clone()).map_err(refused)?;
        let Some(sigma) = &self.sigma else { return Ok(observations) };
        observations.with_sigma(sigma.clone()).map_err(refused)
    }
}

impl ExecutorPlan {
    /// Name of the kind of executor, as in a plan file.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Threads { .. } => "threads",
            Self::Local { .. } => "local",
            Self::Slurm(_) => "slurm",
        }
    }
}

/// Number of the run of one experiment at one sample, both counted from 0; runs count from 1.
pub(crate) fn run_number(plan: &Plan, sample: usize, experiment: usize) -> u64 {
    (sample * plan.experiments.len() + experiment) as u64 + 1
}

/// Sample and experiment of a run.
pub(crate) fn sample_of(plan: &Plan, number: u64) -> (usize, usize) {
    let place = usize::try_from(number.saturating_sub(1)).unwrap_or(usize::MAX);
    (place / plan.experiments.len(), place % plan.experiments.len())
}
