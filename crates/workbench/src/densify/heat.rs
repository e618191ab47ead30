//! The heat of the beds: that of the options, of the scene or of the calibration.

use dem_core::heat::Heat;

use super::options::DensifyOptions;
use crate::error::InputError;
use crate::input::heat::HeatFields;
use crate::input::scene_file::SceneInput;
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
    /// The heated phases, each from one time to another since first contact \[s\].
    heated_s: Vec<[f64; 2]>,
}

impl BedHeat {
    /// That of `--heat`, or else of the scene, or else of the calibration; none at the temperature of the calibration.
    pub(super) fn read(
        options: &DensifyOptions,
        calibrated: &PairDraws,
        input: &SceneInput,
    ) -> Result<Option<Self>, InputError> {
        let asked = options.heat.as_deref().map(HeatFields::open).transpose()?;
        // As those of [sintering], numbers of a scene give way to those of the calibration.
        let own = calibrated.pair.heat.as_ref();
        let known = |name| own.is_some_and(|own| own.known.contains_key(&name));
        let of_calibration = |name| known(name) || calibrated.value(name, 0).is_some();
        let of_scene = || input.heat.as_ref().map(|heat| heat.without(of_calibration));
        let fields = asked.or_else(of_scene);
        let place = fields.as_ref().map_or("--heat", HeatFields::file_name).to_owned();
        let heat = heat_of(&calibrated.pair, fields.as_ref(), options.pulse_energy)?;
        let Some(plan) = heat else { return Ok(None) };
        let radius_m = plan.unrounded(input.outline.mean_radius_m);
        let heated_s = input.heated_s(f64::INFINITY);
        Ok(Some(Self { plan, radius_m, place, heated_s }))
    }

    /// The reduced time for which beds under the heat of a draw grow, by the end of the scene \[s\].
    pub(super) fn growth_s(&self, heat: &Heat) -> f64 {
        GrowthSeen::of(heat, &self.heated_s).reduced_time_s
    }

    /// The heat of a draw.
    pub(super) fn of(&self, calibrated: &PairDraws, row: usize) -> Result<Heat, InputError> {
        let heat = self.plan.at(self.radius_m, |name| calibrated.value(name, row));
        heat.map_err(|error| refused(&self.place, &error))
    }
}
