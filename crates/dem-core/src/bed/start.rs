//! The start of a bed: particles and their surroundings.

use super::error::{BedError, field, within};
use super::material::{Friction, Material};
use super::neighbours::MOST_PARTICLES;
use super::region::Region;
use super::vec3::{Vec3, norm};

/// The box, gravity, fluid and friction around the particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// The box.
    pub region: Region,
    /// Acceleration of gravity \[m/s2\]; `[0, 0, 0]` without gravity.
    pub gravity_m_per_s2: [f64; 3],
    /// Viscosity of a fluid that drags on each particle by Stokes' law, `-6 pi eta R v` \[Pa s\]; 0 without
    /// a fluid.
    pub drag_viscosity_pa_s: f64,
    /// Friction between particles and with walls.
    pub friction: Option<Friction>,
}

impl Surroundings {
    /// Open space.
    pub const NOTHING: Self = Self {
        region: Region::OPEN,
        gravity_m_per_s2: [0.0; 3],
        drag_viscosity_pa_s: 0.0,
        friction: None,
    };
}

/// The particles at the start of a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start {
    /// Centres \[m\].
    pub position_m: Vec<[f64; 3]>,
    /// Radii \[m\].
    pub radius_m: Vec<f64>,
    /// Velocities \[m/s\]; empty for particles at rest.
    pub velocity_m_per_s: Vec<[f64; 3]>,
    /// Angular velocities \[1/s\]; empty for particles without rotation. Not used without friction.
    pub angular_velocity_per_s: Vec<[f64; 3]>,
}

impl Surroundings {
    fn check(&self) -> Result<(), BedError> {
        for (name, value) in [
            ("gravity.acceleration_m_per_s2", norm(self.gravity_m_per_s2)),
            ("drag.viscosity_pa_s", self.drag_viscosity_pa_s),
        ] {
            within(name, value, 0.0, 1e6, "use 0 to 1e6")?;
        }
        self.friction.map_or(Ok(()), |friction| friction.check())
    }
}

impl Start {
    /// Checks the particles and their surroundings.
    pub(crate) fn check(&self, material: &Material, around: &Surroundings) -> Result<(), BedError> {
        around.region.check()?;
        let n = self.position_m.len();
        if n == 0 || n >= MOST_PARTICLES {
            return Err(field("particles", n, "a bed has 1 to 134217727 particles"));
        }
        if self.radius_m.len() != n {
            let remedy = "give one radius for each particle";
            return Err(field("radius_m", self.radius_m.len(), remedy));
        }
        for (i, &radius) in self.radius_m.iter().enumerate() {
            let name = format!("radius_m of particle {i}");
            within(&name, radius, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
        }
        self.check_vectors("position_m", &self.position_m)?;
        self.check_vectors("velocity_m_per_s", &self.velocity_m_per_s)?;
        self.check_vectors("angular_velocity_per_s", &self.angular_velocity_per_s)?;
        around.check()?;
        self.check_walls(material, &around.region)
    }

    /// Checks that there is one finite vector for each particle, or no vector.
    fn check_vectors(&self, name: &str, values: &[Vec3]) -> Result<(), BedError> {
        if !values.is_empty() && values.len() != self.position_m.len() {
            return Err(field(name, values.len(), "give none, or one for each particle"));
        }
        match values.iter().flatten().find(|value| !value.is_finite()) {
            Some(value) => Err(field(name, value, "must be finite")),
            None => Ok(()),
        }
    }

    /// Refuses particles that overlap with a wall by more than an adhesive contact.
    fn check_walls(&self, material: &Material, region: &Region) -> Result<(), BedError> {
        let walls = region.walls();
        for (particle, (&position_m, &radius_m)) in
            self.position_m.iter().zip(&self.radius_m).enumerate()
        {
            for wall in &walls {
                let overlap = (radius_m - wall.distance(position_m)) / material.wall_unit(radius_m);
                if overlap > material.law().adhesion * (1.0 + 1e-6) {
                    let axis = wall.axis;
                    return Err(BedError::OutsideBox { particle, position_m, radius_m, axis });
                }
            }
        }
        Ok(())
    }

    /// Mean radius \[m\].
    pub(crate) fn mean_radius_m(&self) -> f64 {
        self.radius_m.iter().sum::<f64>() / self.radius_m.len().max(1) as f64
    }
}
