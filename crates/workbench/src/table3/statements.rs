//! Statements of section 4 of the paper on the three curves, with the values that follow from its parameters and from ours.

use dem_core::{PairScene, Sintering, knee};
use serde::Serialize;

use super::calibrated::Calibrated;
use super::readings::Quantity::{self, EndTime, KneeHeight, KneeTime, TimeToOne};
use crate::error::Failure;
use crate::input::material::Material::{self, Pa12, Peek, Ps};
use crate::pair::derived::{Estimate, estimate};
use crate::pair::model::NeckGrowth;

/// One statement of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
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

/// Material, quantity, the paper's words, and the number in them.
type Claim = (Material, Quantity, &'static str, Option<f64>);

const CLAIMS: [Claim; 9] = [
    (Ps, KneeTime, "\"the stress relaxation comes immediately at 0.03 s\"", Some(0.03)),
    (Ps, KneeHeight, "not stated", None),
    (Ps, EndTime, "Frenkel's model \"agrees after 0.11 s\"", Some(0.11)),
    (
        Pa12,
        KneeTime,
        "\"the transition between the second and third sintering mechanism is at 0.4 s\"",
        Some(0.4),
    ),
    (Pa12, KneeHeight, "\"when a/R ≈ 0.2\"", Some(0.2)),
    (Pa12, TimeToOne, "\"the maximum overlap (a/R = 1.0) is achieved at t = 4.0 s\"", Some(4.0)),
    (Pa12, EndTime, "\"is reached at 6.1 s\"", Some(6.1)),
    (Peek, KneeTime, "\"the delay to reach the stress relaxation is about 14.0 s\"", Some(14.0)),
    (Peek, KneeHeight, "\"it takes into account 40% of the coalescence\"", Some(0.4)),
];

/// Subject of a statement in words, and its unit.
fn in_words(material: Material, quantity: Quantity) -> (&'static str, &'static str) {
    match quantity {
        KneeTime => ("time of the knee", "s"),
        KneeHeight => ("height of the knee, a/R", ""),
        TimeToOne => ("a/R = 1", "s"),
        EndTime if material == Ps => {
            ("end of growth (a/R = 1.08), from where Frenkel's curve of the same tau_s agrees", "s")
        }
        EndTime => ("full coalescence, a/R = 2^(1/3)", "s"),
    }
}

/// Every statement, in the order of the paper.
pub(crate) fn all(calibrated: &[Calibrated]) -> Result<Vec<Statement>, Failure> {
    let mut statements = Vec::new();
    for (material, quantity, words, stated) in CLAIMS {
        let Some(one) = calibrated.iter().find(|one| one.material == material) else {
            continue;
        };
        let scene = one.calibration.record.pair()?.plan.scene()?;
        let model = NeckGrowth::of(&one.calibration.record.plan)?;
        let posterior = &one.calibration.posterior;
        let value = |sintering: &Sintering| match quantity {
            KneeTime | KneeHeight if !has_knee(&scene, sintering) => None,
            _ => quantity.of(&scene, sintering),
        };
        let of = |theta: &[f64]| value(&model.sintering(theta));
        let found = estimate(posterior, of);
        let below = |value: f64| Some(100.0 * found.as_ref()?.1.share_below(value));
        let (name, unit) = in_words(material, quantity);
        statements.push(Statement {
            material: material.name().to_owned(),
            quantity: name.to_owned(),
            unit: unit.to_owned(),
            words: words.to_owned(),
            stated,
            paper_parameters: value(&material.table3_sintering()),
            map: of(&posterior.map.theta),
            percentile: stated.and_then(below),
            posterior: found.map(|(estimate, _)| estimate),
        });
    }
    Ok(statements)
}

/// Whether the curve passes from zipping to stretching.
fn has_knee(scene: &PairScene, sintering: &Sintering) -> bool {
    let knee = knee(scene, sintering);
    knee.has_zipping && knee.has_stretching
}
