//! A bed under a heat: one temperature for all its particles.

use std::sync::Arc;

use super::engine::Bed;
use super::error::BedError;
use super::heat_clock::{HeatClock, StepPace};
use super::run::Run;
use crate::heat::Heat;

impl Bed {
    /// The pace of the step from the present time.
    pub(crate) fn step_pace(&self) -> StepPace {
        let Some(clock) = &self.heat else {
            return StepPace { growing_s: self.step_s, slowness: 1.0 };
        };
        let m = clock.heat.mobility(self.time_s + 0.5 * self.step_s - clock.contact_s);
        StepPace { growing_s: m * self.step_s, slowness: 1.0 / m }
    }

    /// The time by which contacts grow, at a time of the bed \[s\]: that time itself without heat.
    pub(crate) fn growth_time_s(&self, time_s: f64) -> f64 {
        match &self.heat {
            None => time_s,
            Some(clock) => clock.heat.reduced_time(time_s - clock.contact_s),
        }
    }

    /// The time of growth in so long a time after another \[s\].
    pub(crate) fn growth_within_s(&self, from_s: f64, takes_s: f64) -> f64 {
        match &self.heat {
            None => takes_s,
            Some(_) => self.growth_time_s(from_s + takes_s) - self.growth_time_s(from_s),
        }
    }

    /// The time of the bed at a time of growth, which is not after `until_s` \[s\].
    pub(crate) fn time_of_growth_s(&self, growth_s: f64, until_s: f64) -> f64 {
        match &self.heat {
            None => growth_s,
            Some(clock) => {
                let time_s = clock.heat.time(growth_s).map(|time_s| time_s + clock.contact_s);
                time_s.map_or(until_s, |time_s| time_s.clamp(self.time_s, until_s))
            }
        }
    }
}

impl Run {
    /// Puts the bed under a heat, whose first contact is the beginning of the first heated phase; the parameters are those of m = 1.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`] once a heated phase has begun.
    pub fn set_heat(&mut self, heat: Heat) -> Result<(), BedError> {
        self.check_cold("heat")?;
        self.scene.heat = Some(Arc::new(heat));
        Ok(())
    }

    /// The heat of the scene since the beginning of its first heated phase, which may be the present one.
    pub(crate) fn heat_clock(&self) -> Option<HeatClock> {
        let heat = self.scene.heat.clone()?;
        let phases = self.scene.phases.iter();
        let first = phases.zip(&self.series.phase_start_s).find(|(phase, _)| phase.heated);
        let contact_s = first.map_or(self.bed.time_s(), |(_, &start_s)| start_s);
        Some(HeatClock { heat, contact_s })
    }
}
