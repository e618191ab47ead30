//! The heat of the beds: that of the options, of the scene or of the calibration, and where it ends.

use dem_core::heat::Heat;
use serde::Serialize;

use super::curve::{Band, Curve, Target};
use super::draws::Draw;
use super::options::DensifyOptions;
use crate::error::InputError;
use crate::input::heat::HeatFields;
use crate::input::scene_file::SceneInput;
use crate::number::significant;
use crate::pair::asked_heat::{heat_of, refused};
use crate::pair::draws::PairDraws;
use crate::pair::heat::{GrowthSeen, HeatPlan};

/// The heat of all beds, whose numbers may be those of each draw.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BedHeat {
    pub(super) plan: HeatPlan,
    /// Radius that it is of \[m\]: the mean of the particles, which are all at one temperature.
    radius_m: f64,
    /// Where it is asked for.
    place: String,
    /// From the first contact to the end of the scene \[s\].
    pub(super) lasts_s: f64,
}

impl BedHeat {
    /// That of `--heat`, or else of the scene, or else of the calibration; none at the temperature of the calibration.
    pub(super) fn read(
        options: &DensifyOptions,
        calibrated: &PairDraws,
        input: &SceneInput,
    ) -> Result<Option<Self>, InputError> {
        let asked = options.heat.as_deref().map(HeatFields::open).transpose()?;
        let (fields, place) = match (&asked, &input.heat) {
            (Some(asked), _) => (Some(asked), asked.file_name().to_owned()),
            (None, Some(own)) => (Some(own), own.file_name().to_owned()),
            (None, None) => (None, "--heat".to_owned()),
        };
        let Some(plan) = heat_of(&calibrated.pair, fields, options.pulse_energy)? else {
            return Ok(None);
        };
        let radius_m = plan.unrounded(input.outline.mean_radius_m);
        let heated = input.file.phases.iter().skip_while(|phase| !phase.heated);
        let lasts_s = heated.map(|phase| phase.duration_s).sum();
        Ok(Some(Self { plan, radius_m, place, lasts_s }))
    }

    /// The heat of a draw.
    pub(super) fn of(&self, calibrated: &PairDraws, row: usize) -> Result<Heat, InputError> {
        let heat = self.plan.at(self.radius_m, |name| calibrated.value(name, row));
        heat.map_err(|error| refused(&self.place, &error))
    }
}

/// Where the beds stop growing because their heat ends.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freezing {
    /// The target's quantity there, over the draws that have come to rest; none where none has.
    pub at: Option<Band>,
    /// Draws that have come to rest.
    pub draws: usize,
    /// Those of them that have below the target.
    pub below: usize,
    /// Draws whose heat ends too, but after the run of their bed.
    pub later: usize,
}

impl Freezing {
    /// Of the beds of draws; none where no heat ends.
    pub(super) fn of(computed: &[(Draw, Curve)], target: Target) -> Option<Self> {
        let (mut ends, mut later) = (Vec::new(), 0);
        for (draw, curve) in computed {
            let (Some(heat), Some(last)) = (&draw.heat, curve.moments.last()) else { continue };
            let growth = GrowthSeen::of(heat, last.time_s);
            match growth.in_all_s {
                None => {}
                // A full bed has nowhere to go.
                Some(_) if growth.is_frozen() || last.relative_density >= 1.0 => {
                    ends.push(last.of_target(target));
                }
                Some(_) => later += 1,
            }
        }
        let (draws, below) = (ends.len(), ends.iter().filter(|end| **end < target.value()).count());
        let at = Band::of(ends.into_iter());
        (draws + later > 0).then_some(Self { at, draws, below, later })
    }

    /// As lines of the summary; of all `draws` so many come `late`: they do not reach the target, though their pairs have not ended.
    pub(super) fn lines(&self, target: Target, (late, draws): (usize, usize)) -> Vec<String> {
        let interval = |[low, high]: [f64; 2]| {
            format!("{} .. {}", significant(low, 3), significant(high, 3))
        };
        let mut lines = Vec::new();
        if let Some(at) = &self.at {
            lines.push(format!(
                "  it freezes at a {} of {} (50 % {}, 90 % {})",
                target.name(),
                significant(at.median, 3),
                interval(at.eti50),
                interval(at.eti90)
            ));
        }
        let below = self.below.min(late);
        let mut tell = |count: usize, what: &str| {
            if count > 0 {
                lines.push(format!("    {count} of {draws} draws {what}"));
            }
        };
        tell(below, "freeze below the target and count as later than all others");
        tell(
            late - below,
            "do not reach it within the scene's time and count as later than all others",
        );
        tell(
            self.later,
            "have not come to rest by the end of the scene, which is to last longer to say where they freeze",
        );
        lines
    }
}
