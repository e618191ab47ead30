//! The particles: one array per quantity.

use super::vec3::{Vec3, ZERO};

/// The particles of a bed, in the order in which they lie in space.
///
/// The order changes when the neighbour list is rebuilt; [`id`](Self::id) says which particle of the
/// scene is where.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Particles {
    /// Centres \[m\].
    pub position_m: Vec<[f64; 3]>,
    /// Velocities half a step ahead of the positions \[m/s\].
    pub(crate) half_velocity: Vec<Vec3>,
    /// Velocities \[m/s\], as of the last observation.
    pub velocity_m_per_s: Vec<[f64; 3]>,
    /// Angular velocities half a step ahead \[1/s\]; empty without friction.
    pub(crate) spin: Vec<Vec3>,
    /// Angular velocities \[1/s\], as of the last observation; empty without friction.
    pub angular_velocity_per_s: Vec<[f64; 3]>,
    /// Radii \[m\].
    pub radius_m: Vec<f64>,
    /// Inertial masses \[kg\]: the masses times the mass scaling.
    pub(crate) inertia: Vec<f64>,
    /// Place in the scene.
    pub id: Vec<u32>,
}

impl Particles {
    pub(crate) fn new(
        position_m: Vec<Vec3>,
        velocity_m_per_s: Vec<Vec3>,
        radius_m: Vec<f64>,
        density_kg_per_m3: f64,
        has_spin: bool,
    ) -> Self {
        let n = position_m.len();
        let volume = 4.0 / 3.0 * std::f64::consts::PI;
        Self {
            half_velocity: velocity_m_per_s.clone(),
            inertia: radius_m.iter().map(|r| volume * r.powi(3) * density_kg_per_m3).collect(),
            spin: if has_spin { vec![ZERO; n] } else { Vec::new() },
            angular_velocity_per_s: if has_spin { vec![ZERO; n] } else { Vec::new() },
            id: (0..n as u32).collect(),
            position_m,
            velocity_m_per_s,
            radius_m,
        }
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.position_m.len()
    }

    /// Whether the bed is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.position_m.is_empty()
    }

    /// Volume of the particles, overlaps counted twice \[m3\]: their mass over the density.
    #[must_use]
    pub fn solid_volume_m3(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.radius_m.iter().map(|r| r.powi(3)).sum::<f64>()
    }

    /// Puts the particle `order[i]` in place i.
    pub(crate) fn reorder(&mut self, order: &[u32]) {
        fn permute<T: Copy>(values: &mut Vec<T>, order: &[u32]) {
            if !values.is_empty() {
                *values = order.iter().map(|&from| values[from as usize]).collect();
            }
        }
        permute(&mut self.position_m, order);
        permute(&mut self.half_velocity, order);
        permute(&mut self.velocity_m_per_s, order);
        permute(&mut self.spin, order);
        permute(&mut self.angular_velocity_per_s, order);
        permute(&mut self.radius_m, order);
        permute(&mut self.inertia, order);
        permute(&mut self.id, order);
    }
}
