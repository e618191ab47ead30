//! A second look at a pair whose fit is suspicious: the same measurements calibrated once more with a free clock, or with
//! priors that are many decades wide. Only the plan's own simulator, in closed form, is run for it.

use smc_calib::{Concern, Parameter, Posterior, Prior, PriorSpec, Trust};

use super::of_pair::{OfPair, calibrated_alone};
use crate::pair::parameter::ParameterName;
use crate::plan::{PairPlan, prior_in_words, sampler_for};
use crate::record::{Doubt, Excluded, FitError};

/// Simulations of a second look: they place four parameters over many decades well enough for two digits of an interval,
/// in a fraction of the time of the calibration itself.
const SIMULATIONS: usize = 8192;

/// Share of the time to the knee before the first observation from which on the stage before the knee counts as unseen.
/// It is 0.27 on polystyrene, 0 on polyamide, 0.2 on PEEK.
const UNSEEN_SHARE: f64 = 0.8;

/// Log of how many times more probable the data must be with a free clock: twenty times, strong evidence (R.E. Kass,
/// A.E. Raftery, J. Am. Stat. Assoc. 90 (1995) 773), all of t0's own prior counted against it.
const CLOCK_GAIN: f64 = 3.0;

/// The same where the first observation comes later than the table is long: such a table is more likely to have a clock of
/// its own than to have missed the beginning, and need only be no less probable.
const LATE_CLOCK_GAIN: f64 = 0.0;

/// Log likelihood ratio that three parameters gain by chance once in a thousand times: half the 99.9 % quantile of
/// chi-squared with three degrees of freedom.
const PRIOR_GAIN: f64 = 8.1;

/// Tail area of a prior beyond which a value counts as excluded: that of three standard deviations.
const EXCLUDED_TAIL: f64 = 1.35e-3;

/// Decades by which a wide prior is wider than the user's, on either side: minutes or milliseconds for seconds, micrometres
/// for metres of a rate, and as much again for the rest.
const DECADES: i32 = 4;

/// How many times the root mean square residual of the best Frenkel curve that of the best sample may be, where it has
/// one parameter and no prior: a calibration with more parameters should be no worse.
const FRENKEL_RATIO: f64 = 2.0;

/// The posterior of the same measurements under other parameters.
struct Look {
    parameters: Vec<Parameter>,
    posterior: Posterior,
    rmse: f64,
}

impl OfPair<'_> {
    /// What of the clock and the priors is to be suspected; nothing where the result gives no reason to ask.
    pub(super) fn doubts(
        &self,
        trust: &Trust,
        found: FitError,
        frenkel: Option<FitError>,
    ) -> Vec<Doubt> {
        let alone = self.plan.experiments.len() == 1 && self.plan.design.is_none();
        if !alone
            || !self.posterior.is_posterior
            || self.measured.values.len() <= self.plan.parameters.len()
        {
            return Vec::new();
        }
        let poor = trust.concerns.iter().any(|c| matches!(c, Concern::PoorFit { .. }));
        let worse = frenkel.is_some_and(|frenkel| found.rmse > FRENKEL_RATIO * frenkel.rmse);
        let outside = trust.concerns.iter().any(|concern| {
            matches!(concern, Concern::AtPriorBound { .. } | Concern::FarInPriorTail { .. })
        });
        let has_t0 = self.model.place(ParameterName::T0).is_some();
        let clock = (!has_t0 && (poor || worse || self.unseen_before_the_knee()))
            .then(|| self.with_free_clock())
            .flatten();
        let wide = (poor || worse || outside).then(|| self.with_wide_priors()).flatten();
        let clock_doubt = clock.as_ref().and_then(|look| self.about_clock(look, found));
        let prior_doubt = wide.as_ref().and_then(|look| self.about_prior(look, found));
        let likelihood = |look: &Option<Look>| {
            look.as_ref().map_or(f64::NEG_INFINITY, |look| look.posterior.map.log_likelihood)
        };
        // Where both explain the data, the one that does so far better is named, else the clock: it is one number.
        match (clock_doubt, prior_doubt) {
            (Some(_), Some(prior)) if likelihood(&wide) > likelihood(&clock) + PRIOR_GAIN => {
                vec![prior]
            }
            (Some(doubt), _) | (None, Some(doubt)) => vec![doubt],
            (None, None) => Vec::new(),
        }
    }

    /// Whether the first observation comes so late that the best curve has its knee about there or before, although its
    /// time is counted from 0.
    fn unseen_before_the_knee(&self) -> bool {
        let theta = &self.posterior.map.theta;
        let first_s = self.measured.control.first().copied().unwrap_or_default();
        let Ok(scene) = self.model.scene(theta) else { return false };
        let knee = dem_core::knee(&scene, &self.model.sintering(theta));
        let heat = self.model.heat(theta).ok().flatten();
        let knee_s = heat.map_or(Some(knee.time_s), |heat| heat.time(knee.time_s));
        self.pair.kinetics.separates_c1_from_delta_c()
            && knee.has_zipping
            && first_s > 0.0
            && knee_s.is_some_and(|knee_s| first_s > UNSEEN_SHARE * knee_s)
    }

    /// The time of first contact, anywhere from one length of the table before its first row to its last row.
    fn free_clock(&self) -> Option<Parameter> {
        let (first, last) = (self.measured.control.first()?, self.measured.control.last()?);
        // One length of the table, or the whole time from 0 for a table of one instant.
        let length = if last > first { last - first } else { *last };
        let prior = Prior::new(PriorSpec::Uniform { lower: first - length, upper: *last }).ok()?;
        let name = self.pair.calibrated(ParameterName::T0);
        Some(Parameter::new(name, ParameterName::T0.unit(), prior))
    }

    fn with_free_clock(&self) -> Option<Look> {
        let mut parameters = self.plan.parameters.clone();
        parameters.push(self.free_clock()?);
        self.look(parameters)
    }

    /// The calibration with C1, tau_s and delta_c anywhere over many decades around their priors, and t0 anywhere
    /// where it is calibrated.
    fn with_wide_priors(&self) -> Option<Look> {
        let wide = |parameter: &Parameter| {
            let name = ParameterName::ALL
                .into_iter()
                .find(|name| self.pair.calibrated(*name) == parameter.name)?;
            match name {
                ParameterName::Phi => Some(parameter.clone()),
                ParameterName::T0 => self.free_clock(),
                name if name.is_of_heat() => Some(parameter.clone()),
                _ => wider(parameter),
            }
        };
        let parameters = self.plan.parameters.iter().map(wide).collect::<Option<Vec<_>>>()?;
        self.look(parameters)
    }

    fn look(&self, parameters: Vec<Parameter>) -> Option<Look> {
        let mut pair = PairPlan::clone(self.pair);
        pair.solver.name = dem_core::SolverKind::ClosedForm;
        let seed = self.plan.sampler.seed;
        let settings = smc_calib::Settings { seed, path: false, ..sampler_for(SIMULATIONS) };
        // A look that cannot be had is no reason for doubt.
        let posterior = calibrated_alone(&pair, &parameters, self.measured, &settings).ok()??;
        let rmse = FitError::of(&self.measured.values, &posterior.map.outputs).rmse;
        Some(Look { parameters, posterior, rmse })
    }

    fn about_clock(&self, look: &Look, found: FitError) -> Option<Doubt> {
        let t0 = &look.posterior.parameters.last()?.in_si;
        let log_gain = look.posterior.log_evidence.value - self.posterior.log_evidence.value;
        let (first_s, last_s) = (self.measured.control.first()?, self.measured.control.last()?);
        let late = *first_s > last_s - first_s && t0.eti95.lower > 0.0;
        let needed = if late { LATE_CLOCK_GAIN } else { CLOCK_GAIN };
        // A clock that leaves most rows before first contact explains nothing: the data do not grow.
        let control = &self.measured.control;
        let after = control.iter().filter(|time_s| **time_s > t0.median).count();
        let grows = 2 * after > control.len() && self.grows();
        (grows && log_gain > needed).then_some(Doubt::Clock {
            first_s: *first_s,
            t0_s: t0.median,
            eti95_s: [t0.eti95.lower, t0.eti95.upper],
            log_gain,
            rmse: [found.rmse, look.rmse],
        })
    }

    /// Whether the measured contact ratio grows from first to last: its first half lies below its second.
    fn grows(&self) -> bool {
        let values = &self.measured.values;
        let (first, second) = values.split_at(values.len() / 2);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        mean(first) < mean(second)
    }

    fn about_prior(&self, look: &Look, found: FitError) -> Option<Doubt> {
        let log_gain = look.posterior.map.log_likelihood - self.posterior.map.log_likelihood;
        if log_gain < PRIOR_GAIN {
            return None;
        }
        let places = 0..self.plan.parameters.len();
        let excluded: Vec<Excluded> = places
            .filter_map(|place| {
                let (own, asked) =
                    (&self.plan.parameters[place], &look.posterior.parameters[place]);
                let interval = &asked.in_si.eti95;
                let excluded = excludes(&own.prior, interval.lower, interval.upper)
                    && own.prior != look.parameters[place].prior;
                excluded.then(|| Excluded {
                    parameter: own.name.clone(),
                    unit: own.unit.clone(),
                    prior: prior_in_words(own.prior.spec()),
                    median: asked.in_si.median,
                    eti95: [interval.lower, interval.upper],
                })
            })
            .collect();
        (!excluded.is_empty()).then_some(Doubt::Prior {
            excluded,
            log_gain,
            rmse: [found.rmse, look.rmse],
        })
    }
}

/// Whether a whole interval lies in one tail of a prior.
fn excludes(prior: &Prior, lower: f64, upper: f64) -> bool {
    prior.tails(upper).below < EXCLUDED_TAIL || prior.tails(lower).above < EXCLUDED_TAIL
}

/// A positive parameter anywhere over many decades around its prior.
fn wider(parameter: &Parameter) -> Option<Parameter> {
    let [low, high] = [1e-3, 1.0 - 1e-3].map(|p| parameter.prior.quantile(p));
    // A prior that reaches down to zero has no first decade.
    let low = low.max(high * 10f64.powi(-DECADES));
    let spec = PriorSpec::LogUniform {
        lower: low * 10f64.powi(-DECADES),
        upper: high * 10f64.powi(DECADES),
    };
    let prior = Prior::new(spec).ok()?;
    Some(Parameter::new(parameter.name.clone(), parameter.unit.clone(), prior))
}
