//! The plan of pairs of particles, from options: what `--material` and `--experiment` stand for.

use std::collections::BTreeMap;
use std::path::PathBuf;

use dem_core::{Kinetics, PairScene, SolverKind, SolverSettings, choose_solver};
use smc_calib::{FixedSigma, Noise, Settings};

use super::heats::pairs;
use super::made_of;
use super::proposal::{Named, begin_from};
use super::together;
use super::toml::toml;
use super::types::{
    ExecutorPlan, ExperimentPlan, ObservablePlan, PairPlan, Plan, Planned, SimulatorPlan,
    SolverPlan, is_word,
};
use crate::careful::Careful;
use crate::error::{InputError, Mistake};
use crate::input::columns::Columns;
use crate::input::experiment::Experiment;
use crate::input::files_read;
use crate::input::heat::HeatFields;
use crate::input::material::Material;
use crate::input::prior_file::PriorFile;
use crate::pair::parameter::ParameterName;

/// Name of the one observable of the built-in simulator.
pub(super) const CONTACT_RATIO: &str = "contact_ratio";

/// Options of the calibration of one pair of particles, or of several of one powder. The default has the documented defaults and nothing to
/// calibrate.
#[derive(Debug, Clone, PartialEq)]
pub struct PairOptions {
    /// Built-in material: powder, measurements and priors.
    pub material: Option<Material>,
    /// Own measurements: a description, a bare table (which needs a material), or the name of a built-in experiment.
    pub experiment: Option<PathBuf>,
    /// Further experiments of the same powder, calibrated together with the first: all parameters are shared, tau_s in proportion
    /// to R, but for the time of first contact.
    pub others: Vec<PathBuf>,
    /// What is said of the columns of the table beside its header and its description.
    pub columns: Columns,
    /// Own priors.
    pub prior: Option<PathBuf>,
    /// Fitted window \[s\]; the description's, or all rows, where there is none.
    pub window_s: Option<[f64; 2]>,
    /// Law of neck growth.
    pub kinetics: Kinetics,
    /// Solver; the cheapest within the tolerance where there is none.
    pub solver: Option<SolverKind>,
    /// Largest error of a/R allowed to the solver.
    pub tolerance: f64,
    /// Noise model.
    pub noise: Noise,
    /// Number of simulations.
    pub samples: usize,
    /// Number of adaptive stages; from the number of simulations where there is none.
    pub iterations: Option<usize>,
    /// Effective sample size at which the adaptive stages end early.
    pub ess: Option<f64>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Folder or file of an earlier result that the first samples are drawn from.
    pub proposal: Option<PathBuf>,
}

impl Default for PairOptions {
    fn default() -> Self {
        Self {
            material: None,
            experiment: None,
            others: Vec::new(),
            columns: Columns::default(),
            prior: None,
            window_s: None,
            kinetics: Kinetics::ThreeStage,
            solver: None,
            tolerance: SolverPlan::DEFAULT_TOLERANCE,
            noise: Noise::default(),
            samples: Settings::default().samples,
            iterations: None,
            ess: None,
            seed: 1,
            proposal: None,
        }
    }
}

impl PairOptions {
    /// Reads and checks everything that the options name.
    pub fn plan(&self) -> Result<Planned, InputError> {
        let (planned, files) = files_read::noted(|| self.read());
        let planned = planned?;
        Ok(Planned { inputs: Some(made_of::inputs(None, &planned.plan, &files)), ..planned })
    }

    fn read(&self) -> Result<Planned, InputError> {
        let all = self.read_experiments()?;
        self.check_together(all.len())?;
        together::check(&all)?;
        let priors = self.read_priors(&all)?;
        all.iter().try_for_each(|experiment| self.check_noise(experiment))?;
        let pairs: Vec<ExperimentPlan> =
            all.iter().map(|one| self.pair_of(one, &all, &priors)).collect::<Result<_, _>>()?;
        together::check_heats(&pairs, &all)?;
        // A built-in experiment of a material goes by the name that the user typed.
        let (name, title) = match &all[..] {
            [one] => match (one.material.filter(|_| self.experiment.is_none()), &one.title) {
                (Some(material), _) => (material.name().to_owned(), material.title().to_owned()),
                (None, title) => {
                    (one.name.clone(), title.clone().unwrap_or_else(|| one.name.clone()))
                }
            },
            several => together::name_and_title(several),
        };
        let mut plan = Plan {
            name,
            title,
            source: together::source(&all),
            parameters: together::parameters(&priors, self.kinetics, &pairs)?,
            prior_source: Some(priors.file_name.clone()),
            experiments: pairs,
            sampler: self.sampler(),
            design: None,
            proposal: None,
            population: None,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let mut warnings: Vec<String> = all.iter().flat_map(Experiment::warnings).collect();
        if self.prior.is_some() {
            let names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
            warnings.extend(unused_priors(&plan, &priors, &names.join(" and ")));
        }
        if let Some(path) = &self.proposal {
            let (from, place) = (path.display().to_string(), |m| InputError::new("--proposal", m));
            let named = Named { from: &from, path, place: &place };
            begin_from(&mut plan, &named, None, &mut warnings)?;
        }
        let text = toml(&plan);
        let executor = ExecutorPlan::Threads { threads: None };
        Ok(Planned { plan, executor, warnings, path: None, text, inputs: None }.warned())
    }

    fn read_experiments(&self) -> Result<Vec<Experiment>, InputError> {
        let others = self.others.iter();
        let others = others.map(|path| Experiment::open(path, self.material, &Columns::default()));
        [self.read_experiment()].into_iter().chain(others).collect()
    }

    /// Refuses options on one table beside several experiments.
    fn check_together(&self, experiments: usize) -> Result<(), InputError> {
        let (option, found, help) = if experiments == 1 {
            return Ok(());
        } else if self.window_s.is_some() {
            let help = "take rows away from a table by window = [FROM, TO] in its description";
            ("--window", "one window", help)
        } else if self.columns != Columns::default() {
            let help = "say it in [columns] of its description";
            ("--time-column and the like", "what is said of one table", help)
        } else if self.noise.is_tuned() {
            let help = "choose noise inferred, correlated, robust or fixed";
            ("--noise", "noise that is tuned to one table", help)
        } else {
            return Ok(());
        };
        Err(InputError::new(option, Mistake::Conflict)
            .found(format_args!("{found}, and {experiments} experiments"))
            .help(help))
    }

    /// The user's priors, or those of the built-in material that all experiments are of.
    fn read_priors(&self, all: &[Experiment]) -> Result<PriorFile, InputError> {
        let material = all.first().and_then(|one| one.material);
        match (&self.prior, material, all.iter().find(|one| one.material.is_none())) {
            (Some(path), ..) => PriorFile::read(path),
            (None, Some(material), None) => PriorFile::of_material(material),
            (None, _, of_none) => Err(InputError::new("--prior", Mistake::MissingField)
                .found(format_args!(
                    "no priors for {}, whose powder is not built in",
                    of_none.map_or("the experiments", |one| &one.description_name)
                ))
                .expected("--prior FILE")
                .help("calibrate init TABLE proposes priors; priors/example-my-powder.toml shows what can stand there")),
        }
    }

    /// The plan of one of the experiments.
    fn pair_of(
        &self,
        experiment: &Experiment,
        all: &[Experiment],
        priors: &PriorFile,
    ) -> Result<ExperimentPlan, InputError> {
        let alone = all.len() == 1;
        let name = together::word(&experiment.name);
        let model = PairModel {
            kinetics: self.kinetics,
            solver: self.solver,
            tolerance: self.tolerance,
            tau_s_radius_m: together::tau_s_radius_m(all),
            parameters: match alone {
                true => BTreeMap::new(),
                false => together::own_names(priors, &name),
            },
            heat: None,
        };
        let pair = pair_experiment(experiment, model, self.window_s, self.noise.clone())?;
        Ok(if alone { pair } else { ExperimentPlan { name, ..pair } })
    }

    fn read_experiment(&self) -> Result<Experiment, InputError> {
        match (&self.experiment, self.material) {
            (Some(path), material) => Experiment::open(path, material, &self.columns),
            (None, _) if self.columns != Columns::default() => {
                Err(InputError::new("--experiment", Mistake::MissingField)
                    .found("options on the columns of a table, and no table")
                    .expected("--experiment FILE"))
            }
            (None, Some(material)) => Experiment::of_material(material),
            (None, None) => Err(InputError::new("--material", Mistake::MissingField)
                .found("neither a material nor an experiment")
                .expected("one of --material ps|pa12|peek and --experiment FILE")
                .help("calibrate --material ps")),
        }
    }

    /// Noise that the table cannot have.
    fn check_noise(&self, experiment: &Experiment) -> Result<(), InputError> {
        let table = experiment.observations(self.window_s)?;
        let Noise::Fixed { sigma } = &self.noise else { return Ok(()) };
        if *sigma == FixedSigma::PerPoint && table.sigma.is_none() {
            return Err(InputError::new("--noise", Mistake::MissingColumn)
                .found("fixed:table")
                .expected(format_args!("a column sigma in {}", experiment.table_name))
                .help("add the column, or say --noise fixed:0.02 or --noise inferred"));
        }
        if matches!(sigma, FixedSigma::Relative(_))
            && let Some(row) = table.contact_ratio.iter().position(|&value| value == 0.0)
        {
            return Err(InputError::new("--noise", Mistake::Conflict)
                .found(format_args!(
                    "fixed-relative, but {} has contact_ratio 0 at time_s = {}, where relative noise vanishes",
                    experiment.table_name, table.time_s[row]
                ))
                .help("leave that row out with --window, or say --noise fixed:0.02"));
        }
        Ok(())
    }

    fn sampler(&self) -> Settings {
        let settings = match self.iterations {
            None if !self.noise.is_tuned() => sampler_for(self.samples),
            iterations => {
                let default = Settings { samples: self.samples, ..Settings::default() };
                Settings { iterations: iterations.unwrap_or(default.iterations), ..default }
            }
        };
        Settings { seed: self.seed, ess_target: self.ess, ..settings }
    }
}

/// Settings for a number of simulations of the built-in simulator, with the search for the MAP: a curve of one pair
/// takes microseconds.
pub fn sampler_for(samples: usize) -> Settings {
    let map_simulations = Settings::default().map_simulations;
    Settings { map_simulations, ..Settings::for_budget(samples) }
}

/// Choices of a neck growth model.
pub(super) struct PairModel {
    pub(super) kinetics: Kinetics,
    /// The solver asked for.
    pub(super) solver: Option<SolverKind>,
    pub(super) tolerance: f64,
    pub(super) tau_s_radius_m: Option<f64>,
    /// Calibrated parameters by the model's names, where they differ.
    pub(super) parameters: BTreeMap<ParameterName, String>,
    /// What the plan says of the heat; it goes before what the experiment says.
    pub(super) heat: Option<HeatFields>,
}

/// Priors of a heat in a file of the user's that the experiment has no use for. Those of other kinetics are there on purpose.
fn unused_priors(plan: &Plan, priors: &PriorFile, experiment: &str) -> Vec<String> {
    let heat = pairs(&plan.experiments).any(|(_, pair)| pair.heat.is_some());
    let unused = ParameterName::ALL.into_iter().filter(|name| {
        let calibrated = plan.parameters.iter().any(|one| one.name == name.name());
        name.is_of_heat() && priors.get(*name).is_some() && !calibrated
    });
    let said = unused.map(|name| Careful::UnusedPrior {
        priors: priors.file_name.clone(),
        parameter: name.name().to_owned(),
        experiment: experiment.to_owned(),
        heat,
    });
    said.map(|careful| careful.to_string()).collect()
}

/// The experiment of one pair, checked.
pub(super) fn pair_experiment(
    experiment: &Experiment,
    model: PairModel,
    window_s: Option<[f64; 2]>,
    noise: Noise,
) -> Result<ExperimentPlan, InputError> {
    let table = experiment.observations(window_s)?;
    let heat = match (model.heat, &experiment.heat) {
        (Some(plan), Some(own)) => Some(plan.or(own)),
        (plan, own) => plan.or_else(|| own.clone()),
    };
    let mut pair = PairPlan {
        experiment: experiment.description_name.clone(),
        material: experiment.material,
        powder: experiment.powder,
        final_contact_ratio: experiment.final_contact_ratio,
        final_contact_ratio_reason: experiment.final_contact_ratio_reason.clone(),
        kinetics: model.kinetics,
        solver: SolverPlan {
            name: SolverKind::ClosedForm,
            forced: model.solver.is_some(),
            reason: String::new(),
            tolerance: model.tolerance,
        },
        tau_s_radius_m: model.tau_s_radius_m,
        parameters: model.parameters,
        heat: heat.map(|heat| heat.plan()).transpose()?,
    };
    let scene = pair.scene()?;
    (pair.solver.name, pair.solver.reason) = solver(&scene, &pair, model.solver);
    let observable = ObservablePlan {
        name: CONTACT_RATIO.to_owned(),
        table: experiment.table_name.clone(),
        table_read: table.how,
        control_column: Some("time_s".to_owned()),
        value_column: CONTACT_RATIO.to_owned(),
        unit: String::new(),
        control_unit: "s".to_owned(),
        window: experiment.fitted_window(window_s),
        noise: noise.at(&table.time_s),
        control: table.time_s,
        values: table.contact_ratio,
        sigma: table.sigma,
        lines: table.lines,
        result: None,
    };
    let name = if is_word(&experiment.name) { &experiment.name } else { "pair" };
    Ok(ExperimentPlan {
        name: name.to_owned(),
        simulator: SimulatorPlan::Builtin(pair),
        observables: vec![observable],
    })
}

/// The solver that was asked for, or the cheapest within the tolerance, and the reason for it.
fn solver(scene: &PairScene, pair: &PairPlan, asked: Option<SolverKind>) -> (SolverKind, String) {
    match asked {
        None => {
            let choice = choose_solver(scene, pair.kinetics, pair.solver.tolerance);
            (choice.kind, choice.reason)
        }
        Some(SolverKind::Verlet) => (
            SolverKind::Verlet,
            format!(
                "verlet: as asked; the run with inertia at a step of {} collision times, to which the tolerance does \
                 not apply",
                SolverSettings::default().step_over_collision_time
            ),
        ),
        Some(kind) => (kind, format!("{kind}: as asked")),
    }
}
