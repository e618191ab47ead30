//! Populations: what several calibrations of the same parameters say of how these differ from member to member.
//!
//! Two stages. Each member was calibrated by itself; its samples give the likelihood of a population, a multivariate normal in
//! the coordinates of the parameters ([`Member`]). The posterior of mean, spread and correlation of the population is then
//! sampled as any other density, under a [`Hyperprior`], and with it the distribution of the *next* member, of which nothing is
//! measured yet.
//!
//! ```
//! use smc_calib::population::{Hyperprior, Member, MemberSamples, PopulationProblem, calibrate_population};
//! use smc_calib::{Coordinate, Settings};
//!
//! // Three members, each known to 0.1 by 400 equally spaced quantiles of a normal; the priors were flat over (-5, 5).
//! let members = [0.8, 1.0, 1.4].map(|centre| {
//!     let scores: Vec<f64> = (0..400).map(|i| smc_calib::normal::quantile((f64::from(i) + 0.5) / 400.0)).collect();
//!     let samples = MemberSamples {
//!         name: format!("around {centre}"),
//!         coordinates: scores.iter().map(|z| centre + 0.1 * z).collect(),
//!         ln_prior: vec![0.1f64.ln(); 400],
//!         ln_likelihood: scores.iter().map(|z| -0.5 * z * z).collect(),
//!         weights: vec![1.0; 400],
//!         log_evidence: (0.1 * 0.1 * (2.0 * std::f64::consts::PI).sqrt()).ln(),
//!         support: vec![[-5.0, 5.0]],
//!     };
//!     Member::new(&samples, 1)
//! });
//! let problem = PopulationProblem {
//!     parameters: vec![("x".into(), "1".into(), Coordinate::Linear)],
//!     hyperprior: Hyperprior { mean: vec![[-5.0, 5.0]], spread: vec![0.3], correlation: None },
//!     members: members.into_iter().collect::<Result<_, _>>()?,
//! };
//! let found = calibrate_population(&problem, &Settings { samples: 4096, ..Settings::default() }, &mut ())?;
//! let next = &found.next.parameters[0].in_si;
//! assert!((next.median - 1.07).abs() < 0.1);
//! // The next member is known far less well than each of the three.
//! assert!(next.sd > 0.2);
//! # Ok::<(), smc_calib::CalibrateError>(())
//! ```

mod hyperprior;
mod member;
#[cfg(test)]
mod tests;

pub use hyperprior::{Hyperprior, Population};
pub use member::{FEW_EFFECTIVE, Member, MemberLikelihood, MemberSamples};

use crate::calibrate::{final_weights, stage_record};
use crate::control::estimate;
use crate::draws::chosen;
use crate::estimate::Estimator;
use crate::marginal::Marginal;
use crate::marginal::correlation;
use crate::pool::effective_sample_size;
use crate::sampler::Sampler;
use crate::sobol::evenly;
use crate::stage::{Finishing, Observer};
use crate::stream::{Purpose, stream};
use crate::summary::{Columns, of_size, parameter_summary};
use crate::trust::Tail;
use crate::{
    CalibrateError, Concern, Coordinate, Draw, MapPoint, Moments, Noise, Parameter, Posterior,
    Residuals, Sample, Settings, SimError, StageRecord, StopReason, Target, Trust, Weighted,
    normal,
};
use rand::RngExt;
use rayon::prelude::*;

/// Most populations that the members' own parameters are averaged over.
const MOST_SHRUNK: usize = 512;

/// A population to be inferred.
#[derive(Clone, Debug)]
pub struct PopulationProblem {
    /// Name, unit and coordinate of each parameter.
    pub parameters: Vec<(String, String, Coordinate)>,
    /// What is assumed beforehand.
    pub hyperprior: Hyperprior,
    /// The members.
    pub members: Vec<Member>,
}

/// A posterior of a population.
#[derive(Clone, Debug, PartialEq)]
pub struct PopulationPosterior {
    /// The next member as a posterior like any other: its samples, draws and parameters. There is nothing measured of it, so
    /// what belongs to measurements is empty; its MAP is the mean of the most probable population. The priors of its parameters are
    /// normals with the moments that the hyperprior gives the next member.
    pub next: Posterior,
    /// Mean of each parameter over the population, in its coordinate.
    pub mean: Vec<Moments>,
    /// Standard deviation of each parameter between members.
    pub spread: Vec<Moments>,
    /// Correlations below the diagonal, row by row; empty where parameters are taken as independent.
    pub correlation: Vec<Moments>,
    /// The members.
    pub members: Vec<MemberSummary>,
    /// The population of each draw, in the order of the draws of [`next`](Self::next).
    pub draws: Vec<Population>,
}

/// What a population says of one of its members, and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct MemberSummary {
    /// Name.
    pub name: String,
    /// Effective number of own samples behind the likelihood: median over the posterior of the population.
    pub effective: f64,
    /// The same: 5 % of the posterior have fewer.
    pub effective_least: f64,
    /// Share of the posterior in which a fitted density stood in for too few samples.
    pub fitted: f64,
    /// Share of the population beyond the support of the member's prior, parameter by parameter: mean over the posterior.
    pub outside: Vec<f64>,
    /// Its parameters by its likelihood alone, in their coordinates.
    pub alone: Vec<Weighted>,
    /// Its parameters as a member of the population.
    pub shrunk: Vec<Weighted>,
}

/// The posterior of a population as a density over normal scores.
struct HyperTarget<'a> {
    problem: &'a PopulationProblem,
}

impl Target for HyperTarget<'_> {
    fn dimension(&self) -> usize {
        self.problem.hyperprior.dimension()
    }

    /// Effective number of each member, and whether its density is the fitted one.
    fn kept(&self) -> usize {
        2 * self.problem.members.len()
    }

    fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
        let population = self.problem.hyperprior.population(z);
        let mut sum = 0.0;
        for (member, kept) in self.problem.members.iter().zip(kept.chunks_exact_mut(2)) {
            let found = member.ln_likelihood(&population);
            kept[0] = found.effective;
            kept[1] = f64::from(found.fitted);
            sum += found.ln;
        }
        Ok(sum)
    }
}

/// Infers a population from its members.
///
/// # Errors
/// [`CalibrateError`] for no members, parts that do not fit together, settings outside their range, or zero evidence.
pub fn calibrate_population(
    problem: &PopulationProblem,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<PopulationPosterior, CalibrateError> {
    check(problem, settings)?;
    let settings = &Settings { surrogate: false, ..settings.clone() };
    let target = HyperTarget { problem };
    let mut sampler = Sampler::new(&target, settings);
    let coordinate = |j: usize, z: f64| problem.hyperprior.coordinate(j, z);
    let mut stages: Vec<StageRecord> = Vec::new();
    loop {
        sampler.place(&mut Sampler::next);
        let Some(last) = sampler.take().map_err(|error| error.after(&stages))? else { break };
        stages.push(stage_record(&sampler, &coordinate, None, last).record);
        if observer.stage(&stages[stages.len() - 1]).is_break() {
            return Err(CalibrateError::Interrupted { stages });
        }
    }
    let (raw, ln_scale) = final_weights(&sampler, None);
    if ln_scale == f64::NEG_INFINITY {
        return Err(CalibrateError::ZeroEvidence { simulations: sampler.pool.len() });
    }
    let (estimator, log_evidence, _) =
        estimate(&sampler, &raw, ln_scale, &coordinate, &mut Finishing(observer));
    let found = Found { problem, sampler: &sampler, estimator: &estimator, raw: &raw };
    let drawn = chosen(&estimator, settings);
    let draws: Vec<Population> = drawn.iter().map(|i| found.population(*i)).collect();
    let moments = |range: std::ops::Range<usize>| -> Vec<Moments> {
        range.into_par_iter().map(|j| found.moments(|population| of_place(population, j))).collect()
    };
    let d = problem.hyperprior.parameters();
    let next = found.next(&drawn, (log_evidence, ln_scale), stages)?;
    Ok(PopulationPosterior {
        mean: moments(0..d),
        spread: moments(d..2 * d),
        correlation: moments(2 * d..problem.hyperprior.dimension()),
        members: found.members(&draws),
        next,
        draws,
    })
}

/// Number `j` of means, spreads and correlations.
fn of_place(population: &Population, j: usize) -> f64 {
    let d = population.mean.len();
    match j {
        j if j < d => population.mean[j],
        j if j < 2 * d => population.spread[j - d],
        j => population.correlation[j - 2 * d],
    }
}

/// Refuses parts that do not fit together.
fn check(problem: &PopulationProblem, settings: &Settings) -> Result<(), CalibrateError> {
    problem.hyperprior.check()?;
    settings.check(problem.hyperprior.dimension())?;
    let d = problem.hyperprior.parameters();
    let refused = |member: &str, problem: String| {
        Err(CalibrateError::Member { member: member.to_owned(), problem })
    };
    if problem.members.is_empty() || problem.parameters.len() != d {
        return refused("", "there must be a member, and a name for each parameter".to_owned());
    }
    if let Some(member) = problem.members.iter().find(|member| member.parameters() != d) {
        return refused(&member.name, format!("{} parameters, not {d}", member.parameters()));
    }
    let surrogate = settings.surrogate && settings.samples < Settings::PLAIN;
    if surrogate || !settings.earlier.is_empty() || settings.first_proposal.is_some() {
        return refused("", "a population is sampled afresh, without a surrogate".to_owned());
    }
    Ok(())
}

/// A sampled population.
struct Found<'a> {
    problem: &'a PopulationProblem,
    sampler: &'a Sampler<'a>,
    estimator: &'a Estimator,
    raw: &'a [f64],
}

impl Found<'_> {
    fn len(&self) -> usize {
        self.sampler.pool.len()
    }

    fn population(&self, i: usize) -> Population {
        self.problem.hyperprior.population(self.sampler.pool.point(i))
    }

    /// A number of every sample with weight.
    fn column(&self, of: impl Fn(&Population) -> f64 + Sync) -> Vec<f64> {
        let weights = &self.estimator.weights;
        let one = |i: usize| if weights[i] != 0.0 { of(&self.population(i)) } else { 0.0 };
        (0..self.len()).into_par_iter().with_min_len(256).map(one).collect()
    }

    fn moments(&self, of: impl Fn(&Population) -> f64 + Sync) -> Moments {
        Marginal::new(&self.column(of), self.estimator).moments()
    }

    /// What the population says of each member; `draws` are populations of equal weight.
    fn members(&self, draws: &[Population]) -> Vec<MemberSummary> {
        let (pool, weights) = (&self.sampler.pool, &self.estimator.weights);
        let kept = draws.len().min(MOST_SHRUNK);
        let some: Vec<Population> = evenly(draws.len(), kept).map(|k| draws[k].clone()).collect();
        let of = |(m, member): (usize, &Member)| {
            let kept = |i: usize, what: usize| pool.kept[i * pool.kept_width + 2 * m + what];
            let own = (0..self.len()).map(|i| (kept(i, 0), weights[i].max(0.0)));
            let effective = Weighted::new(own);
            let mut outside = vec![0.0; member.parameters()];
            for one in &some {
                for (sum, beyond) in outside.iter_mut().zip(member.outside(one)) {
                    *sum += beyond;
                }
            }
            let [alone, shrunk] = member.shrunk(&some);
            MemberSummary {
                name: member.name.clone(),
                effective: effective.quantile(0.5),
                effective_least: effective.quantile(0.05),
                fitted: self.estimator.mean(|i| kept(i, 1)).clamp(0.0, 1.0),
                outside: outside.iter().map(|sum| sum / some.len().max(1) as f64).collect(),
                alone,
                shrunk,
            }
        };
        self.problem.members.par_iter().enumerate().map(of).collect()
    }

    /// The next member of each sampled population, in the coordinates, parameter by parameter.
    fn next_members(&self) -> Vec<Vec<f64>> {
        let d = self.problem.hyperprior.parameters();
        let seed = self.sampler.settings.seed;
        let rows: Vec<Vec<f64>> = (0..self.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let mut rng = stream(seed, Purpose::NextMember, 0, i);
                let normals: Vec<f64> = (0..d)
                    .map(|_| normal::quantile(rng.random::<f64>().max(f64::MIN_POSITIVE)))
                    .collect();
                self.population(i).member(&normals)
            })
            .collect();
        (0..d).map(|j| rows.iter().map(|row| row[j]).collect()).collect()
    }

    /// The next member as a posterior.
    fn next(
        &self,
        drawn: &[usize],
        (log_evidence, ln_scale): (crate::Evidence, f64),
        stages: Vec<StageRecord>,
    ) -> Result<Posterior, CalibrateError> {
        let (pool, estimator) = (&self.sampler.pool, self.estimator);
        let coordinate = self.next_members();
        let parameters = self.next_parameters()?;
        let each = || parameters.iter().zip(&coordinate);
        let columns = |of: &(dyn Fn(&Parameter, f64) -> f64 + Sync)| -> Vec<Vec<f64>> {
            each().map(|(p, x)| x.iter().map(|x| of(p, *x)).collect()).collect()
        };
        let theta = columns(&|p, x| p.prior.coordinate().theta(x));
        let z = columns(&|p, x| (x - p.prior.mean()) / p.prior.sd());
        let of_weights = Tail::of(self.raw);
        let judged = estimator.judged(self.raw);
        let best = self.best();
        let centre = self.population(best).mean;
        let mut summaries: Vec<_> = (0..parameters.len())
            .into_par_iter()
            .map(|j| {
                let of =
                    Columns { z: &z[j], theta: &theta[j], coordinate: &coordinate[j], below: None };
                parameter_summary(&parameters[j], &of, (judged, of_weights), estimator)
            })
            .collect();
        for (summary, centre) in summaries.iter_mut().zip(&centre) {
            summary.map = summary.coordinate.theta(*centre);
        }
        let row = |columns: &[Vec<f64>], i: usize| columns.iter().map(|column| column[i]).collect();
        let sample = |i: usize| Sample {
            z: row(&z, i),
            theta: row(&theta, i),
            log_likelihood: Some(pool.ln_l[i]).filter(|l| l.is_finite()),
            log_weight: Some(ln_scale + self.raw[i].ln()).filter(|l| l.is_finite()),
            weight: estimator.weights[i] / estimator.total,
            moved: Vec::new(),
            stage: pool.stage[i] as usize,
            replicate: pool.replicate[i] as usize,
        };
        Ok(Posterior {
            is_posterior: true,
            noise: Noise::default(),
            settings: self.sampler.settings.clone(),
            samples: (0..self.len()).map(sample).collect(),
            draws: drawn.iter().map(|i| Draw::of_sample(*i)).collect(),
            correlation: correlation(&coordinate, estimator),
            correlation_si: correlation(&theta, estimator),
            log_evidence,
            ess: of_size(effective_sample_size(self.raw), self.len()),
            khat: summaries.iter().map(|p| p.khat).fold(of_weights.khat, f64::max),
            map: MapPoint {
                theta: summaries.iter().map(|summary| summary.map).collect(),
                log_likelihood: pool.ln_l[best],
                log_density: pool.ln_l[best] + pool.ln_prior(best),
                outputs: Vec::new(),
                simulations: 0,
            },
            parameters: summaries,
            sigma: None,
            noise_shape: None,
            residuals: Residuals { independent: true, ..Residuals::default() },
            predictive: Vec::new(),
            path: Vec::new(),
            stages,
            failures: pool.failures(),
            failing: None,
            moved: None,
            stop: StopReason::BudgetSpent,
            counters: self.sampler.counters,
            groups: Vec::new(),
        })
    }

    /// The parameters of the next member.
    fn next_parameters(&self) -> Result<Vec<Parameter>, CalibrateError> {
        let problem = self.problem;
        let named = problem.parameters.iter().enumerate();
        named
            .map(|(j, (name, unit, coordinate))| {
                let prior = problem.hyperprior.of_next(j, *coordinate).map_err(|error| {
                    CalibrateError::Member { member: name.clone(), problem: error.to_string() }
                })?;
                Ok(Parameter::new(name, unit, prior))
            })
            .collect()
    }

    /// The sample of highest density in the normal scores.
    fn best(&self) -> usize {
        let pool = &self.sampler.pool;
        let density = |i: &usize| pool.ln_l[*i] + pool.ln_prior(*i);
        (0..self.len()).max_by(|a, b| density(a).total_cmp(&density(b))).unwrap_or(0)
    }
}

impl PopulationPosterior {
    /// Judges the result. There are no observations of a next member, so none can be too few.
    pub fn trust(&self) -> Trust {
        let mut trust = self.next.trust();
        trust.concerns.retain(|concern| !matches!(concern, Concern::FewObservations { .. }));
        trust
    }

    /// Log of the probability density that this population gives the measurements of a member that it was not inferred from:
    /// the mean of its likelihood over the draws.
    pub fn ln_predictive(&self, member: &Member) -> f64 {
        let ln: Vec<f64> = self.draws.par_iter().map(|one| member.ln_likelihood(one).ln).collect();
        let most = ln.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = ln.iter().map(|ln| (ln - most).exp()).sum();
        most + (sum / ln.len() as f64).ln()
    }
}
