//! A checked scene.

use std::sync::Arc;

use super::closure::WhenNecksMeet;
use super::engine::Bed;
use super::error::BedError;
use super::material::{Growing, check_final_contact_ratio};
use super::phase::Phase;
use super::start::Start;
use crate::heat::Heat;

/// A checked scene, ready to [run](Scene::run).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) bed: Bed,
    pub(crate) growing: Option<Growing>,
    pub(crate) heat: Option<Arc<Heat>>,
    pub(crate) phases: Vec<Phase>,
    pub(crate) free_box: bool,
    pub(crate) when_necks_meet: WhenNecksMeet,
    pub(crate) allowed_load_over_adhesion: f64,
}

impl Scene {
    /// Name for outputs.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The bed as it starts.
    #[must_use]
    pub fn bed(&self) -> &Bed {
        &self.bed
    }

    /// Growth of contacts, where the scene has it.
    #[must_use]
    pub fn growing(&self) -> Option<&Growing> {
        self.growing.as_ref()
    }

    /// The same scene under a heat: see [`Run::set_heat`](super::Run::set_heat).
    #[must_use]
    pub fn with_heat(self, heat: Heat) -> Self {
        Self { heat: Some(Arc::new(heat)), ..self }
    }

    /// The same particles in the same places with another final contact ratio: a draw of a posterior that
    /// has one.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`] for one above 1.26, [`BedError::Material`], for instance where contacts would start coalesced.
    pub fn with_final_contact_ratio(mut self, phi: f64) -> Result<Self, BedError> {
        let mut spec = *self.bed.material().spec();
        if phi == spec.final_contact_ratio {
            return Ok(self);
        }
        check_final_contact_ratio(phi)?;
        spec.final_contact_ratio = phi;
        let p = self.bed.particles();
        // In the order of the scene, as they are numbered.
        let mut order: Vec<usize> = (0..p.len()).collect();
        order.sort_unstable_by_key(|&i| p.id[i]);
        let sorted = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
            order.iter().filter_map(|&i| values.get(i).copied()).collect()
        };
        let start = Start {
            position_m: sorted(&p.position_m),
            radius_m: order.iter().map(|&i| p.radius_m[i]).collect(),
            velocity_m_per_s: sorted(&p.velocity_m_per_s),
            angular_velocity_per_s: sorted(&p.angular_velocity_per_s),
        };
        let material = self.bed.material().with_spec(spec)?;
        self.bed = Bed::new(material, *self.bed.surroundings(), &start)?;
        Ok(self)
    }

    /// The same scene with another loading stiffness, also where a phase has its own.
    ///
    /// # Errors
    ///
    /// [`BedError::Material`].
    pub fn with_k1(mut self, k1_n_per_m: f64) -> Result<Self, BedError> {
        let material = *self.bed.material();
        let factor = k1_n_per_m / material.k1_n_per_m();
        self.bed.set_material(material.with_k1(k1_n_per_m)?);
        for phase in &mut self.phases {
            phase.k1_n_per_m = phase.k1_n_per_m.map(|k1| k1 * factor);
        }
        Ok(self)
    }

    /// The same scene with another loading stiffness where it is heated; the other phases keep theirs.
    ///
    /// # Errors
    ///
    /// [`BedError::Material`].
    pub fn with_heated_k1(mut self, k1_n_per_m: f64) -> Result<Self, BedError> {
        let before = self.bed.material().k1_n_per_m();
        self.bed.material().with_k1(k1_n_per_m)?;
        for phase in &mut self.phases {
            let k1 = if phase.heated { k1_n_per_m } else { phase.k1_n_per_m.unwrap_or(before) };
            phase.k1_n_per_m = Some(k1);
        }
        Ok(self)
    }

    /// The phases.
    #[must_use]
    pub fn phases(&self) -> &[Phase] {
        &self.phases
    }
}
