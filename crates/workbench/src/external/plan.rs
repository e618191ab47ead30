//! The validated plan of a calibration of any simulator: everything that decides its result.
//!
//! How the runs are executed is apart, in [`ExecutorPlan`]: the same plan gives the same posterior on threads, local
//! processes and a cluster.

use std::collections::BTreeMap;

use dem_core::{PairScene, PairSpec, Powder};
use serde::{Deserialize, Serialize};
use smc_calib::{Noise, Parameter, Settings};

use crate::plan::PlannedSolver;

/// What is calibrated, on what, and how.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExternalPlan {
    /// What the run is called.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Who measured what is fitted.
    pub source: Option<String>,
    /// The parameters in the order of calibration, each with its unit and prior.
    pub parameters: Vec<Parameter>,
    /// The experiments, each with a simulator and what it is compared with.
    pub experiments: Vec<ExperimentPlan>,
    /// The sampler's settings, the seed among them.
    pub sampler: Settings,
    /// Given parameter sets, evaluated instead of drawn ones.
    pub design: Option<Design>,
    /// Version of this program.
    pub version: String,
}

/// One experiment.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentPlan {
    /// Its name.
    pub name: String,
    /// What simulates it.
    pub simulator: SimulatorPlan,
    /// What was measured, in the order of the plan.
    pub observables: Vec<ObservablePlan>,
}

/// What simulates an experiment.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SimulatorPlan {
    /// The neck growth of a pair, in this program.
    Builtin(BuiltinPlan),
    /// A program of the user's.
    Command(CommandPlan),
}

/// The built-in neck growth of a pair. All SI.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuiltinPlan {
    /// The experiment's description or name.
    pub experiment: String,
    /// Radius R of the model \[m\].
    pub radius_m: f64,
    /// Young's modulus E \[Pa\].
    pub youngs_modulus_pa: f64,
    /// Surface tension gamma \[N/m\].
    pub surface_tension_n_per_m: f64,
    /// Density rho \[kg/m3\].
    pub density_kg_per_m3: f64,
    /// Final contact ratio phi; where phi is calibrated, only what it would have been.
    pub final_contact_ratio: f64,
    /// How the neck grows (`three-stage`, ...).
    pub kinetics: String,
    /// How a curve is computed.
    pub solver: PlannedSolver,
    /// Radius that the calibrated tau_s belongs to \[m\]: this pair sinters with tau_s R / R_cal. Without it tau_s is
    /// this pair's own.
    pub tau_s_radius_m: Option<f64>,
    /// Which calibrated parameter stands for which of the model's (`phi = "phi_r30"`); the same name where it is not
    /// listed.
    pub parameters: BTreeMap<String, String>,
}

impl BuiltinPlan {
    /// The powder.
    #[must_use]
    pub fn powder(&self) -> Powder {
        Powder {
            radius_m: self.radius_m,
            youngs_modulus_pa: self.youngs_modulus_pa,
            surface_tension_n_per_m: self.surface_tension_n_per_m,
            density_kg_per_m3: self.density_kg_per_m3,
        }
    }

    /// The pair at the plan's phi.
    ///
    /// # Errors
    ///
    /// As `dem_core` says, for a powder that no scene can be built of.
    pub fn scene(&self) -> Result<PairScene, dem_core::SceneError> {
        PairSpec::new(self.powder(), self.final_contact_ratio).build()
    }
}

/// A program of the user's, run once per parameter set in a folder of its own.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandPlan {
    /// Program and arguments, as the plan has them, with their placeholders.
    pub argv: Vec<String>,
    /// Environment variables beside those of the driver, with placeholders too.
    pub environment: BTreeMap<String, String>,
    /// Longest time that one run may take \[s\].
    pub timeout_s: f64,
    /// How often a run that was lost (not one that failed) is tried again.
    pub retries: u32,
    /// Which runs keep their folders.
    pub keep: Keep,
}

/// Which runs keep their folders.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Keep {
    /// Those that failed.
    Failed,
    /// All.
    All,
    /// None.
    None,
}

/// One observable: a measured table, its noise, and where the simulated values are read.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservablePlan {
    /// Its name.
    pub name: String,
    /// File of the measurements.
    pub table: String,
    /// Column of the control variable; none where the rows are in no order.
    pub control_column: Option<String>,
    /// Column of the measured values.
    pub value_column: String,
    /// Unit of the values, for axes.
    pub unit: String,
    /// Unit of the control variable, for axes.
    pub control_unit: String,
    /// Fitted window of the control variable; all rows where there is none.
    pub window: Option<[f64; 2]>,
    /// Control values; row numbers from 0 where there is no control column.
    pub control: Vec<f64>,
    /// Measured values.
    pub values: Vec<f64>,
    /// Their standard deviations, where the table states them.
    pub sigma: Option<Vec<f64>>,
    /// How these measurements scatter.
    pub noise: Noise,
    /// Where the simulated values are read; none for the built-in simulator.
    pub result: Option<ResultPlan>,
}

/// Where a run leaves the simulated values.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultPlan {
    /// File, in the folder of the run.
    pub file: String,
    /// How it is written.
    pub format: ResultFormat,
    /// Column of the control variable; none where the values are in the order of the measurements.
    pub control: Option<String>,
    /// Column of the values.
    pub value: String,
    /// Whether values between the rows are interpolated.
    pub interpolate: Interpolate,
}

/// How a result is written.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResultFormat {
    /// Comma-separated, with a header.
    Csv,
    /// Separated by blanks, with a header.
    Whitespace,
    /// JSON: an object of lists (or of single numbers), or a list of objects.
    Json,
}

/// What happens between the rows of a result.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolate {
    /// Linear interpolation.
    Linear,
    /// The result must hold every control value.
    Refuse,
}

/// Given parameter sets.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The sample table.
    pub file: String,
    /// The sets, in the order of the plan's parameters.
    pub sets: Vec<Vec<f64>>,
}

/// How the runs are executed. No part of the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ExecutorPlan {
    /// In this process, for built-in simulators.
    Threads {
        /// Threads; all cores where not given.
        threads: Option<usize>,
    },
    /// Processes on this machine.
    Local {
        /// Runs at a time; as many as cores where not given.
        parallel: Option<usize>,
    },
    /// Job arrays of a Slurm cluster.
    Slurm(SlurmPlan),
}

/// Options of Slurm; the cluster's defaults where not given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlurmPlan {
    /// `--partition`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub partition: Option<String>,
    /// `--account`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub account: Option<String>,
    /// `--time` of an array element, in minutes; from the timeout where not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_min: Option<u32>,
    /// `--mem`, in MB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_mb: Option<u64>,
    /// `--cpus-per-task`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpus: Option<u32>,
    /// Further options of sbatch, each beginning with `--`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extra: Vec<String>,
    /// Shell lines run before the simulator, such as `module load lammps`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub setup: Vec<String>,
    /// Array elements at the same time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_parallel: Option<u32>,
    /// Runs per array element, one after the other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunk: Option<u32>,
    /// First interval of asking the queue \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poll_min_s: Option<f64>,
    /// Longest interval of asking the queue \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poll_max_s: Option<f64>,
    /// How long a result may take to show after its job left the queue \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grace_s: Option<f64>,
    /// Patience with one call of a Slurm command \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command_timeout_s: Option<f64>,
}

impl ExternalPlan {
    /// Names of the parameters, in order.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<String> {
        self.parameters.iter().map(|parameter| parameter.name.clone()).collect()
    }

    /// The commands with the places of their experiments.
    pub fn commands(&self) -> impl Iterator<Item = (usize, &ExperimentPlan, &CommandPlan)> {
        self.experiments.iter().enumerate().filter_map(|(place, experiment)| {
            match &experiment.simulator {
                SimulatorPlan::Command(command) => Some((place, experiment, command)),
                SimulatorPlan::Builtin(_) => None,
            }
        })
    }

    /// Every observable with its experiment, in the order of the simulated values.
    pub fn observables(&self) -> impl Iterator<Item = (&ExperimentPlan, &ObservablePlan)> {
        self.experiments.iter().flat_map(|experiment| {
            experiment.observables.iter().map(move |observable| (experiment, observable))
        })
    }

    /// What an observable is called: with its experiment where there are several.
    #[must_use]
    pub fn label(&self, experiment: &ExperimentPlan, observable: &ObservablePlan) -> String {
        if self.experiments.len() > 1 {
            format!("{}.{}", experiment.name, observable.name)
        } else {
            observable.name.clone()
        }
    }

    /// Number of measured values.
    #[must_use]
    pub fn observations(&self) -> usize {
        self.observables().map(|(_, observable)| observable.values.len()).sum()
    }

    /// Parameter sets that the plan asks for.
    #[must_use]
    pub fn budget(&self) -> usize {
        self.design.as_ref().map_or(self.sampler.samples, |design| design.sets.len())
    }
}

impl ExecutorPlan {
    /// Its name in a plan.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Threads { .. } => "threads",
            Self::Local { .. } => "local",
            Self::Slurm(_) => "slurm",
        }
    }
}
