//! The validated plan of a calibration: everything that decides its result, and nothing else.
//!
//! Thread counts, output folders and verbosity are not in it: two runs of the same plan write the same
//! bytes.

use dem_core::{Kinetics, PairScene, PairSpec, Powder, SolverKind, SolverSettings, choose_solver};
use serde::{Deserialize, Serialize};
use smc_calib::{FixedSigma, Noise, Observations, Parameter, Settings};
use std::path::PathBuf;

use crate::args::{RunArgs, SolverArg};
use crate::error::{Failure, InputError, Mistake};
use crate::experiment::Experiment;
use crate::material::Material;
use crate::prior_file::{ParameterName, PriorFile};

/// What is calibrated, on what, and how.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What the run is called.
    pub name: String,
    /// Heading.
    pub title: String,
    /// The built-in material, if it is one (`ps`, `pa12`, `peek`).
    pub material: Option<String>,
    /// The measurements and what the model needs to know of them.
    pub experiment: PlannedExperiment,
    /// The parameters in the order of calibration, each with its prior.
    pub parameters: Vec<Parameter>,
    /// File of the priors.
    pub prior_file: String,
    /// How the neck grows (`three-stage`, ...).
    pub kinetics: String,
    /// How a curve is computed.
    pub solver: PlannedSolver,
    /// How measurements scatter.
    pub noise: Noise,
    /// The sampler's settings, the seed among them.
    pub sampler: Settings,
    /// Version of this program.
    pub version: String,
}

/// The measurements of a plan. All SI.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedExperiment {
    /// Name of the experiment.
    pub name: String,
    /// File of the description.
    pub description_file: String,
    /// File of the table.
    pub table_file: String,
    /// Who measured it.
    pub source: Option<String>,
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
    /// Why phi is what it is.
    pub final_contact_ratio_reason: Option<String>,
    /// Fitted window \[s\]; all rows where there is none.
    pub window_s: Option<[f64; 2]>,
    /// Times of the fitted observations \[s\].
    pub time_s: Vec<f64>,
    /// Fitted contact ratios a/R.
    pub contact_ratio: Vec<f64>,
    /// Their standard deviations, where the table states them.
    pub sigma: Option<Vec<f64>>,
}

/// The solver of a plan.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedSolver {
    /// Its name (`closed-form`, `quasi-static`, `verlet`).
    pub name: String,
    /// Whether the user asked for it.
    pub forced: bool,
    /// Why it was taken.
    pub reason: String,
    /// Largest error of a/R allowed.
    pub tolerance: f64,
}

/// A plan, and what is worth saying about it before it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Warnings on the input.
    pub warnings: Vec<String>,
    /// Where the results go.
    pub out: PathBuf,
}

impl Planned {
    /// Reads and checks everything that the command line names.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] with place, value and remedy.
    pub fn from_args(args: &RunArgs) -> Result<Self, Failure> {
        let experiment = match (&args.experiment, args.material) {
            (Some(path), material) => Experiment::open(path, material)?,
            (None, Some(material)) => Experiment::of_material(material)?,
            (None, None) => {
                return Err(InputError::new("--material", Mistake::MissingField)
                    .found("neither a material nor an experiment")
                    .expected("one of --material ps|pa12|peek and --experiment FILE")
                    .help("calibrate --material ps")
                    .into());
            }
        };
        let priors = match (&args.prior, experiment.material) {
            (Some(path), _) => PriorFile::read(path)?,
            (None, Some(material)) => PriorFile::of_material(material)?,
            (None, None) => {
                return Err(InputError::new("--prior", Mistake::MissingField)
                    .found(format_args!(
                        "no priors for {}, whose powder is not built in",
                        experiment.description_name
                    ))
                    .expected("--prior FILE")
                    .help("start from priors/example-my-powder.toml")
                    .into());
            }
        };
        let planned = Plan::new(&experiment, &priors, args)?;
        let warnings = experiment.warnings();
        let out = args.out.clone().unwrap_or_else(|| PathBuf::from("results").join(&planned.name));
        Ok(Self { plan: planned, warnings, out })
    }
}

impl Plan {
    /// The plan for an experiment and priors under the options of the command line.
    ///
    /// # Errors
    ///
    /// [`InputError`] for combinations that cannot run.
    pub fn new(
        experiment: &Experiment,
        priors: &PriorFile,
        args: &RunArgs,
    ) -> Result<Self, InputError> {
        let table = experiment.observations(args.window)?;
        let named = priors.parameters(args.kinetics)?;
        if let (Noise::Fixed { sigma: FixedSigma::PerPoint }, None) = (&args.noise, &table.sigma) {
            return Err(InputError::new("--noise", Mistake::MissingColumn)
                .found("fixed:table")
                .expected(format_args!("a column sigma in {}", experiment.table_name))
                .help("add the column, or say --noise fixed:0.02 or --noise inferred"));
        }
        if let Noise::Fixed { sigma: FixedSigma::Relative(_) } = args.noise
            && let Some(row) = table.contact_ratio.iter().position(|&value| value == 0.0)
        {
            return Err(InputError::new("--noise", Mistake::Conflict)
                .found(format_args!(
                    "fixed-relative, but {} has contact_ratio 0 at time_s = {}, where relative noise vanishes",
                    experiment.table_name, table.time_s[row]
                ))
                .help("leave that row out with --window, or say --noise fixed:0.02"));
        }
        let scene = pair_scene(&experiment.powder, experiment.final_contact_ratio)
            .map_err(|error| scene_error(&experiment.description_name, &error))?;
        let solver = match args.solver {
            SolverArg::Auto => {
                let choice = choose_solver(&scene, args.kinetics, args.tolerance);
                PlannedSolver {
                    name: choice.kind.name().to_owned(),
                    forced: false,
                    reason: choice.reason,
                    tolerance: args.tolerance,
                }
            }
            SolverArg::Forced(kind) => PlannedSolver {
                name: kind.name().to_owned(),
                forced: true,
                reason: match kind {
                    SolverKind::Verlet => format!(
                        "{kind}: as asked; the run with inertia at a step of {} collision times, to which the tolerance \
                         does not apply",
                        SolverSettings::default().step_over_collision_time
                    ),
                    _ => format!("{kind}: as asked"),
                },
                tolerance: args.tolerance,
            },
        };
        // A built-in experiment of a material goes by the name the user typed.
        let by_default = args.experiment.is_none();
        let name = match experiment.material {
            Some(material) if by_default => material.name().to_owned(),
            _ => experiment.name.clone(),
        };
        let title = match (&experiment.title, experiment.material) {
            (_, Some(material)) if by_default => material.title().to_owned(),
            (Some(title), _) => title.clone(),
            (None, _) => experiment.name.clone(),
        };
        let Powder { radius_m, youngs_modulus_pa, surface_tension_n_per_m, density_kg_per_m3 } =
            experiment.powder;
        Ok(Self {
            name,
            title,
            material: experiment.material.map(|material| material.name().to_owned()),
            experiment: PlannedExperiment {
                name: experiment.name.clone(),
                description_file: experiment.description_name.clone(),
                table_file: experiment.table_name.clone(),
                source: experiment.source.clone(),
                radius_m,
                youngs_modulus_pa,
                surface_tension_n_per_m,
                density_kg_per_m3,
                final_contact_ratio: experiment.final_contact_ratio,
                final_contact_ratio_reason: experiment.final_contact_ratio_reason.clone(),
                window_s: experiment.fitted_window(args.window),
                time_s: table.time_s,
                contact_ratio: table.contact_ratio,
                sigma: table.sigma,
            },
            parameters: named.into_iter().map(|(_, parameter)| parameter).collect(),
            prior_file: priors.file_name.clone(),
            kinetics: args.kinetics.name().to_owned(),
            solver,
            noise: args.noise.clone(),
            sampler: Settings {
                seed: args.seed,
                ess_target: args.ess,
                ..sampler(args.samples, args.iterations, &args.noise)
            },
            version: env!("CARGO_PKG_VERSION").to_owned(),
        })
    }

    /// The built-in material, if it is one.
    #[must_use]
    pub fn material(&self) -> Option<Material> {
        self.material.as_deref().and_then(Material::from_name)
    }

    /// The kinetics by type.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a name this version does not know, as an edited file can hold.
    pub fn kinetics(&self) -> Result<Kinetics, InputError> {
        self.kinetics.parse().map_err(|error: dem_core::kinetics::UnknownName| {
            InputError::new("plan", Mistake::UnknownName)
                .in_field("kinetics")
                .found(format_args!("\"{}\"", error.value))
                .expected(format_args!("one of {}", error.choices))
        })
    }

    /// The settings of the solver.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a name this version does not know.
    pub fn solver_settings(&self) -> Result<SolverSettings, InputError> {
        let kind: SolverKind =
            self.solver.name.parse().map_err(|error: dem_core::kinetics::UnknownName| {
                InputError::new("plan", Mistake::UnknownName)
                    .in_field("solver.name")
                    .found(format_args!("\"{}\"", error.value))
                    .expected(format_args!("one of {}", error.choices))
            })?;
        Ok(SolverSettings { tolerance: self.solver.tolerance, ..SolverSettings::of(kind) })
    }

    /// What each calibrated parameter is, in order.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a name that the model does not have.
    pub fn parameter_names(&self) -> Result<Vec<ParameterName>, InputError> {
        self.parameters
            .iter()
            .map(|parameter| {
                ParameterName::from_name(&parameter.name).ok_or_else(|| {
                    InputError::new("plan", Mistake::UnknownName)
                        .in_field("parameters")
                        .found(format_args!("\"{}\"", parameter.name))
                        .expected("c1, tau_s, delta_c or phi")
                })
            })
            .collect()
    }

    /// The pair scene at the plan's phi.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a powder that no scene can be built of.
    pub fn scene(&self) -> Result<PairScene, InputError> {
        self.scene_at(self.experiment.final_contact_ratio)
    }

    /// The pair scene at another phi.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a powder or phi that no scene can be built of.
    pub fn scene_at(&self, final_contact_ratio: f64) -> Result<PairScene, InputError> {
        pair_scene(&self.powder(), final_contact_ratio)
            .map_err(|error| scene_error(&self.experiment.description_file, &error))
    }

    /// The powder.
    #[must_use]
    pub fn powder(&self) -> Powder {
        Powder {
            radius_m: self.experiment.radius_m,
            youngs_modulus_pa: self.experiment.youngs_modulus_pa,
            surface_tension_n_per_m: self.experiment.surface_tension_n_per_m,
            density_kg_per_m3: self.experiment.density_kg_per_m3,
        }
    }

    /// The observations as the sampler takes them.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a table that is not one, as an edited file can hold.
    pub fn observations(&self) -> Result<Observations, InputError> {
        let experiment = &self.experiment;
        let refused = |error: smc_calib::ObservationError| {
            InputError::new(&experiment.table_file, Mistake::OutOfRange).found(error)
        };
        let observations =
            Observations::new(experiment.time_s.clone(), experiment.contact_ratio.clone())
                .map_err(refused)?;
        match &experiment.sigma {
            Some(sigma) => observations.with_sigma(sigma.clone()).map_err(refused),
            None => Ok(observations),
        }
    }
}

/// A noise model on one line.
#[must_use]
pub fn noise_in_words(noise: &Noise) -> String {
    match noise {
        Noise::Inferred { nu0, s0 } => {
            format!("inferred: sigma^2 ~ Inverse-Gamma({nu0}/2, {nu0} * {s0}^2/2), integrated out")
        }
        Noise::Fixed { sigma: FixedSigma::Absolute(sigma) } => format!("fixed: sigma {sigma}"),
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => {
            format!("fixed: sigma {share} times each measured value")
        }
        Noise::Fixed { sigma: FixedSigma::PerPoint } => {
            "fixed: the column sigma of the table".to_owned()
        }
        Noise::EssTarget { share } => format!(
            "tuned until {share} of an iteration's samples are effective: NOT a posterior, for comparison only"
        ),
    }
}

/// The sampler's settings, where no more is asked for than a number of samples: those for small budgets where it is small. A
/// curve of one pair takes microseconds, and so the search for the MAP stays.
pub fn sampler_for(samples: usize) -> Settings {
    let map_simulations = Settings::default().map_simulations;
    Settings { map_simulations, ..Settings::for_budget(samples) }
}

fn sampler(samples: usize, iterations: Option<usize>, noise: &Noise) -> Settings {
    let default = Settings { samples, ..Settings::default() };
    match (iterations, noise) {
        (Some(iterations), _) => Settings { iterations, ..default },
        (None, Noise::EssTarget { .. }) => default,
        (None, _) => sampler_for(samples),
    }
}

fn pair_scene(powder: &Powder, phi: f64) -> Result<PairScene, dem_core::SceneError> {
    PairSpec::new(*powder, phi).build()
}

fn scene_error(file: &str, error: &dem_core::SceneError) -> InputError {
    InputError::new(file, Mistake::OutOfRange).found(error)
}
