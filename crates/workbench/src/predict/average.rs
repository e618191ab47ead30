//! The average of the models of a comparison, kinetics and noise, by their evidence.

use std::collections::BTreeMap;
use std::path::Path;

use dem_core::{Kinetics, PairSpec, Powder};
use serde::Serialize;
use smc_calib::Parameter;

use super::drawn::{Drawn, Predicted, Scatter};
use super::{Prediction, SinteringTime, Wanted, carried, freezing, predicted};
use crate::compare::{self, KeptModel, KeptModels};
use crate::error::{Failure, InputError, Mistake};
use crate::pair::asked_heat::{heat_of, outside_energies, refused};
use crate::pair::heat::HeatPlan;
use crate::pair::model::NeckGrowth;
use crate::pair::parameter::ParameterName;

/// Reasons to be careful with a model of less weight are not repeated.
const LEAST_WEIGHT: f64 = 0.01;

/// A model of an average.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AveragedModel {
    /// Its name where finished runs were compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explanation: Option<String>,
    /// Its kinetics.
    pub kinetics: Kinetics,
    /// Its noise.
    pub noise: String,
    /// Its share in the average: its probability among the models, each being as likely beforehand.
    pub weight: f64,
}

/// Predicts as [`predict`](super::predict()) with the average of the models of a comparison: `folder` is that of the
/// comparison, `name` the material or experiment where it holds several.
///
/// # Errors
///
/// [`Failure`] for a folder without a comparison or without this name, and as [`predict`](super::predict()).
pub fn predict_average(
    folder: &Path,
    name: Option<&str>,
    wanted: &Wanted,
) -> Result<Prediction, Failure> {
    let kept = compare::read_models(folder, name)?;
    average(&kept, wanted)
}

/// The average of kept models.
pub(crate) fn average(kept: &KeptModels, wanted: &Wanted) -> Result<Prediction, Failure> {
    wanted.checked()?;
    if wanted.enough.is_some() {
        return Err(InputError::new("--energy-for", Mistake::Conflict)
            .found("the average of several models")
            .expected("one posterior: --posterior")
            .into());
    }
    let weights =
        compare::weights(&kept.models.iter().map(|model| model.log_evidence).collect::<Vec<_>>());
    let mut drawn = Vec::new();
    let mut averaged = Vec::new();
    let mut advice: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut starts = Vec::new();
    let mut trusted = true;
    for (model, weight) in kept.models.iter().zip(weights) {
        let heat = heat_of(&model.pair, wanted.heat.as_ref(), wanted.pulse_energy)?;
        let own = draws_of(model, weight, wanted, heat.as_ref())?;
        if own.is_empty() {
            return Err(InputError::new(&kept.name, Mistake::Damaged)
                .found("a model without draws")
                .help("run the comparison again")
                .into());
        }
        starts.extend(first_contacts(model, weight));
        drawn.extend(own);
        let kinetics = model.pair.kinetics;
        if weight >= LEAST_WEIGHT {
            trusted &= model.trusted;
            let energy = heat.as_ref().and_then(HeatPlan::energy);
            let outside = energy.and_then(|e| outside_energies([&model.pair], e));
            for line in model.advice.iter().cloned().chain(outside) {
                let name = model.explanation.clone().unwrap_or_else(|| kinetics.to_string());
                advice.entry(line).or_default().push(format!("{name} with {}", model.noise));
            }
        }
        let (explanation, noise) = (model.explanation.clone(), model.noise.clone());
        averaged.push(AveragedModel { explanation, kinetics, noise, weight });
    }
    let Some(first) = kept.models.first() else {
        return Err(InputError::new(&kept.name, Mistake::Empty)
            .found("a comparison without models")
            .help("run the comparison again")
            .into());
    };
    let calibrated_radius_m = first.pair.powder.radius_m;
    let (sintering, after) = predicted(&drawn, wanted)?;
    let of_models =
        advice.into_iter().map(|(line, models)| format!("{}: {line}", models.join(", ")));
    let advice = of_models.chain(sintering.iter().filter_map(SinteringTime::few)).collect();
    Ok(Prediction {
        name: kept.name.clone(),
        title: kept.title.clone(),
        kinetics: None,
        averaged,
        left_out_models: kept.left_out,
        left_out_probability: kept.left_out_probability,
        radius_m: wanted.radius_m.unwrap_or(calibrated_radius_m),
        calibrated_radius_m,
        final_contact_ratio: first.pair.final_contact_ratio,
        trusted,
        first_contact_s: Predicted::of(starts),
        sintering,
        after,
        freezes: freezing(&drawn)?,
        enough: None,
        advice,
    })
}

/// The calibrated times of first contact of a model's draws with their weights, together `weight`.
fn first_contacts(model: &KeptModel, weight: f64) -> impl Iterator<Item = (f64, f64)> {
    let named = |one: &Parameter| one.name == model.pair.calibrated(ParameterName::T0);
    let starts = model.parameters.iter().position(named).and_then(|at| model.columns.get(at));
    let starts = starts.map_or(&[][..], |column| column);
    starts.iter().map(move |start| (*start, weight / starts.len() as f64))
}

/// The draws of a model at the wanted radius; together they weigh `weight`.
fn draws_of(
    model: &KeptModel,
    weight: f64,
    wanted: &Wanted,
    heat: Option<&HeatPlan>,
) -> Result<Vec<Drawn>, InputError> {
    let growth = NeckGrowth::new(&model.pair, &model.parameters, Vec::new())?;
    let count = model.columns.first().map_or(0, Vec::len);
    let calibrated = model.pair.powder.radius_m;
    let radius_m = wanted.radius_m.unwrap_or(calibrated);
    let damaged = || {
        InputError::new("models of the comparison", Mistake::Damaged)
            .found("columns of different lengths")
            .help("run the comparison again")
    };
    (0..count)
        .map(|row| {
            let theta: Option<Vec<f64>> =
                model.columns.iter().map(|column| column.get(row).copied()).collect();
            let theta = theta.ok_or_else(damaged)?;
            let phi = growth
                .place(ParameterName::Phi)
                .and_then(|place| theta.get(place).copied())
                .unwrap_or(model.pair.final_contact_ratio);
            let value = |name| growth.place(name).and_then(|place| theta.get(place).copied());
            let heat = heat.map(|heat| heat.at(radius_m, value)).transpose();
            let heat = heat.map_err(|error| refused("--heat", &error))?;
            let scene = PairSpec::new(Powder { radius_m, ..model.pair.powder }, phi).build();
            let sigma = model.sigma.as_ref().and_then(|sigma| sigma.get(row).copied());
            Ok(Drawn {
                scene: scene.map_err(carried)?,
                sintering: growth.sintering(&theta).at_radius(calibrated, radius_m),
                kinetics: model.pair.kinetics,
                weight: weight / count as f64,
                heat,
                scatter: sigma.map(|sigma| Scatter { sigma, outliers: model.outliers }),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::Compared;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::report::TimeScale;
    use crate::watch::Unwatched;
    use smc_calib::{Noise, Weighted};
    use std::sync::LazyLock;

    /// Two models with draws of their own: three-stage and three-stage-pokluda of PEEK with correlated errors, calibrated once for
    /// all tests.
    fn two_models() -> KeptModels {
        static KEPT: LazyLock<KeptModels> = LazyLock::new(|| {
            let material = Some(Material::Peek);
            let options = PairOptions {
                material,
                samples: smc_calib::Settings::WHOLLY_PLAIN,
                ..PairOptions::default()
            };
            let noises = [Noise::correlated()];
            let compared =
                Compared::new(&options, &noises, false, TimeScale::ByData, &Unwatched::default());
            let mut kept = compared.expect("a comparison").kept.remove(0);
            kept.models.truncate(2);
            kept
        });
        KEPT.clone()
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn the_average_has_the_quantiles_of_the_weighted_union_of_the_models_draws() {
        let mut kept = two_models();
        // Evidences of known ratio: 3 to 1.
        kept.models[0].log_evidence = 3f64.ln();
        kept.models[1].log_evidence = 0.0;
        let wanted = Wanted { after_s: vec![20.0], with_noise: true, ..Wanted::default() };
        let mixed = average(&kept, &wanted).expect("an average");
        assert!((mixed.averaged[0].weight - 0.75).abs() < 1e-12, "{:?}", mixed.averaged);
        let mut union = Vec::new();
        for (model, weight) in kept.models.iter().zip([0.75, 0.25]) {
            let alone = KeptModels { models: vec![model.clone()], ..kept.clone() };
            let growth = NeckGrowth::new(&model.pair, &model.parameters, vec![20.0]);
            let growth = growth.expect("a model");
            let count = model.columns[0].len();
            for row in 0..count {
                let theta: Vec<f64> = model.columns.iter().map(|column| column[row]).collect();
                let mut curve = [0.0];
                growth.curve(&growth.sintering(&theta), &mut curve).expect("a curve");
                union.push((curve[0], weight / count as f64));
            }
            assert_eq!(average(&alone, &wanted).expect("one model").averaged[0].weight, 1.0);
        }
        let union = Weighted::new(union);
        let found = &mixed.after[0];
        assert!((found.contact_ratio.median - union.quantile(0.5)).abs() < 1e-12);
        let [lower, upper] = union.interval(0.95);
        assert!((found.contact_ratio.eti95[0] - lower).abs() < 1e-12);
        assert!((found.contact_ratio.eti95[1] - upper).abs() < 1e-12);
        let measured = found.measured.as_ref().expect("with noise");
        assert!(measured.eti95[1] - measured.eti95[0] > upper - lower, "noise widens");
    }
    #[test]
    #[ignore = "long: run by .ci/run"]
    fn reasons_to_be_careful_with_a_model_are_repeated_where_it_has_weight() {
        let mut kept = two_models();
        kept.models[0].log_evidence = 0.0;
        kept.models[0].advice = vec!["the residuals are alike".to_owned()];
        kept.models[1].advice = vec!["two modes".to_owned()];
        kept.models[0].trusted = false;
        kept.models[1].trusted = true;
        let wanted = Wanted { after_s: vec![20.0], ..Wanted::default() };
        let mut averaged = |log_evidence: f64| {
            kept.models[1].log_evidence = log_evidence;
            average(&kept, &wanted).expect("an average")
        };
        let first = averaged(-9.0);
        assert!(!first.trusted && first.advice.len() == 1, "{:?}", first.advice);
        assert!(first.advice[0].ends_with("with correlated: the residuals are alike"));
        let second = averaged(9.0);
        assert!(second.trusted && second.advice[0].ends_with(": two modes"), "{:?}", second.advice);
        assert_eq!(averaged(0.0).advice.len(), 2);
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn the_time_of_first_contact_of_an_average_is_that_of_its_models() {
        let mut kept = two_models();
        for (model, t0) in kept.models.iter_mut().zip([1.0, 3.0]) {
            let prior =
                smc_calib::Prior::new(smc_calib::PriorSpec::Uniform { lower: -5.0, upper: 5.0 })
                    .expect("a prior");
            let name = model.pair.calibrated(ParameterName::T0);
            model.parameters.push(Parameter::new(name, "s", prior));
            let rows = model.columns[0].len();
            model.columns.push(vec![t0; rows]);
            model.log_evidence = 2.0 * t0;
        }
        let wanted = Wanted { after_s: vec![20.0], ..Wanted::default() };
        let start = average(&kept, &wanted).expect("an average").first_contact_s;
        assert!((start.expect("a time").median - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_pulse_energy_outside_of_that_of_a_model_is_said_of_the_models_that_have_one() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/heat");
        let plan = crate::plan::Planned::read(&folder.join("ps-power.toml")).expect("a plan").plan;
        let (_, pair) = crate::plan::pairs(&plan.experiments).next().expect("the pulse of 19");
        let model = KeptModel {
            explanation: Some("it cooled".to_owned()),
            noise: "fixed 0.04".to_owned(),
            log_evidence: 0.0,
            log_evidence_se: 0.0,
            trusted: true,
            advice: Vec::new(),
            pair: pair.clone(),
            columns: plan.parameters.iter().map(|one| vec![one.prior.quantile(0.5)]).collect(),
            parameters: plan.parameters.clone(),
            sigma: None,
            outliers: None,
        };
        let kept = KeptModels {
            schema_version: 2,
            name: "ps".to_owned(),
            title: "PS".to_owned(),
            left_out: 0,
            left_out_probability: 0.0,
            models: vec![model],
        };
        for (energy, said) in [(None, 0), (Some(19.0), 0), (Some(23.0), 1)] {
            let wanted = Wanted { after_s: vec![1.0], pulse_energy: energy, ..Wanted::default() };
            let advice = average(&kept, &wanted).expect("an average").advice;
            assert_eq!(advice.len(), said, "{energy:?}: {advice:?}");
            let named = |line: &String| {
                line.starts_with("it cooled with fixed 0.04: a pulse energy of 23.0 lies outside")
            };
            assert!(advice.iter().all(named), "{advice:?}");
        }
    }
}
