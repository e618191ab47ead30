//! The groups of a finished run.
//!
//! Our samples have weights, what is exported has none: the run's own draws (of the samples or of a process, each with noise drawn for its
//! curve), taken at even steps, in an order that means nothing. There are no more of them than the effective sample size, or than the errors
//! of the process are worth, so that programs that count draws do not see more than there is.

use std::collections::HashMap;
use std::path::Path;

use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rayon::prelude::*;
use serde_json::Value;
use smc_calib::{NoiseDraw, ShapeSummary, normal};

use super::curves::{Curves, placed};
use super::groups::{Attributes, Group, Groups, Values, Variable, attributes, free_name, units};
use super::observed::{Observed, Stream, columns, observed, open, stream};
use super::replay::Replay;
use crate::calibration::{Calibration, refused};
use crate::compare;
use crate::error::{Failure, InputError, Mistake};
use crate::given_up;
use crate::input::text_file::folder_of;
use crate::output::CAMPAIGN;
use crate::pair::parameter::ParameterName;
use crate::plan::{noise_in_words, prior_in_words};
use crate::record::{self, Record};
use crate::report::{DrawColumns, SampleColumns, read_samples};

/// Number of draws of the prior.
const PRIOR_DRAWS: usize = 1000;

/// Most numbers of one variable (160 MB): with very many observations there are fewer draws.
const MOST_NUMBERS: usize = 20_000_000;

impl Groups {
    /// Reads the run in a folder, or beside a `posterior.json`.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for a folder without a finished calibration, for files that are damaged, and for tuned weights
    /// (`ess-target`), which are no posterior.
    pub fn read(run: &Path) -> Result<Self, Failure> {
        refuse_comparison(run)?;
        let record = record::read(run)?;
        let file = record::locate(run);
        let folder = folder_of(&file);
        refuse_tuned(&record, &run.display().to_string())?;
        let draws = DrawColumns::read(&record, folder)?;
        let samples = read_samples(&record, folder)?;
        let runs = folder.join(CAMPAIGN);
        let contents = match runs.is_dir() {
            true => Some(campaign::contents(&runs).map_err(|error| refused(folder, error))?),
            false => None,
        };
        let replay = Replay::new(&record.plan, contents.as_ref(), given_up::read(&runs))?;
        let replay = replay.with_kept(folder)?.all_in();
        let curves = Curves { replay, placed: placed(contents.as_ref()) };
        OfRun::new(&record, &draws, &samples, &curves)?.groups()
    }

    /// Of a calibration in memory, whose experiments are all built in.
    ///
    /// # Errors
    ///
    /// As [`Groups::read`].
    pub fn of(calibration: &Calibration) -> Result<Self, Failure> {
        let Calibration { record, posterior } = calibration;
        refuse_tuned(record, &record.plan.name)?;
        let draws = DrawColumns::of(posterior, record.observables().count());
        let samples = SampleColumns::of(posterior);
        let replay = Replay::new(&record.plan, None, given_up::GivenUp::default())?;
        let curves = Curves { replay, placed: HashMap::new() };
        OfRun::new(record, &draws, &samples, &curves)?.groups()
    }
}

fn refuse_comparison(run: &Path) -> Result<(), InputError> {
    if !run.join(compare::RECORD).is_file() {
        return Ok(());
    }
    Err(InputError::new(run.display().to_string(), Mistake::Conflict)
        .found("a comparison of models, which have different parameters: their average has no posterior of parameters")
        .expected("the run of one model")
        .help("one of them: calibrate --material NAME --kinetics KINETICS --noise NOISE, then calibrate export")
        .help(format_args!(
            "sintering times by the average of all: calibrate predict --average {}",
            run.display()
        )))
}

fn refuse_tuned(record: &Record, name: &str) -> Result<(), InputError> {
    if record.is_posterior {
        return Ok(());
    }
    Err(InputError::new(name, Mistake::Conflict)
        .found("weights of tuned noise (ess-target), which are no posterior")
        .expected("a run whose noise is inferred, correlated, robust or fixed")
        .help("its samples with their weights are in samples.csv"))
}

/// The draws that are exported, and what belongs to them.
struct OfRun<'a> {
    record: &'a Record,
    observed: Vec<Observed<'a>>,
    /// Draws of the run, of which these are some.
    of: usize,
    /// Parameters of each draw \[SI\].
    thetas: Vec<Vec<f64>>,
    /// Sample of each draw.
    samples: Vec<usize>,
    /// Parameters that it was simulated at, which the draw may have been moved from.
    placed: Vec<Vec<f64>>,
    /// Weight of that sample.
    weights: Vec<f64>,
    /// Values of each draw; none where those of one are not known.
    curves: Option<Vec<Vec<f64>>>,
    /// Whether these are predicted by the process that made the draws, not simulated.
    predicted: bool,
}

/// Places of the exported draws among those of the run.
fn chosen(record: &Record, draws: usize) -> Vec<usize> {
    let by_errors = record.ess.by_errors.filter(|_| record.drawn_by_process).unwrap_or(0.0);
    let effective = record.trust.effective_samples.max(by_errors).floor() as usize;
    let fit = MOST_NUMBERS / record.plan.observations().max(1);
    let count = draws.min(effective).min(fit).max(1).min(draws);
    let mut chosen: Vec<usize> = (0..count).map(|k| k * draws / count).collect();
    chosen.shuffle(&mut stream(record.plan.sampler.seed, Stream::Order, 0));
    chosen
}

impl<'a> OfRun<'a> {
    fn new(
        record: &'a Record,
        draws: &DrawColumns,
        of_all: &SampleColumns,
        curves: &Curves<'_>,
    ) -> Result<Self, InputError> {
        let theta =
            |k: &usize| -> Vec<f64> { draws.parameters.iter().map(|column| column[*k]).collect() };
        let plan = &record.plan;
        let built_in = plan.commands().next().is_none() && plan.function().is_none();
        let predicted = record.drawn_by_process && !built_in;
        let mut chosen = chosen(record, draws.samples.len());
        let mut values = None;
        if record.drawn_by_process && built_in {
            // No draw of a process was simulated: at some the model may fail.
            let of = |k: &usize| Some((*k, curves.of(draws.samples[*k], &theta(k))?));
            let finished: Vec<_> = chosen.par_iter().filter_map(of).collect();
            if !finished.is_empty() {
                let (finished, all) = finished.into_iter().unzip();
                (chosen, values) = (finished, Some(all));
            }
        }
        let thetas: Vec<Vec<f64>> = chosen.iter().map(theta).collect();
        let samples: Vec<usize> = chosen.iter().map(|k| draws.samples[*k]).collect();
        // Reading draws refuses numbers of samples that `posterior.json` has not, and reading samples another number of them.
        let place = |sample: &usize| of_all.parameters.iter().map(|of| of[*sample]).collect();
        let placed: Vec<Vec<f64>> = match record.drawn_by_process {
            true => thetas.clone(),
            false => samples.iter().map(place).collect(),
        };
        let observed = observed(record, draws, &chosen)?;
        let curves = match (record.drawn_by_process, predicted) {
            (false, _) => curves.simulated(&samples, &placed),
            (true, true) => curves.predicted(&observed, of_all, &thetas),
            (true, false) => values,
        };
        Ok(Self {
            of: draws.samples.len(),
            curves,
            record,
            observed,
            predicted,
            weights: samples.iter().map(|sample| of_all.weights[*sample]).collect(),
            placed,
            thetas,
            samples,
        })
    }

    fn groups(&self) -> Result<Groups, Failure> {
        let mut notes = Vec::new();
        let mut groups = vec![self.posterior(), self.prior()];
        match &self.curves {
            Some(curves) => {
                groups.extend([self.log_likelihood(curves), self.predictive(curves)]);
            }
            None => notes.push(
                "log_likelihood, posterior_predictive and lp are missing: the simulated values of some draws are not \
                 stored (the folder campaign/ beside posterior.json has them)"
                    .to_owned(),
            ),
        }
        groups.extend([self.observed_data(), self.sample_stats()]);
        groups.extend(self.constant_data());
        Ok(Groups { attributes: self.attributes(&notes), groups, notes })
    }

    /// Names of the noise of every observable: sigma, correlation length, white share, none of which a parameter has.
    fn noise_names(&self, taken: &mut Vec<String>) -> Vec<[String; 3]> {
        let several = self.observed.len() > 1;
        let named = |of: &Observed<'_>| {
            ["sigma", "correlation_length", "white_share"].map(|name| match several {
                true => free_name(&format!("{name}_{}", of.found.label), taken),
                false => free_name(name, taken),
            })
        };
        self.observed.iter().map(named).collect()
    }

    /// Variables of parameters and of inferred noise, from the values of each in all draws.
    fn of_parameters(
        &self,
        parameter: impl Fn(usize) -> Vec<f64>,
        noise: impl Fn(usize) -> Vec<NoiseDraw>,
    ) -> Vec<Variable> {
        let mut taken = ["chain", "draw"].map(str::to_owned).to_vec();
        let mut variables = Vec::new();
        for (place, one) in self.record.plan.parameters.iter().enumerate() {
            let built_in = self.record.plan.pair().is_ok();
            let meaning = ParameterName::from_name(&one.name).filter(|_| built_in);
            let about = attributes([
                ("units", units(&one.unit)),
                ("long_name", meaning.map_or(Value::Null, |name| name.meaning().into())),
                ("prior", prior_in_words(one.prior.spec()).into()),
            ]);
            let name = free_name(&one.name, &mut taken);
            variables.push(Variable::of_draws(name, Values::Real(parameter(place)), about));
        }
        let names = self.noise_names(&mut taken);
        for (place, (of, names)) in self.observed.iter().zip(names).enumerate() {
            if of.found.sigma.is_some_and(|sigma| !sigma.fixed) {
                let about = of.noise_attributes();
                let drawn = noise(place);
                for ((name, about), column) in names.into_iter().zip(about).zip(columns(&drawn)) {
                    variables.push(Variable::of_draws(name, Values::Real(column), about));
                }
            }
        }
        variables
    }

    fn posterior(&self) -> Group {
        let parameter = |place: usize| self.thetas.iter().map(|theta| theta[place]).collect();
        let variables = self.of_parameters(parameter, |place| self.observed[place].noise.clone());
        let description = "equally weighted draws of parameters and of the noise";
        self.of_draws("posterior", description, variables)
    }

    fn prior(&self) -> Group {
        let plan = &self.record.plan;
        let seed = plan.sampler.seed;
        let parameter = |place: usize| {
            let mut rng = stream(seed, Stream::Prior, place);
            let prior = &plan.parameters[place].prior;
            let drawn = || prior.from_z(normal::quantile(open(rng.random())));
            std::iter::repeat_with(drawn).take(PRIOR_DRAWS).collect()
        };
        let noise = |place: usize| {
            let mut rng = stream(seed, Stream::Prior, plan.parameters.len() + place);
            let of = &self.observed[place].plan;
            let drawn = || of.noise.draw_errors(&of.control, &mut rng).map(|(draw, _)| draw);
            std::iter::repeat_with(drawn).take(PRIOR_DRAWS).flatten().collect()
        };
        let variables = self.of_parameters(parameter, noise);
        self.of_draws("prior", "independent draws of the priors", variables)
    }

    fn log_likelihood(&self, curves: &[Vec<f64>]) -> Group {
        let variables = self.observed.iter().map(|of| {
            let rows = curves.par_iter().enumerate().map(|(k, curve)| {
                let (noise, own) = (of.noise.get(k), &curve[of.places.clone()]);
                let unknown = || vec![f64::NAN; own.len()];
                of.likelihood.ln_pointwise(noise, own).unwrap_or_else(unknown)
            });
            let description = match of.found.noise_shape {
                Some(ShapeSummary::Correlated { .. }) => {
                    "ln p(y_i | all other observations of this variable, parameters, noise)"
                }
                _ => "ln p(y_i | parameters, noise)",
            };
            let noise = noise_in_words(&of.plan.noise).into();
            let about = attributes([("description", description.into()), ("noise", noise)]);
            of.variable(rows.flatten_iter().collect(), about)
        });
        let description =
            "log density of each observation in each draw, noise drawn, not integrated out";
        self.of_draws("log_likelihood", description, variables.collect())
    }

    fn predictive(&self, curves: &[Vec<f64>]) -> Group {
        let seed = self.record.plan.sampler.seed;
        let variables = self.observed.iter().enumerate().map(|(place, of)| {
            let rows = curves.par_iter().enumerate().map(|(k, curve)| {
                let mut rng = stream(seed, Stream::Predictive, place << 40 | k);
                of.measured_again(k, &curve[of.places.clone()], &mut rng)
            });
            let about = attributes([("units", units(&of.plan.unit))]);
            of.variable(rows.flatten_iter().collect(), about)
        });
        let description = "a new measurement at each observation in each draw, in the same experiment: correlated errors \
                           are known from the residuals there; each observation on its own";
        self.of_draws("posterior_predictive", description, variables.collect())
    }

    fn observed_data(&self) -> Group {
        let variables = self.observed.iter().map(|of| Variable {
            name: of.name.clone(),
            dims: vec![of.dim.clone()],
            shape: vec![of.plan.values.len()],
            values: Values::Real(of.plan.values.clone()),
            attributes: attributes([
                ("units", units(&of.plan.unit)),
                ("table", of.plan.table.clone().into()),
            ]),
        });
        let coordinates = self.observed.iter().map(Observed::coordinate).collect();
        let (name, description) = ("observed_data", "the measurements");
        Group { name, description, coordinates, variables: variables.collect() }
    }

    /// Control values that are no coordinate, as some of them are the same.
    fn constant_data(&self) -> Option<Group> {
        let repeated = self.observed.iter().filter(|of| !of.has_control_coordinate());
        let repeated: Vec<_> = repeated.filter(|of| of.plan.control_column.is_some()).collect();
        let variables = repeated.iter().map(|of| Variable {
            name: format!("{}_{}", of.name, of.control_name()),
            dims: vec![of.dim.clone()],
            shape: vec![of.plan.control.len()],
            values: Values::Real(of.plan.control.clone()),
            attributes: attributes([("units", units(&of.plan.control_unit))]),
        });
        let (name, variables) = ("constant_data", variables.collect());
        let coordinates = repeated.iter().map(|of| of.coordinate()).collect();
        let description = "control values of which some are the same";
        (!repeated.is_empty()).then_some(Group { name, description, coordinates, variables })
    }

    fn sample_stats(&self) -> Group {
        let mut variables = Vec::new();
        if let Some(curves) = &self.curves {
            let lp = self.placed.par_iter().zip(curves).map(|(theta, curve)| {
                let parameters = self.record.plan.parameters.iter().zip(theta);
                let prior: f64 = parameters.map(|(one, value)| one.prior.ln_density(*value)).sum();
                let each = self.observed.iter();
                let ln = each.map(|of| of.likelihood.ln_joint(&curve[of.places.clone()]));
                prior + ln.sum::<f64>()
            });
            let description =
                "ln of prior times likelihood, the noise integrated out, not normalised";
            let about = attributes([("description", description.into())]);
            variables.push(Variable::of_draws("lp".to_owned(), Values::Real(lp.collect()), about));
        }
        let samples = self.samples.iter().map(|sample| *sample as i64).collect();
        let description = if self.record.drawn_by_process {
            "row of samples.csv that is nearest to the draw, from 0"
        } else {
            "row of samples.csv that the draw is of, from 0; draws of one row are the same simulation, of which lp is"
        };
        let about = attributes([("description", description.into())]);
        variables.push(Variable::of_draws("sample".to_owned(), Values::Whole(samples), about));
        let about = attributes([("description", "weight of that sample among all".into())]);
        let weights = Values::Real(self.weights.clone());
        variables.push(Variable::of_draws("weight".to_owned(), weights, about));
        self.of_draws("sample_stats", "of each draw of the posterior", variables)
    }

    /// A group whose variables begin with chain and draw.
    fn of_draws(
        &self,
        name: &'static str,
        description: &'static str,
        variables: Vec<Variable>,
    ) -> Group {
        let count = variables.first().map_or(0, |one| one.shape[1]) as i64;
        let whole = |name, values| Variable::coordinate(name, values, Attributes::new());
        let mut coordinates = vec![
            whole("chain", Values::Whole(vec![0])),
            whole("draw", Values::Whole((0..count).collect())),
        ];
        let used = |of: &&Observed<'_>| variables.iter().any(|one| one.dims.contains(&of.dim));
        coordinates.extend(self.observed.iter().filter(used).map(Observed::coordinate));
        Group { name, description, coordinates, variables }
    }

    fn attributes(&self, notes: &[String]) -> Attributes {
        let Record { plan, trust, log_evidence, .. } = self.record;
        let text = |text: &Option<String>| text.clone().map_or(Value::Null, Value::from);
        let draws = format!(
            "{} of the run's {} equally weighted draws at even steps, shuffled: no more than its effective sample size. One \
             chain, which is no Markov chain: R-hat says nothing, pareto_khat and importance_ess do",
            self.samples.len(),
            self.of
        );
        let outputs = match self.predicted {
            true => {
                "those of draws are predicted by a Gaussian process through the runs, which were at none of them"
            }
            false => "those of draws are simulated",
        };
        let mut all = attributes([
            ("inference_library", "calibrate".into()),
            ("inference_library_version", plan.version.clone().into()),
            ("name", plan.name.clone().into()),
            ("title", plan.title.clone().into()),
            ("source", text(&plan.source)),
            ("seed", plan.sampler.seed.into()),
            ("simulations", self.record.counters.simulations.into()),
            ("draws", draws.into()),
            ("outputs", outputs.into()),
            ("importance_ess", trust.effective_samples.into()),
            ("pareto_khat", self.record.khat.into()),
            ("log_evidence", log_evidence.value.into()),
            ("log_evidence_se", log_evidence.se.into()),
            ("trust", trust.verdict.to_string().into()),
            ("advice", self.record.advice.join("\n").into()),
            ("missing", notes.join("\n").into()),
        ]);
        if let Ok((pair, _)) = plan.pair() {
            all.insert("kinetics".to_owned(), pair.kinetics.name().into());
            let material = pair.material.map_or(Value::Null, |material| material.name().into());
            all.extend(attributes([("material", material)]));
        }
        all
    }
}
