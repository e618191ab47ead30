//! The posterior draws of a saved calibration of one pair, for commands that compute further with them.

use std::path::Path;

use dem_core::{PairScene, PairSpec, Powder, SceneError, Sintering};

use crate::careful::Careful;
use crate::error::{Failure, InputError, Mistake};
use crate::pair::model::NeckGrowth;
use crate::pair::parameter::ParameterName;
use crate::plan::PairPlan;
use crate::record::{self, ObservableRecord, Pair, PopulationRecord, Record};
use crate::report::{DrawColumns, read_draws, read_sigma};
use smc_calib::ShapeSummary;

/// Equally weighted draws of a posterior, and the pair that it was calibrated on.
#[derive(Debug, Clone)]
pub struct PairDraws {
    /// The calibration.
    pub record: Record,
    /// Name of the experiment, where several were calibrated together.
    pub experiment: Option<String>,
    /// The pair that it was calibrated on.
    pub pair: PairPlan,
    /// Values of the parameters \[SI\], a column for each.
    pub columns: Vec<Vec<f64>>,
    /// Noise standard deviation of each draw; none where the noise has not one for all times.
    pub sigma: Option<Vec<f64>>,
    /// Share of outliers, and how much wider they scatter; none for noise without.
    pub outliers: Option<[f64; 2]>,
    /// Reasons to be careful.
    pub advice: Vec<String>,
    model: NeckGrowth,
}

/// What draws of a calibrated pair need: its plan, its times, what was found.
fn calibrated<'a>(pair: &Pair<'a>) -> (PairPlan, Vec<f64>, Option<&'a ObservableRecord>) {
    (pair.plan.clone(), pair.measured.control.clone(), Some(pair.found))
}

/// A run of several pairs, of which one is to be named.
fn which_of(run: &str, names: &[&str]) -> InputError {
    InputError::new(run, Mistake::MissingField)
        .found(format_args!("a run of {} experiments", names.len()))
        .expected(format_args!("one pair of particles: {}", names.join(" or ")))
        .help(format_args!("name it: --of {}", names[0]))
}

impl PairDraws {
    /// Reads `posterior.json` and the `draws.csv` beside it; `path` is the file or its folder.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for files that are missing, damaged or not of one pair.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::read_of(path, None)
    }

    /// As [`read`](Self::read), of the experiment of this name where several were calibrated together.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read), and for a name that the run has not.
    pub fn read_of(path: &Path, experiment: Option<&str>) -> Result<Self, Failure> {
        Self::of_record(path, record::read(path)?, experiment)
    }

    fn of_record(path: &Path, record: Record, experiment: Option<&str>) -> Result<Self, Failure> {
        let (pair, control, found) = match (&record.population, experiment) {
            (Some(population), None) => (next_pair(path, population)?, Vec::new(), None),
            (_, Some(name)) => calibrated(&record.pair_named(name)?),
            (None, None) => match &record.pair_names()[..] {
                names @ [_, _, ..] => return Err(which_of(&record.plan.name, names).into()),
                _ => calibrated(&record.pair()?),
            },
        };
        let file = record::locate(path);
        let folder = file.parent().unwrap_or(Path::new("."));
        let columns = read_draws(&record, folder).map_err(|error| {
            error.help("draws.csv is written beside posterior.json: name the folder of a run")
        })?;
        let is_known = found.is_none_or(|found| found.sigma.is_some());
        let sigma = match (found.filter(|_| experiment.is_some()), is_known) {
            (_, false) => None,
            (None, true) => read_sigma(&record, folder)?,
            (Some(found), true) => {
                let place = record.observables().position(|(_, one)| std::ptr::eq(one, found));
                let noise = DrawColumns::read(&record, folder)?.noise;
                let own = place.and_then(|place| noise.get(place));
                own.map(|own| own.iter().map(|noise| noise.sigma).collect())
            }
        };
        let outliers = match found.and_then(|found| found.noise_shape.as_ref()) {
            Some(ShapeSummary::Robust { outlier_share, outlier_width, .. }) => {
                Some([*outlier_share, *outlier_width])
            }
            _ => None,
        };
        let mut advice = record.advice.clone();
        if !record.is_posterior {
            advice.insert(0, Careful::TunedDraws.to_string());
        }
        Ok(Self {
            model: NeckGrowth::new(&pair, &record.plan.parameters, control)?,
            experiment: experiment.filter(|_| record.experiments.len() > 1).map(str::to_owned),
            record,
            pair,
            columns,
            sigma,
            outliers,
            advice,
        })
    }

    /// Number of draws.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Whether there are no draws.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The parameters of a draw \[SI\], in order.
    pub fn theta(&self, row: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[row]).collect()
    }

    /// A parameter of the model in a draw, where it was calibrated.
    pub fn value(&self, name: ParameterName, row: usize) -> Option<f64> {
        self.model.place(name).map(|place| self.columns[place][row])
    }

    /// The sintering parameters of a draw at the calibrated radius; `unused` gives C1 and delta_c where the kinetics do
    /// not use them.
    pub fn sintering(&self, row: usize, unused: Sintering) -> Sintering {
        let calibrated = self.model.sintering(&self.theta(row));
        match self.pair.kinetics.uses_c1_delta_c() {
            true => calibrated,
            false => Sintering { tau_s: calibrated.tau_s, lambda: calibrated.lambda, ..unused },
        }
    }

    /// The pair of a draw, of another radius.
    ///
    /// # Errors
    ///
    /// [`SceneError`] for a radius that the model cannot take.
    pub fn pair_of(&self, row: usize, radius_m: f64) -> Result<PairScene, SceneError> {
        let phi = self.value(ParameterName::Phi, row).unwrap_or(self.pair.final_contact_ratio);
        PairSpec::new(Powder { radius_m, ..self.pair.powder }, phi).build()
    }
}

/// The next pair of a population.
fn next_pair(path: &Path, population: &PopulationRecord) -> Result<PairPlan, InputError> {
    let next = population.next.as_ref().map(|next| next.pair.clone());
    next.ok_or_else(|| {
        InputError::new(path.display().to_string(), Mistake::Conflict)
            .found("a population of runs that are not of one pair of particles each")
            .expected("a population of pairs: calibrate population results/pa12-r32 ...")
    })
}
