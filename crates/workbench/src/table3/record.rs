//! `table3.json`: the regenerated table as data.

use dem_core::{Kinetics, Sintering, printed};
use serde::Serialize;
use smc_calib::{Posterior, SimError};

use super::calibrated::Calibrated;
use super::readings::{self, Reading};
use super::statements::{self, Statement};
use super::unfitted::Unfitted;
use crate::error::{Failure, RunError};
use crate::pair::derived::{Estimate, estimate};
use crate::pair::frenkel_fit::best_tau_s_of;
use crate::pair::model::NeckGrowth;
use crate::plan::Plan;
use crate::record::{FitError, Pair};

/// Layout of `table3.json`.
pub(crate) const SCHEMA_VERSION: u32 = 1;

/// `table3.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of the layout.
    pub schema_version: u32,
    /// Everything that decides the result.
    pub plan: ReportPlan,
    /// One entry per material.
    pub materials: Vec<MaterialReport>,
    /// The paper's statements of section 4.
    pub statements: Vec<Statement>,
    /// Ways to read Table 3.
    pub readings: Vec<Reading>,
    /// The check that was not fitted.
    pub unfitted: Unfitted,
}

/// Everything that decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReportPlan {
    /// Simulations per calibration.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// The plan of each material.
    pub materials: Vec<Plan>,
}

/// One material.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialReport {
    /// Name.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Radius R of the model \[m\].
    pub radius_m: f64,
    /// The table: C1, tau_s, delta_c as printed, then in SI.
    pub rows: Vec<Row>,
    /// Errors of several curves.
    pub fits: Vec<NamedFit>,
    /// Median of the noise standard deviation.
    pub sigma: Option<f64>,
    /// Log evidence and its standard error.
    pub log_evidence: [f64; 2],
    /// Effective sample size.
    pub ess: f64,
    /// Pareto shape of the weights.
    pub khat: f64,
    /// Whether the sampler has converged.
    pub converged: bool,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

/// The two forms of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// As printed in Table 3.
    Printed,
    /// In SI, in the form of eqs. 3 to 5.
    Si,
}

/// One line of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// `c1`, `tau_s` or `delta_c`.
    pub parameter: String,
    /// Its form.
    pub form: Form,
    /// Unit.
    pub unit: String,
    /// The paper's value in this form.
    pub paper: f64,
    /// Our maximum a posteriori.
    pub map: f64,
    /// Median, interval and Monte Carlo errors of log10 of the value.
    pub log10: Estimate,
    /// Posterior probability of a value below the paper's \[%\].
    pub paper_percentile: f64,
    /// Information gained on the parameter \[bits\]; none in the printed form, whose C1 mixes two parameters.
    pub information_gain_bits: Option<f64>,
}

impl Row {
    /// Posterior median.
    pub fn median(&self) -> f64 {
        10f64.powf(self.log10.median)
    }

    /// 95 % interval.
    pub fn eti95(&self) -> [f64; 2] {
        self.log10.eti95.map(|end| 10f64.powf(end))
    }
}

/// A curve and its errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedFit {
    /// Name of the curve.
    pub curve: String,
    /// How many numbers were fitted to these data; none for a mean over many curves.
    pub fitted: Option<usize>,
    /// Its errors.
    pub error: FitError,
}

/// Names of the curves, in order.
pub(crate) const CURVES: [&str; 6] = [
    "three-stage, paper's parameters",
    "three-stage, our MAP",
    "three-stage, our posterior mean",
    "Frenkel, best tau_s",
    "Pokluda, best tau_s",
    "Frenkel, paper's tau_s",
];

impl Report {
    /// From calibrated materials.
    pub fn new(
        samples: usize,
        seed: u64,
        calibrated: &[Calibrated],
        unfitted: Unfitted,
    ) -> Result<Self, Failure> {
        Ok(Self {
            schema_version: SCHEMA_VERSION,
            plan: ReportPlan {
                samples,
                seed,
                materials: calibrated
                    .iter()
                    .map(|one| one.calibration.record.plan.clone())
                    .collect(),
            },
            materials: calibrated.iter().map(material).collect::<Result<_, _>>()?,
            statements: statements::all(calibrated)?,
            readings: readings::all()?,
            unfitted,
        })
    }
}

fn material(one: &Calibrated) -> Result<MaterialReport, Failure> {
    let record = &one.calibration.record;
    let pair = record.pair()?;
    let model = NeckGrowth::of(&record.plan)?;
    Ok(MaterialReport {
        name: one.material.name().to_owned(),
        title: one.material.title().to_owned(),
        radius_m: pair.plan.powder.radius_m,
        rows: rows(one, &model, pair.plan.powder.radius_m)?,
        fits: fits(one, pair, &model).map_err(|error| RunError::new(error.to_string()))?,
        sigma: pair.found.sigma.map(|sigma| sigma.median),
        log_evidence: [record.log_evidence.value, record.log_evidence.se],
        ess: record.ess.importance,
        khat: record.khat,
        converged: record.trust.converged(),
        advice: record.advice.clone(),
    })
}

fn triple(sintering: &Sintering) -> [f64; 3] {
    [sintering.c1, sintering.tau_s, sintering.delta_c]
}

fn rows(one: &Calibrated, model: &NeckGrowth, radius_m: f64) -> Result<Vec<Row>, Failure> {
    let posterior: &Posterior = &one.calibration.posterior;
    let printed = |sintering: &Sintering| {
        let printed = printed::to_printed(sintering, radius_m);
        [printed.c1, printed.tau_s, printed.delta_c]
    };
    let paper_si = one.material.table3_sintering();
    let map = model.sintering(&posterior.map.theta);
    let mut rows = Vec::new();
    for form in [Form::Printed, Form::Si] {
        let of = |sintering: &Sintering| match form {
            Form::Printed => printed(sintering),
            Form::Si => triple(sintering),
        };
        let units = match form {
            Form::Printed => ["1/(Pa s m)", "s m", "m"],
            Form::Si => ["1/(Pa s)", "s", "m"],
        };
        let (paper, map) = (of(&paper_si), of(&map));
        for (place, name) in ["c1", "tau_s", "delta_c"].into_iter().enumerate() {
            let log10 = |theta: &[f64]| Some(of(&model.sintering(theta))[place].log10());
            let (estimate, marginal) = estimate(posterior, log10)
                .ok_or_else(|| RunError::new("the posterior has no samples"))?;
            let gain = posterior
                .parameters
                .iter()
                .find(|summary| summary.parameter.name == name)
                .map(|summary| summary.information_gain_bits);
            rows.push(Row {
                parameter: name.to_owned(),
                form,
                unit: units[place].to_owned(),
                paper: paper[place],
                map: map[place],
                paper_percentile: 100.0 * marginal.share_below(paper[place].log10()),
                log10: estimate,
                information_gain_bits: if form == Form::Si { gain } else { None },
            });
        }
    }
    Ok(rows)
}

fn fits(one: &Calibrated, pair: Pair<'_>, model: &NeckGrowth) -> Result<Vec<NamedFit>, SimError> {
    let (observed, fit) = (&pair.measured.values, &pair.neck_growth.fit);
    let one_parameter = |kinetics: Kinetics, tau_s: f64| -> Result<FitError, SimError> {
        let mut curve = vec![0.0; observed.len()];
        let sintering = Sintering { c1: 1.0, tau_s, delta_c: 1.0, lambda: 0.0 };
        model.with_kinetics(kinetics).curve(&sintering, &mut curve)?;
        Ok(FitError::of(observed, &curve))
    };
    let frenkel = fit.frenkel.ok_or_else(|| {
        SimError::recoverable("no observation after t = 0 to fit Frenkel's curve to")
    })?;
    let pokluda = best_tau_s_of(Kinetics::Pokluda, model, observed)?;
    let mut paper = vec![0.0; observed.len()];
    model.curve(&one.material.table3_sintering(), &mut paper)?;
    let errors = [
        (Some(3), FitError::of(observed, &paper)),
        (Some(3), fit.map),
        (None, fit.posterior_mean),
        (Some(1), frenkel),
        (Some(1), one_parameter(Kinetics::Pokluda, pokluda)?),
        (Some(1), one_parameter(Kinetics::Frenkel, one.material.table3_sintering().tau_s)?),
    ];
    Ok(CURVES
        .into_iter()
        .zip(errors)
        .map(|(curve, (fitted, error))| NamedFit { curve: curve.to_owned(), fitted, error })
        .collect())
}

impl MaterialReport {
    /// The errors of a curve of `CURVES`.
    pub fn fit(&self, curve: &str) -> Option<&FitError> {
        self.fits.iter().find(|fit| fit.curve == curve).map(|fit| &fit.error)
    }
}
