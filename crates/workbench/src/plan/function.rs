//! The plan of a calibration whose experiment a function of the calling program simulates.

use serde::Deserialize;
use smc_calib::{FixedSigma, Noise, Parameter, Settings};

use super::observable::checked;
use super::sampler::{COMMAND_SAMPLES, onto_bound};
use super::types::{
    Design, ExecutorPlan, ExperimentPlan, ObservablePlan, Plan, Planned, SAMPLES, SimulatorPlan,
    is_word,
};
use crate::error::{InputError, Mistake};
use crate::output::inputs::Inputs;

/// A calibration of a function: parameters, measurements, sampler.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunctionOptions {
    /// Name of the run.
    pub name: String,
    /// Heading of tables and figures; the name where there is none.
    pub title: Option<String>,
    /// Name of the function.
    pub function: String,
    /// The parameters in the order in which the function takes them.
    pub parameters: Vec<Parameter>,
    /// The measured quantities, in the order in which the function gives them.
    pub observables: Vec<Measured>,
    /// Number of simulations; 300 where there is none.
    pub samples: Option<usize>,
    /// Number of adaptive stages; from the number of simulations where there is none.
    pub iterations: Option<usize>,
    /// Effective sample size at which the adaptive stages end early.
    pub ess: Option<f64>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of simulations that go on at a time; where there is none, as in a plan file that does not say.
    pub batch: Option<usize>,
    /// Largest share of failed simulations; the sampler's where there is none.
    pub max_failed_share: Option<f64>,
    /// Given parameter sets, simulated instead of drawn ones.
    pub design: Option<Vec<Vec<f64>>>,
}

/// A measured quantity.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// Name of the control variable.
    pub control_name: String,
    /// Control values, none of which goes back; none where the values are in no order.
    pub control: Option<Vec<f64>>,
    /// The measured values.
    pub values: Vec<f64>,
    /// Standard deviations of the values, where they are known.
    pub sigma: Option<Vec<f64>>,
    /// Unit of the values; empty where they have none.
    pub unit: String,
    /// Unit of the control variable.
    pub control_unit: String,
    /// How the measurements scatter.
    pub noise: Noise,
}

impl FunctionOptions {
    /// Checks everything and makes the plan.
    ///
    /// # Errors
    ///
    /// [`InputError`] that names the argument.
    pub fn plan(self) -> Result<Planned, InputError> {
        check_names("parameters", self.parameters.iter().map(|parameter| &parameter.name))?;
        check_names("observations", self.observables.iter().map(|measured| &measured.name))?;
        check_names("name", [&self.name].into_iter())?;
        if self.observables.len() > 1
            && self.observables.iter().any(|measured| measured.noise.is_tuned())
        {
            return Err(InputError::new("noise", Mistake::Conflict)
                .found("an effective sample size to aim at beside other observations")
                .expected("one observable, where the noise is tuned"));
        }
        let sampler = self.settings()?;
        let design = self.design.as_deref().map(|sets| self.design(sets)).transpose()?;
        let observables =
            self.observables.into_iter().map(Measured::planned).collect::<Result<_, _>>()?;
        let name = if is_word(&self.function) { self.function.clone() } else { "model".to_owned() };
        let plan = Plan {
            title: self.title.unwrap_or_else(|| self.name.clone()),
            name: self.name,
            source: None,
            parameters: self.parameters,
            prior_source: None,
            experiments: vec![ExperimentPlan {
                name,
                simulator: SimulatorPlan::Function { name: self.function },
                observables,
            }],
            sampler,
            design,
            proposal: None,
            population: None,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let executor = ExecutorPlan::Threads { threads: None };
        // No file was read for it.
        let inputs = Some(Inputs::default());
        let (warnings, text) = (Vec::new(), String::new());
        Ok(Planned { plan, executor, warnings, path: None, text, inputs })
    }

    /// The settings that a plan file with a command would have.
    fn settings(&self) -> Result<Settings, InputError> {
        let refused = |name: &str, found: &dyn std::fmt::Display, expected: &str| {
            InputError::new(name, Mistake::OutOfRange).found(found).expected(expected)
        };
        let samples = match &self.design {
            Some(sets) => sets.len(),
            None => self.samples.unwrap_or(COMMAND_SAMPLES),
        };
        if self.design.is_none() && !SAMPLES.contains(&samples) {
            let expected = format!("a whole number from {} to {}", SAMPLES.start(), SAMPLES.end());
            return Err(refused("samples", &samples, &expected));
        }
        let mut settings = Settings { seed: self.seed, ..Settings::for_budget(samples) };
        if let Some(iterations) = self.iterations {
            if !(1..=1000).contains(&iterations) {
                return Err(refused("iterations", &iterations, "a whole number from 1 to 1000"));
            }
            settings.iterations = iterations;
        }
        if let Some(batch) = self.batch {
            if batch > 10_000 {
                return Err(refused("batch", &batch, "a whole number from 0 to 10000"));
            }
            settings.batch = batch;
        }
        if let Some(ess) = self.ess {
            if !(ess >= 1.0 && ess.is_finite()) {
                return Err(refused("ess", &ess, "a number of at least 1"));
            }
            settings.ess_target = Some(ess);
        }
        if let Some(share) = self.max_failed_share {
            if !(0.0..=1.0).contains(&share) {
                return Err(refused("max_failed_share", &share, "a number from 0 to 1"));
            }
            settings.max_failed_share = share;
        }
        Ok(settings)
    }

    fn design(&self, sets: &[Vec<f64>]) -> Result<Design, InputError> {
        let refused = |mistake| InputError::new("design", mistake);
        if sets.len() < 2 {
            return Err(refused(Mistake::Empty)
                .found(format_args!("{} parameter sets", sets.len()))
                .expected("at least two, or there is nothing to weight"));
        }
        let mut sets = sets.to_vec();
        for (row, set) in sets.iter_mut().enumerate() {
            if set.len() != self.parameters.len() {
                return Err(refused(Mistake::Conflict)
                    .found(format_args!("{} values in parameter set {row}", set.len()))
                    .expected(format_args!(
                        "one for each of {} parameters",
                        self.parameters.len()
                    )));
            }
            for (value, parameter) in set.iter_mut().zip(&self.parameters) {
                let (lower, upper) = parameter.prior.support();
                *value = onto_bound(*value, lower, upper);
                if !(lower..=upper).contains(&*value) {
                    return Err(refused(Mistake::OutOfRange)
                        .in_field(format_args!("{}[{row}]", parameter.name))
                        .found(*value)
                        .expected(format_args!("a value the prior allows, {lower} to {upper}"))
                        .help("widen the prior, or leave the set out"));
                }
            }
        }
        Ok(Design { file: "design".to_owned(), sets })
    }
}

/// Names go into names of files and columns.
fn check_names<'a>(
    argument: &str,
    names: impl Iterator<Item = &'a String>,
) -> Result<(), InputError> {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        if !is_word(name) {
            return Err(InputError::new(argument, Mistake::OutOfRange)
                .found(format_args!("\"{name}\" as a name"))
                .expected("a letter, then letters, digits, _ and -, at most 64"));
        }
        if !seen.insert(name) {
            return Err(InputError::new(argument, Mistake::Duplicate)
                .found(format_args!("\"{name}\" twice"))
                .expected("a name of its own for each"));
        }
    }
    if seen.is_empty() {
        return Err(InputError::new(argument, Mistake::Empty).expected("one at least"));
    }
    Ok(())
}

impl Measured {
    fn planned(self) -> Result<ObservablePlan, InputError> {
        let place = format!("observations {}", self.name);
        let refused = |mistake| InputError::new(&place, mistake);
        let rows = self.values.len();
        if rows == 0 {
            return Err(refused(Mistake::Empty).found("no values").expected("at least one"));
        }
        for (what, other) in [("x", &self.control), ("sigma", &self.sigma)] {
            if let Some(other) = other.as_ref().filter(|other| other.len() != rows) {
                return Err(refused(Mistake::Conflict)
                    .in_field(what)
                    .found(format_args!("{} numbers", other.len()))
                    .expected(format_args!("{rows}, one for each value of y")));
            }
        }
        if let Some(x) = &self.control
            && let Some(row) = (1..rows).find(|&row| x[row] < x[row - 1])
        {
            return Err(refused(Mistake::Unsorted)
                .in_field(format_args!("x[{row}]"))
                .found(format_args!("{} after {}", x[row], x[row - 1]))
                .expected("values that do not go back")
                .help(
                    "sort the rows; a loading that turns back is two observables, or one over time",
                ));
        }
        if let Some(row) = self.sigma.iter().flatten().position(|sigma| *sigma <= 0.0) {
            return Err(refused(Mistake::OutOfRange)
                .in_field(format_args!("sigma[{row}]"))
                .expected("a standard deviation > 0"));
        }
        let per_point = Noise::Fixed { sigma: FixedSigma::PerPoint };
        if self.noise == per_point && self.sigma.is_none() {
            return Err(refused(Mistake::MissingField)
                .in_field("sigma")
                .expected("the standard deviation of each value, which this noise uses"));
        }
        let mut observable = ObservablePlan {
            name: self.name,
            table: place,
            table_read: None,
            control_column: self.control.is_some().then_some(self.control_name),
            value_column: String::new(),
            unit: self.unit,
            control_unit: self.control_unit,
            window: None,
            control: self.control.unwrap_or_else(|| (0..rows).map(|row| row as f64).collect()),
            values: self.values,
            sigma: self.sigma,
            lines: Vec::new(),
            noise: self.noise,
            result: None,
        };
        observable.value_column.clone_from(&observable.name);
        observable.noise = observable.scaled(observable.noise.clone());
        checked(&observable)?;
        Ok(observable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Planned;

    fn options() -> FunctionOptions {
        serde_json::from_value(serde_json::json!({
            "name": "line", "function": "line", "seed": 3, "samples": 48,
            "parameters": [
                {"name": "a", "unit": "1", "prior": {"kind": "normal", "mean": 0.0, "sd": 1.0}},
                {"name": "b", "unit": "1", "prior": {"kind": "uniform", "lower": -4.0, "upper": 4.0}},
            ],
            "observables": [{
                "name": "y", "control_name": "t", "control": [0.0, 1.0, 2.0], "values": [0.31, 0.79, 1.32],
                "sigma": null, "unit": "", "control_unit": "",
                "noise": {"kind": "fixed", "sigma": {"absolute": 0.05}},
            }],
        }))
        .expect("options")
    }

    #[test]
    fn a_function_is_sampled_with_the_settings_of_a_program() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("line.csv"), "t,y\n0,0.31\n1,0.79\n2,1.32\n")
            .expect("a table");
        let text = "name = \"line\"\n[parameters]\na = { distribution = \"normal\", mean = 0.0, sd = 1.0 }\n\
            b = { distribution = \"uniform\", lower = -4.0, upper = 4.0 }\n[experiments.line.simulator]\n\
            kind = \"command\"\nargv = [\"true\", \"{a}\", \"{b}\"]\n[experiments.line.observables.y]\ntable = \"line.csv\"\n\
            control = \"t\"\nnoise = { kind = \"fixed\", sigma = 0.05 }\nresult = { file = \"o.csv\", control = \"t\", value = \"y\" }\n\
            [sampler]\nsamples = 48\nseed = 3\n";
        let path = folder.path().join("plan.toml");
        std::fs::write(&path, text).expect("a plan");
        let of_file = Planned::read(&path).expect("a plan").plan;
        let own = options().plan().expect("a plan").plan;
        assert_eq!(own.sampler, of_file.sampler);
        assert_eq!(own.parameters, of_file.parameters);
        assert_eq!(own.groups().expect("groups"), of_file.groups().expect("groups"));
    }

    type Change = dyn Fn(&mut FunctionOptions);

    #[test]
    fn what_cannot_be_calibrated_is_refused_by_its_argument() {
        let refused = |change: &Change| {
            let mut changed = options();
            change(&mut changed);
            changed.plan().expect_err("refused").to_string()
        };
        let cases: [(&str, &Change); 15] = [
            ("samples: found 3", &|o| o.samples = Some(3)),
            ("ess: found 0", &|o| o.ess = Some(0.0)),
            ("iterations: found 0", &|o| o.iterations = Some(0)),
            ("batch: found 20000", &|o| o.batch = Some(20_000)),
            ("max_failed_share: found 2", &|o| o.max_failed_share = Some(2.0)),
            ("parameters: expected one at least", &|o| o.parameters.clear()),
            ("parameters: found \"a\" twice", &|o| o.parameters[1].name = "a".to_owned()),
            ("parameters: found \"a b\" as a name", &|o| o.parameters[1].name = "a b".to_owned()),
            ("observations y, field x: found 2 numbers, expected 3", &|o| {
                o.observables[0].control = Some(vec![0.0, 1.0]);
            }),
            ("observations y, field x[1]: found 0 after 1", &|o| {
                o.observables[0].control = Some(vec![1.0, 0.0, 2.0]);
            }),
            ("observations y, field sigma[2]", &|o| {
                o.observables[0].sigma = Some(vec![1.0, 1.0, 0.0])
            }),
            ("observations y, field sigma: expected the standard deviation", &|o| {
                o.observables[0].noise = Noise::Fixed { sigma: FixedSigma::PerPoint };
            }),
            ("observations y: found no values", &|o| o.observables[0].values.clear()),
            ("design: found 1 parameter sets", &|o| o.design = Some(vec![vec![0.0, 0.0]])),
            ("design, field b[1]: found 9", &|o| {
                o.design = Some(vec![vec![0.0, 0.0], vec![0.0, 9.0]])
            }),
        ];
        for (words, change) in cases {
            let error = refused(change);
            assert!(error.contains(words), "{error}\n{words}");
        }
    }
}
