//! Draws of a posterior, as plain data.

use crate::{NoiseDraw, NoiseShape};
use serde::{Deserialize, Serialize};

/// Parameters of a posterior, and their share of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<'a> {
    /// Parameters in SI.
    pub theta: &'a [f64],
    /// Share of the posterior.
    pub weight: f64,
    /// Sub-net of the sample; none of a draw of a process.
    pub replicate: Option<usize>,
}

/// One equally weighted posterior draw.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Index into `samples`: the sample that the draw is, or the nearest one where a Gaussian process drew its parameters.
    pub sample: usize,
    /// Parameters in SI where a Gaussian process drew them; empty where they are those of the sample.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub theta: Vec<f64>,
    /// Noise standard deviation; none where the noise is fixed per point or tuned, or there are several.
    pub sigma: Option<f64>,
    /// What the noise has beside its standard deviation; none where it has nothing, or there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<NoiseShape>,
}

impl Draw {
    /// A sample, without noise.
    pub(crate) fn of_sample(sample: usize) -> Self {
        Self { sample, theta: Vec::new(), sigma: None, shape: None }
    }

    /// The noise; none where it is fixed per point or tuned, or there are several.
    pub fn noise(&self) -> Option<NoiseDraw> {
        Some(NoiseDraw { sigma: self.sigma?, shape: self.shape })
    }
}

/// Parameters of draws, one after the other, without those that the draw before has too, and the place of each draw's among them: draws of
/// a sample follow one another, and are simulated once.
pub fn distinct<'a>(thetas: &[&'a [f64]]) -> (Vec<&'a [f64]>, Vec<usize>) {
    let mut distinct: Vec<&[f64]> = Vec::new();
    let mut places = Vec::with_capacity(thetas.len());
    for theta in thetas {
        if distinct.last() != Some(theta) {
            distinct.push(theta);
        }
        places.push(distinct.len() - 1);
    }
    (distinct, places)
}
