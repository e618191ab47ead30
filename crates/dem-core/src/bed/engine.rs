//! A bed: particles, their contacts, and the phase they are in.
//!
//! Between steps it holds positions at a time and velocities half a step ahead. A step drifts,
//! computes the [forces](super::forces) of all pairs and lets the [particles](super::motion) gather them. The
//! neighbour list is rebuilt when particles have moved by half of its skin, and not before.
//!
//! | what a bed does | file |
//! |---|---|
//! | start, phases, constants of contacts | this one |
//! | the first half step of a phase | `set_off` |
//! | steps | `advance` |
//! | the neighbour list | `relist` |
//! | the largest stable step | `stability` |

use super::contact::{LawConstants, Memory, Scheme};
use super::error::{BedError, within};
use super::friction::Slider;
use super::heat_clock::HeatClock;
use super::material::{ContactConstants, Friction, Growing, Material, effective_radius};
use super::motion::WallList;
use super::necks::NeckLaw;
use super::neighbours::{NeighbourList, image_of, index_of};
use super::particles::Particles;
use super::region::Wall;
use super::start::{Start, Surroundings};
use super::vec3::{Vec3, ZERO, add, norm, scale, sub};

/// Growth, time step and mass scaling of a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Growth of the contacts; `None` in a phase without heat.
    pub growing: Option<Growing>,
    /// Time step over the collision time of the smallest particles; 0.02 is usual.
    pub step_over_collision_time: f64,
    /// Factor on all masses as far as inertia goes, 1 or more; weights stay as they are.
    pub mass_scaling: f64,
}

impl Default for Drive {
    fn default() -> Self {
        Self { growing: None, step_over_collision_time: 0.02, mass_scaling: 1.0 }
    }
}

/// The pairs: one array per quantity, in the order of the list.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Pairs {
    pub(crate) memory: Vec<Memory>,
    pub(crate) plastic_before: Vec<f64>,
    pub(crate) force: Vec<Vec3>,
    /// Empty where all radii are equal.
    pub(crate) constants: Vec<ContactConstants>,
    /// Empty without friction.
    pub(crate) spring: Vec<Vec3>,
    /// Empty without friction.
    pub(crate) torque: Vec<Vec3>,
    /// Turn of the necks' springs \[rad\]; empty where necks have no resistance.
    pub(crate) turn: Vec<Vec3>,
    /// Moment of the necks on the first particle \[N m\]; empty where necks have no resistance.
    pub(crate) moment: Vec<Vec3>,
}

/// Work of a run so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Steps taken.
    pub steps: u64,
    /// Neighbour lists built.
    pub rebuilds: u64,
    /// Checks of the true displacements against the skin.
    pub displacement_checks: u64,
}

/// Particles in motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Bed {
    pub(crate) material: Material,
    pub(crate) law: LawConstants,
    pub(crate) around: Surroundings,
    pub(crate) walls: Vec<Wall>,
    pub(crate) drive: Drive,
    /// The heat of the contacts that grow; none at the reference temperature.
    pub(crate) heat: Option<HeatClock>,
    pub(crate) step_s: f64,
    pub(crate) time_s: f64,
    /// Steps since `phase_start_s`.
    pub(crate) phase_steps: u64,
    pub(crate) phase_start_s: f64,
    pub(crate) particles: Particles,
    pub(crate) equal: bool,
    pub(crate) list: NeighbourList,
    pub(crate) pairs: Pairs,
    pub(crate) wall_list: WallList,
    pub(crate) skin: f64,
    /// Positions when the list was made.
    pub(crate) listed_position: Vec<Vec3>,
    /// No particle has moved further than this since then.
    pub(crate) travelled: f64,
    /// Whether no new contacts are made: from where the necks of the particles have met.
    pub(crate) closed: bool,
    /// Largest speed, half a step ahead.
    pub(crate) fastest: f64,
    pub(crate) work: Work,
}

/// Largest number of particles, without images, whose pairs are all in the list for good.
const ALL_PAIRS: usize = 4;

/// Skin of the neighbour list over the mean radius: a list of a dense bed then has about half again as
/// many pairs as there are contacts, and stays as long as nothing moves by a twentieth of a diameter.
const SKIN_OVER_RADIUS: f64 = 0.2;

impl Bed {
    /// Checks and places the particles.
    ///
    /// Contacts may start with an overlap up to the adhesive contact's, x0 effective radii; with `fa/(K1 R)`
    /// or more they are in force balance.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the particle or field.
    pub fn new(material: Material, around: Surroundings, start: &Start) -> Result<Self, BedError> {
        start.check(&material, &around)?;
        let n = start.position_m.len();
        let walls = around.region.walls();
        let few = n <= ALL_PAIRS && !around.region.has_images() && walls.is_empty();
        let skin = if few { f64::INFINITY } else { SKIN_OVER_RADIUS * start.mean_radius_m() };
        let largest = start.radius_m.iter().copied().fold(0.0, f64::max);
        around.region.check_images(2.0 * largest + skin)?;
        let at_rest = || vec![ZERO; n];
        let given = |vectors: &Vec<Vec3>| (!vectors.is_empty()).then(|| vectors.clone());
        let rotates = around.friction.is_some() || material.neck_viscosity() > 0.0;
        let mut particles = Particles::new(
            start.position_m.clone(),
            given(&start.velocity_m_per_s).unwrap_or_else(at_rest),
            start.radius_m.clone(),
            material.spec().powder.density_kg_per_m3,
            rotates,
        );
        if rotates {
            particles.angular_velocity_per_s =
                given(&start.angular_velocity_per_s).unwrap_or_else(at_rest);
        }
        let mut bed = Self {
            law: LawConstants::new(*material.law()),
            material,
            around,
            walls,
            drive: Drive::default(),
            heat: None,
            step_s: 0.0,
            time_s: 0.0,
            phase_steps: 0,
            phase_start_s: 0.0,
            equal: start.radius_m.iter().all(|&radius| radius == start.radius_m[0]),
            particles,
            list: NeighbourList::default(),
            pairs: Pairs::default(),
            wall_list: WallList::default(),
            skin,
            listed_position: Vec::new(),
            travelled: 0.0,
            closed: false,
            fastest: 0.0,
            work: Work::default(),
        };
        bed.list.start = vec![0; n + 1];
        bed.wall_list.start = vec![0; n + 1];
        bed.rebuild()?;
        bed.first_contacts()?;
        bed.begin(&Drive::default())?;
        Ok(bed)
    }

    /// Gives the contacts at the start the plastic overlap at which they balance.
    fn first_contacts(&mut self) -> Result<(), BedError> {
        let law = self.law.law;
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                let j = index_of(self.list.other[k]);
                let (radius_i, radius_j) = (self.particles.radius_m[i], self.particles.radius_m[j]);
                let radius = effective_radius(radius_i, radius_j);
                let unit = self.material.overlap_unit(radius_i, radius_j);
                let overlap = (radius_i + radius_j - norm(self.distance(i, k))) / unit;
                if overlap < 0.0 {
                    continue;
                }
                let allowed = self.material.pair_of_radius(radius)?.x0() * (1.0 + 1e-6);
                if overlap > allowed {
                    let [a, b] = [i, j].map(|i| self.particles.id[i] as usize);
                    let (first, second) = (a.min(b), a.max(b));
                    return Err(BedError::OverlappingStart { first, second, overlap, allowed });
                }
                let plastic = law.equilibrium_plastic_overlap(overlap.max(law.adhesion));
                self.pairs.memory[k] = Memory { overlap, drift: 0.0, plastic, pull: 0.0 };
                self.pairs.plastic_before[k] = plastic;
            }
            for k in self.wall_list.row(i) {
                let wall = &self.walls[self.wall_list.wall[k] as usize];
                let radius = self.particles.radius_m[i];
                let overlap = (radius - wall.distance(self.particles.position_m[i]))
                    / self.material.wall_unit(radius);
                if overlap >= 0.0 {
                    self.wall_list.memory[k] =
                        Memory { overlap, drift: 0.0, plastic: 0.0, pull: 0.0 };
                }
            }
        }
        Ok(())
    }

    /// Vector from the second particle of a pair to the first one, i.
    pub(crate) fn distance(&self, i: usize, k: usize) -> Vec3 {
        let entry = self.list.other[k];
        let d = sub(self.particles.position_m[i], self.particles.position_m[index_of(entry)]);
        if self.around.region.has_images() {
            add(d, self.around.region.image_shifts()[image_of(entry)])
        } else {
            d
        }
    }

    /// Constants of a pair.
    pub(crate) fn constants(&self, i: usize, k: usize) -> Result<ContactConstants, BedError> {
        let j = index_of(self.list.other[k]);
        let particle = |i: usize| (self.particles.radius_m[i], self.particles.inertia[i]);
        self.material.contact(self.drive.growing.as_ref(), particle(i), particle(j))
    }

    /// Constants of all pairs of equal particles.
    pub(crate) fn equal_constants(&self) -> Result<ContactConstants, BedError> {
        let particle = (self.particles.radius_m[0], self.particles.inertia[0]);
        self.material.contact(self.drive.growing.as_ref(), particle, particle)
    }

    pub(crate) fn fill_constants(&mut self) -> Result<(), BedError> {
        if self.equal {
            return Ok(());
        }
        let mut constants = Vec::with_capacity(self.list.other.len());
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                constants.push(self.constants(i, k)?);
            }
        }
        self.pairs.constants = constants;
        Ok(())
    }

    /// Starts a phase from positions and velocities: chooses the step and puts the velocities half of it
    /// ahead.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`], [`BedError::Sintering`] for the drive; [`BedError::UnstableStep`].
    pub fn begin(&mut self, drive: &Drive) -> Result<(), BedError> {
        let step = drive.step_over_collision_time;
        within("step_over_collision_time", step, 1e-9, 1.0, "use 1e-9 to 1; 0.02 is usual")?;
        within("mass_scaling", drive.mass_scaling, 1.0, 1e18, "use 1 to 1e18")?;
        let rescale = drive.mass_scaling / self.drive.mass_scaling;
        if rescale != 1.0 {
            for mass in &mut self.particles.inertia {
                *mass *= rescale;
            }
        }
        self.drive = *drive;
        let fresh_s = step * self.collision_time_s();
        self.begin_with_step(fresh_s)
    }

    /// Like [`begin`](Self::begin), with a step given in seconds instead; for a driver that makes steps
    /// end on its observation times.
    pub(crate) fn begin_with_step(&mut self, step_s: f64) -> Result<(), BedError> {
        self.step_s = step_s;
        self.phase_start_s = self.time_s;
        self.phase_steps = 0;
        self.pairs.turn.fill(ZERO);
        self.pairs.moment.fill(ZERO);
        self.fill_constants()?;
        self.check_stability()?;
        self.set_off()
    }

    /// The step \[s\].
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The time that positions belong to \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The particles, with velocities as of the end of the last [`advance`](Self::advance).
    #[must_use]
    pub fn particles(&self) -> &Particles {
        &self.particles
    }

    /// The material.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Replaces the material by one of another stiffness; takes effect when a phase
    /// [begins](Self::begin).
    pub(crate) fn set_material(&mut self, material: Material) {
        self.law = LawConstants::new(*material.law());
        self.material = material;
    }

    /// Box, gravity, fluid and friction.
    #[must_use]
    pub fn surroundings(&self) -> &Surroundings {
        &self.around
    }

    /// Work of the run so far.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Bytes held for the particles and their contacts.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        fn of<T>(values: &Vec<T>) -> usize {
            values.capacity() * size_of::<T>()
        }
        let (p, l, c, w) = (&self.particles, &self.list, &self.pairs, &self.wall_list);
        of(&p.position_m)
            + of(&p.half_velocity)
            + of(&p.velocity_m_per_s)
            + of(&p.spin)
            + of(&p.angular_velocity_per_s)
            + of(&p.radius_m)
            + of(&p.inertia)
            + of(&p.id)
            + of(&self.listed_position)
            + of(&l.start)
            + of(&l.other)
            + of(&l.reverse_start)
            + of(&l.reverse)
            + of(&c.memory)
            + of(&c.plastic_before)
            + of(&c.force)
            + of(&c.constants)
            + of(&c.spring)
            + of(&c.torque)
            + of(&c.turn)
            + of(&c.moment)
            + of(&w.start)
            + of(&w.wall)
            + of(&w.memory)
            + of(&w.spring)
    }

    pub(crate) fn wall_scheme(&self, i: usize) -> Scheme {
        let constants =
            self.material.wall_contact(self.particles.radius_m[i], self.particles.inertia[i]);
        Scheme::new(&constants, self.material.k1_n_per_m(), self.step_s)
    }

    pub(crate) fn slider(&self) -> Slider {
        Slider::new(&self.friction(), self.material.k1_n_per_m())
    }

    /// Friction, with a coefficient of 0 where there is none.
    fn friction(&self) -> Friction {
        self.around.friction.unwrap_or(Friction::NONE)
    }

    /// The necks' law in dynamic phases.
    pub(crate) fn neck_law(&self) -> NeckLaw {
        let material = &self.material;
        NeckLaw::new(material.neck_viscosity(), &self.friction(), material.k1_n_per_m())
    }

    /// Whether the particles turn: with friction, or with necks that resist it.
    pub(crate) fn rotates(&self) -> bool {
        self.around.friction.is_some() || self.has_necks()
    }

    /// Whether sintered necks resist shear and rolling.
    pub(crate) fn has_necks(&self) -> bool {
        self.material.neck_viscosity() > 0.0
    }

    /// Acceleration by gravity: the weight over the scaled mass.
    pub(crate) fn gravity(&self) -> Vec3 {
        scale(self.around.gravity_m_per_s2, 1.0 / self.drive.mass_scaling)
    }

    /// `6 pi eta` of the fluid \[Pa s\].
    pub(super) fn drag(&self) -> f64 {
        6.0 * std::f64::consts::PI * self.around.drag_viscosity_pa_s
    }
}
