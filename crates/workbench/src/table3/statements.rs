//! What section 4 of the paper says of the three curves, beside what follows from its parameters and from ours.

use dem_core::{Kinetics, PairScene, Sintering, knee, time_to_contact_ratio};
use serde::{Deserialize, Serialize};

use super::calibrated::Calibrated;
use crate::derived::{Estimate, estimate};
use crate::error::Failure;
use crate::material::Material;
use crate::model::NeckGrowth;

/// One statement of the paper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Statement {
    /// Name of the material.
    pub material: String,
    /// The quantity.
    pub quantity: String,
    /// Unit; empty for a ratio.
    pub unit: String,
    /// The paper's words.
    pub words: String,
    /// The number in these words; none where the paper gives none.
    pub stated: Option<f64>,
    /// With the paper's parameters, through the map of Table 3.
    pub paper_parameters: Option<f64>,
    /// At our MAP.
    pub map: Option<f64>,
    /// Under our posterior.
    pub posterior: Option<Estimate>,
    /// Posterior probability of a value below the stated one \[%\].
    pub percentile: Option<f64>,
}

/// A quantity of a curve.
type Of = fn(&PairScene, &Sintering) -> Option<f64>;

struct Claim {
    material: Material,
    quantity: &'static str,
    unit: &'static str,
    words: &'static str,
    stated: Option<f64>,
    of: Of,
}

fn knee_time(scene: &PairScene, sintering: &Sintering) -> Option<f64> {
    let knee = knee(scene, sintering);
    (knee.has_zipping && knee.has_stretching).then_some(knee.time_s)
}

fn knee_height(scene: &PairScene, sintering: &Sintering) -> Option<f64> {
    let knee = knee(scene, sintering);
    (knee.has_zipping && knee.has_stretching).then_some(knee.contact_ratio)
}

fn time_to_one(scene: &PairScene, sintering: &Sintering) -> Option<f64> {
    time_to_contact_ratio(scene, Kinetics::ThreeStage, sintering, 1.0)
}

fn time_to_end(scene: &PairScene, sintering: &Sintering) -> Option<f64> {
    time_to_contact_ratio(scene, Kinetics::ThreeStage, sintering, scene.final_contact_ratio())
}

const CLAIMS: [Claim; 9] = [
    Claim {
        material: Material::Ps,
        quantity: "time of the knee",
        unit: "s",
        words: "\"the stress relaxation comes immediately at 0.03 s\"",
        stated: Some(0.03),
        of: knee_time,
    },
    Claim {
        material: Material::Ps,
        quantity: "height of the knee, a/R",
        unit: "",
        words: "not stated",
        stated: None,
        of: knee_height,
    },
    Claim {
        material: Material::Ps,
        quantity: "end of growth (a/R = 1.08), from where Frenkel's curve of the same tau_s agrees",
        unit: "s",
        words: "Frenkel's model \"agrees after 0.11 s\"",
        stated: Some(0.11),
        of: time_to_end,
    },
    Claim {
        material: Material::Pa12,
        quantity: "time of the knee",
        unit: "s",
        words: "\"the transition between the second and third sintering mechanism is at 0.4 s\"",
        stated: Some(0.4),
        of: knee_time,
    },
    Claim {
        material: Material::Pa12,
        quantity: "height of the knee, a/R",
        unit: "",
        words: "\"when a/R ≈ 0.2\"",
        stated: Some(0.2),
        of: knee_height,
    },
    Claim {
        material: Material::Pa12,
        quantity: "a/R = 1",
        unit: "s",
        words: "\"the maximum overlap (a/R = 1.0) is achieved at t = 4.0 s\"",
        stated: Some(4.0),
        of: time_to_one,
    },
    Claim {
        material: Material::Pa12,
        quantity: "full coalescence, a/R = 2^(1/3)",
        unit: "s",
        words: "\"is reached at 6.1 s\"",
        stated: Some(6.1),
        of: time_to_end,
    },
    Claim {
        material: Material::Peek,
        quantity: "time of the knee",
        unit: "s",
        words: "\"the delay to reach the stress relaxation is about 14.0 s\"",
        stated: Some(14.0),
        of: knee_time,
    },
    Claim {
        material: Material::Peek,
        quantity: "height of the knee, a/R",
        unit: "",
        words: "\"it takes into account 40% of the coalescence\"",
        stated: Some(0.4),
        of: knee_height,
    },
];

/// Every statement, in the order of the paper.
pub fn all(calibrated: &[Calibrated]) -> Result<Vec<Statement>, Failure> {
    let mut statements = Vec::new();
    for claim in &CLAIMS {
        let Some(one) = calibrated.iter().find(|one| one.material == claim.material) else {
            continue;
        };
        let scene = one.pair()?.plan.scene()?;
        let model = NeckGrowth::of(&one.calibration.record.plan)?;
        let posterior = &one.calibration.posterior;
        let of = |theta: &[f64]| (claim.of)(&scene, &model.sintering(theta));
        let found = estimate(posterior, of);
        let percentile = match (&found, claim.stated) {
            (Some((_, marginal)), Some(stated)) => Some(100.0 * marginal.share_below(stated)),
            _ => None,
        };
        statements.push(Statement {
            material: claim.material.name().to_owned(),
            quantity: claim.quantity.to_owned(),
            unit: claim.unit.to_owned(),
            words: claim.words.to_owned(),
            stated: claim.stated,
            paper_parameters: (claim.of)(&scene, &claim.material.table3_sintering()),
            map: of(&posterior.map.theta),
            posterior: found.map(|(estimate, _)| estimate),
            percentile,
        });
    }
    Ok(statements)
}
