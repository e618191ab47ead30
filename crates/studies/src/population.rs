//! Does a population of pairs predict the next one better than pooling them, or than their own posteriors side by side?
//!
//! Each of the four PA12 pairs is left out in turn. The log score is the log of the probability density that three pairs give all
//! measurements of the fourth: of pooling (one parameter vector for all) and of the equal mixture of the three posteriors it is a
//! difference of evidences of joint calibrations, of the population the mean of the fourth's likelihood over its posterior.

use std::path::Path;

use smc_calib::{Noise, Posterior, Simulator as _, Weighted};
use workbench::calibration::{Calibration, RunOptions, run as calibrate};
use workbench::error::{Failure, RunError};
use workbench::input::experiment::BUILT_IN_NAMES;
use workbench::pair::model::NeckGrowth;
use workbench::plan::{PairOptions, Plan, Planned, SimulatorPlan};
use workbench::population::{PopulationJob, PopulationOptions};
use workbench::watch::Unwatched;

use crate::report::{Report, Table};

const TEXT: &str = "\
Four pairs of virgin PA12, each left out in turn and predicted from the other three: by their population (calibrate population, default hyperpriors), by pooling
(one joint posterior of the three, tau_s in proportion to R), and by the equal mixture of their own posteriors. Log score: log density that the prediction gives all 30 rows of
the pair left out, of pooling and mixture as differences of evidences, of the population the mean of its likelihood over the posterior; larger is better. Inside: share of the rows after time 0 within the 90 % band of a
new measurement, curve and noise, the noise as large as for the pairs predicted from. Width: mean width of that band in a/R. Curve: the same of the band of the curve alone, which cannot exceed the final contact ratio of 2^(1/3), as late rows do.
";

/// Draws of a band.
const DRAWS: usize = 2048;

/// What one prediction gives the pair that was left out.
struct Scored {
    log_score: f64,
    /// Rows inside the band, and its mean width: of measurements, of the curve.
    bands: [(usize, f64); 2],
}

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "population")?;
    let mut table = Table::new(&[
        "errors",
        "left out",
        "prediction",
        "log score",
        "rows",
        "inside",
        "width",
        "curve inside",
        "curve width",
    ]);
    let mut text = TEXT.to_owned();
    for noise in [Noise::default(), Noise::correlated()] {
        let pairs = Pairs::new(&noise)?;
        let mut sums = [(0.0, [(0, 0.0); 2]); 3];
        for left_out in 0..pairs.plans.len() {
            let found = pairs.left_out(left_out)?;
            for (place, (name, scored)) in NAMES.iter().zip(&found).enumerate() {
                table.push(row(noise.kind(), &pairs.names[left_out], name, scored, 29));
                sums[place].0 += scored.log_score;
                for (sum, (inside, width)) in sums[place].1.iter_mut().zip(scored.bands) {
                    sum.0 += inside;
                    sum.1 += width / pairs.plans.len() as f64;
                }
            }
        }
        for (name, (log_score, bands)) in NAMES.iter().zip(sums) {
            let rows = 29 * pairs.plans.len();
            table.push(row(noise.kind(), "all", name, &Scored { log_score, bands }, rows));
        }
    }
    report.table(&table)?;
    text.push('\n');
    text.push_str(&table.markdown());
    report.page("Populations of pairs", &text)?;
    Ok(())
}

const NAMES: [&str; 3] = ["population", "pooled", "mixture"];

fn row(noise: &str, left_out: &str, name: &str, scored: &Scored, rows: usize) -> Vec<String> {
    let [measured, curve] = scored.bands;
    let share = |inside: usize| format!("{:.0} %", 100.0 * inside as f64 / rows as f64);
    vec![
        noise.to_owned(),
        left_out.to_owned(),
        name.to_owned(),
        format!("{:.1}", scored.log_score),
        rows.to_string(),
        share(measured.0),
        format!("{:.3}", measured.1),
        share(curve.0),
        format!("{:.3}", curve.1),
    ]
}

/// The four pairs, each calibrated by itself in a folder.
struct Pairs {
    names: Vec<String>,
    plans: Vec<Planned>,
    folder: tempfile::TempDir,
}

impl Pairs {
    fn new(noise: &Noise) -> Result<Self, Failure> {
        let names: Vec<String> = BUILT_IN_NAMES
            .iter()
            .filter(|name| name.starts_with("pa12-"))
            .map(|name| (*name).to_owned())
            .collect();
        let folder = tempfile::tempdir().map_err(RunError::new)?;
        let mut plans = Vec::new();
        for name in &names {
            let options = PairOptions {
                experiment: Some(name.into()),
                noise: noise.clone(),
                ..PairOptions::default()
            };
            let planned = options.plan()?;
            let options = RunOptions {
                out: Some(folder.path().join(name)),
                without_other_kinetics: true,
                ..RunOptions::default()
            };
            calibrate(&planned, &options, &Unwatched::default())?;
            plans.push(planned);
        }
        Ok(Self { names, plans, folder })
    }

    /// One joint calibration of some pairs, tau_s belonging to the radius of the pair `of`.
    fn joint(&self, places: &[usize], of: usize) -> Result<Calibration, Failure> {
        let radius_m = self.plans[of].plan.pair()?.0.powder.radius_m;
        let experiments = places.iter().map(|place| {
            let mut experiment = self.plans[*place].plan.experiments[0].clone();
            experiment.name = format!("pair-{place}");
            if let SimulatorPlan::Builtin(pair) = &mut experiment.simulator {
                pair.tau_s_radius_m = Some(radius_m);
            }
            experiment
        });
        let plan = Plan { experiments: experiments.collect(), ..self.plans[of].plan.clone() };
        Calibration::run(&Planned { plan, ..self.plans[of].clone() }, &Unwatched::default())
    }

    fn ln_evidence(&self, places: &[usize], of: usize) -> Result<f64, Failure> {
        Ok(self.joint(places, of)?.record.log_evidence.value)
    }

    /// The three predictions of a pair from the others.
    fn left_out(&self, one: usize) -> Result<[Scored; 3], Failure> {
        let others: Vec<usize> = (0..self.plans.len()).filter(|place| *place != one).collect();
        let radius_m = self.plans[one].plan.pair()?.0.powder.radius_m;
        let job = |places: &[usize]| {
            let runs = places.iter().map(|place| self.folder.path().join(&self.names[*place]));
            let radius_m = Some(radius_m);
            PopulationJob::read(&PopulationOptions {
                runs: runs.collect(),
                radius_m,
                ..PopulationOptions::default()
            })
        };
        let population = job(&others)?.run(&Unwatched::default())?.posterior;
        let whole: Vec<usize> = others.iter().copied().chain([one]).collect();
        let all = job(&whole)?;
        let member = all.problem().members.last().ok_or_else(|| RunError::new("no members"))?;
        let next = &population.next;
        let of_population = drawn(next);
        let pooled = self.joint(&others, one)?;
        let mut mixture = Vec::new();
        let mut each = Vec::new();
        for other in &others {
            let alone = self.joint(&[*other], one)?;
            each.push(self.ln_evidence(&[*other, one], one)? - alone.record.log_evidence.value);
            mixture.extend(drawn(&alone.posterior));
        }
        let most = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = each.iter().map(|ln| (ln - most).exp()).sum::<f64>() / each.len() as f64;
        let pooled_score = self.ln_evidence(&whole, one)? - pooled.record.log_evidence.value;
        let scored = |log_score: f64, draws: &[Draw]| self.scored(one, log_score, draws);
        Ok([
            scored(population.ln_predictive(member), &of_population)?,
            scored(pooled_score, &drawn(&pooled.posterior))?,
            scored(most + mean.ln(), &mixture)?,
        ])
    }

    /// Rows of a pair within the 90 % band of the curves of some draws at its radius.
    fn scored(&self, one: usize, log_score: f64, draws: &[Draw]) -> Result<Scored, Failure> {
        let plan = &self.plans[one].plan;
        let measured = plan.pair()?.1;
        let model = NeckGrowth::of(plan)?;
        let kept = draws.len().min(DRAWS);
        let mut columns = vec![[const { Vec::new() }; 2]; measured.values.len()];
        let mut curve = vec![0.0; measured.values.len()];
        for k in 0..kept {
            let draw = &draws[k * draws.len() / kept];
            if model.simulate(&draw.theta, &mut curve).is_ok() {
                let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
                let error = draw.sigma * smc_calib::normal::quantile(u);
                for ([with_noise, alone], value) in columns.iter_mut().zip(&curve) {
                    with_noise.push(value + error);
                    alone.push(*value);
                }
            }
        }
        let mut scored = Scored { log_score, bands: [(0, 0.0); 2] };
        // At time 0 every curve begins.
        let rows = measured.control.iter().zip(&measured.values).zip(columns);
        for ((_, value), columns) in rows.filter(|((time, _), _)| **time > 0.0) {
            for (band, column) in scored.bands.iter_mut().zip(columns) {
                let [lower, upper] = Weighted::equal(column).interval(0.9);
                band.0 += usize::from((lower..=upper).contains(value));
                band.1 += (upper - lower) / 29.0;
            }
        }
        Ok(scored)
    }
}

/// A parameter vector with a noise standard deviation.
struct Draw {
    theta: Vec<f64>,
    sigma: f64,
}

/// The draws of a posterior; with several experiments the noise is that of each in its turn.
fn drawn(posterior: &Posterior) -> Vec<Draw> {
    let of = |(k, draw): (usize, &smc_calib::Draw)| {
        let groups = &posterior.groups;
        let of_group = groups.get(k % groups.len().max(1)).and_then(|group| group.noise_draw(k));
        let sigma = of_group.map(|noise| noise.sigma).or(draw.sigma).unwrap_or(0.0);
        Draw { theta: posterior.theta(draw).to_vec(), sigma }
    };
    posterior.draws.iter().enumerate().map(of).collect()
}
