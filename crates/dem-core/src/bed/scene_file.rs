//! Scene files: a bed in TOML.
//!
//! Unknown fields are refused and missing ones are named. All numbers are SI.

use serde::{Deserialize, Serialize};

use super::adhesion::{AdhesionTable, check_adhesion};
use super::closure::WhenNecksMeet;
use super::engine::Bed;
use super::error::{BedError, field, within};
use super::material::{Friction, Growing, Material, check_final_contact_ratio};
use super::packing::Radii;
use super::phase::{Mode, Phase};
use super::place::{lattice, lattice_count, packed_jammed, packed_to, packing_radii, solid_m3};
use super::region::{Region, Side};
use super::scene::Scene;
use super::start::{Start, Surroundings};
use super::vec3::norm;
use crate::densification::Approach;
use crate::{Damping, Kinetics, PairScene, PairSpec, Powder, Sintering, paper};

/// A scene as written, not yet checked.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// A name for outputs.
    pub name: String,
    /// A sentence for the reader; not used.
    #[serde(default)]
    pub description: String,
    /// The material of all particles.
    pub material: MaterialTable,
    /// The growth of contacts; left out where no phase is heated.
    pub sintering: Option<SinteringTable>,
    /// The box; left out in open space.
    #[serde(rename = "box")]
    pub region: Option<BoxTable>,
    /// The particles.
    pub particles: ParticlesTable,
    /// The adhesive force; needed with gravity, in proportion to K1 without.
    pub adhesion: Option<AdhesionTable>,
    /// Gravity.
    pub gravity: Option<GravityTable>,
    /// Drag of a fluid in the background.
    pub drag: Option<DragTable>,
    /// Friction.
    pub friction: Option<Friction>,
    /// The phases, in order.
    pub phases: Vec<Phase>,
}

/// `[material]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    /// Young's modulus \[Pa\].
    pub youngs_modulus_pa: f64,
    /// Surface tension \[N/m\].
    pub surface_tension_n_per_m: f64,
    /// Density \[kg/m3\].
    pub density_kg_per_m3: f64,
    /// Final contact ratio phi; `2^(1/3)` where it is left out.
    #[serde(default = "coalesced")]
    pub final_contact_ratio: f64,
    /// Loading stiffness K1 \[N/m\].
    #[serde(default = "k1")]
    pub k1_n_per_m: f64,
    /// K2max over K1.
    #[serde(default = "k2_max")]
    pub k2_max_over_k1: f64,
    /// Kc over K1.
    #[serde(default = "kc")]
    pub kc_over_k1: f64,
    /// Coefficient of restitution of the loading branch.
    #[serde(default = "restitution")]
    pub restitution: f64,
}

fn coalesced() -> f64 {
    2f64.cbrt()
}
fn k1() -> f64 {
    paper::K1_N_PER_M
}
fn k2_max() -> f64 {
    paper::K2_MAX_OVER_K1
}
fn kc() -> f64 {
    paper::KC_OVER_K1
}
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
fn restitution() -> f64 {
    0.1
}

/// `[sintering]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SinteringTable {
    /// Name of the kinetics.
    pub kinetics: String,
    /// Fluidity \[1/(Pa s)\].
    pub c1: f64,
    /// Sintering time at the calibrated radius \[s\].
    pub tau_s: f64,
    /// Cut-off distance \[m\].
    pub delta_c: f64,
    /// Relaxation time of the kinetics `bellehumeur` \[s\].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lambda: f64,
    /// Radius that `tau_s` was calibrated at \[m\].
    pub calibrated_radius_m: f64,
    /// How far particles approach each other while their neck grows: `overlap`, `energy-balance` or `kingery-berg`.
    #[serde(default)]
    pub approach: Approach,
    /// Resistance of necks to shear, rolling and twist, over that of a Newtonian neck; 0 for none.
    #[serde(default)]
    pub neck_viscosity: f64,
    /// What follows where the necks of the particles meet: `closure` or `stop`.
    #[serde(default)]
    pub when_necks_meet: WhenNecksMeet,
}

/// `[box]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// Lengths \[m\]; left out, a packing makes the box, a cube.
    pub size_m: Option<[f64; 3]>,
    /// Sides of each axis: `open`, `periodic`, `walls` or `lower-wall`.
    pub sides: [Side; 3],
    /// Whether a box that is periodic on all sides shrinks with its particles (quasi-static phases).
    #[serde(default)]
    pub free: bool,
}

/// `[particles.table]`, `[particles.lattice]` or `[particles.packing]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum ParticlesTable {
    /// A list.
    Table {
        /// Centres \[m\].
        positions_m: Vec<[f64; 3]>,
        /// Radii \[m\].
        radii_m: Vec<f64>,
        /// Velocities \[m/s\]; left out, all rest.
        #[serde(default)]
        velocities_m_per_s: Vec<[f64; 3]>,
    },
    /// Equal particles on a simple cubic lattice.
    Lattice {
        /// Number along each axis.
        counts: [usize; 3],
        /// Radius \[m\].
        radius_m: f64,
        /// Overlap of neighbours in radii; left out, that of the adhesive contact.
        overlap: Option<f64>,
        /// Centre of the first one \[m\]; left out, where it touches the corner of the box.
        origin_m: Option<[f64; 3]>,
    },
    /// A random packing.
    Packing {
        /// Number.
        count: usize,
        /// Relative density; left out, the particles are jammed.
        relative_density: Option<f64>,
        /// Radii.
        radii: Radii,
        /// Seed of positions and radii.
        seed: u64,
    },
}

/// `[gravity]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct GravityTable {
    /// Acceleration \[m/s2\].
    pub acceleration_m_per_s2: [f64; 3],
    /// Largest load on a bottom particle over fa that heating may start with.
    #[serde(default = "allowed_load")]
    pub allowed_load_over_adhesion: f64,
}

fn allowed_load() -> f64 {
    0.1
}

/// `[drag]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DragTable {
    /// Viscosity of the fluid \[Pa s\].
    pub viscosity_pa_s: f64,
}

impl SceneFile {
    /// Parses TOML; `place` is the file's name, for messages.
    ///
    /// # Errors
    ///
    /// [`BedError::File`] with the line and the field.
    pub fn parse(text: &str, place: &str) -> Result<Self, BedError> {
        toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map(|span| 1 + text[..span.start].bytes().filter(|&byte| byte == b'\n').count());
            BedError::File {
                place: line.map_or_else(|| place.to_owned(), |line| format!("{place}:{line}")),
                message: error.message().replace('\n', ", "),
            }
        })
    }

    fn radii_m(&self) -> Result<Vec<f64>, BedError> {
        match &self.particles {
            ParticlesTable::Table { radii_m, .. } => Ok(radii_m.clone()),
            ParticlesTable::Lattice { counts, radius_m, .. } => {
                Ok(vec![*radius_m; lattice_count(counts)?])
            }
            ParticlesTable::Packing { count, radii, seed, .. } => {
                packing_radii(*count, radii, *seed)
            }
        }
    }

    /// Checks everything that needs no packing and no particle positions.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the field, its value and the remedy.
    pub fn outline(&self) -> Result<Outline, BedError> {
        self.check_forces()?;
        check_final_contact_ratio(self.material.final_contact_ratio)?;
        let radii_m = self.radii_m()?;
        for (particle, &radius_m) in radii_m.iter().enumerate() {
            let name = match &self.particles {
                ParticlesTable::Table { .. } => format!("particles.table.radii_m[{particle}]"),
                _ => format!("radius_m of particle {particle}"),
            };
            within(&name, radius_m, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
        }
        let particles = radii_m.len();
        if particles == 0 {
            let remedy = "the table is empty: give a position and a radius for each particle";
            return Err(field("particles.table.radii_m", "[]", remedy));
        }
        let mean_radius_m = radii_m.iter().sum::<f64>() / particles as f64;
        let material = self.material_of(mean_radius_m)?;
        let growing = self.growing()?;
        for (index, phase) in self.phases.iter().enumerate() {
            phase.check(index, growing.is_some())?;
            if let Some(k1) = phase.k1_n_per_m {
                let softer = material.with_k1(k1);
                softer.map_err(|error| match self.in_words_of_the_file(error) {
                    BedError::Adhesion { k1, overlap, needed_k1, .. } => {
                        let place = phase.field_name(index, "k1_n_per_m");
                        BedError::Adhesion { place, k1, overlap, needed_k1 }
                    }
                    other => other,
                })?;
            }
        }
        if self.phases.is_empty() {
            return Err(field("phases", "none", "give at least one [[phases]]"));
        }
        let free_box = self.free_box();
        if free_box
            && self.region.as_ref().is_some_and(|region| region.sides != [Side::Periodic; 3])
        {
            let remedy = "only a box that is periodic on all sides can shrink freely";
            return Err(field("box.free", "true", remedy));
        }
        let heated_dynamic =
            |(_, phase): &(usize, &Phase)| phase.heated && phase.mode == Mode::Dynamic && free_box;
        if let Some((index, phase)) = self.phases.iter().enumerate().find(heated_dynamic) {
            let remedy = "a free box is followed by mode = \"quasi-static\" only";
            return Err(field(phase.field_name(index, "mode"), "dynamic", remedy));
        }
        let allowed = self.allowed_load();
        within("gravity.allowed_load_over_adhesion", allowed, 1e-6, 1e6, "use 1e-6 to 1e6")?;
        let phase_k1_n_per_m = self.phases.iter().map(|phase| material.k1_of(phase)).collect();
        Ok(Outline { particles, mean_radius_m, growing, phase_k1_n_per_m })
    }

    /// Checks everything and places the particles, making packings.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the field, its value and the remedy.
    pub fn build(&self) -> Result<Scene, BedError> {
        let Outline { growing, .. } = self.outline()?;
        let (start, region) = self.place()?;
        let material = self.material_of(start.mean_radius_m())?;
        let around = Surroundings {
            region,
            gravity_m_per_s2: self.gravity.as_ref().map_or([0.0; 3], |g| g.acceleration_m_per_s2),
            drag_viscosity_pa_s: self.drag.as_ref().map_or(0.0, |drag| drag.viscosity_pa_s),
            friction: self.friction,
        };
        for (particle, (&position_m, &radius_m)) in
            start.position_m.iter().zip(&start.radius_m).enumerate()
        {
            for axis in 0..3 {
                let inside = (0.0..=region.size_m[axis]).contains(&position_m[axis]);
                if region.sides[axis] == Side::Periodic && !inside {
                    return Err(BedError::OutsideBox { particle, position_m, radius_m, axis });
                }
            }
        }
        let bed = Bed::new(material, around, &start)?;
        let scene = Scene {
            name: self.name.clone(),
            bed,
            growing,
            heat: None,
            phases: self.phases.clone(),
            free_box: self.free_box(),
            when_necks_meet: self.sintering.as_ref().map(|s| s.when_necks_meet).unwrap_or_default(),
            allowed_load_over_adhesion: self.allowed_load(),
        };
        if scene.phases.iter().any(|phase| phase.heated) && scene.bed.load_stays() {
            scene.check_load(&scene.bed)?;
        }
        Ok(scene)
    }

    fn free_box(&self) -> bool {
        self.region.as_ref().is_some_and(|region| region.free)
    }

    fn allowed_load(&self) -> f64 {
        self.gravity.as_ref().map_or_else(allowed_load, |g| g.allowed_load_over_adhesion)
    }

    fn place(&self) -> Result<(Start, Region), BedError> {
        match &self.particles {
            ParticlesTable::Table { positions_m, radii_m, velocities_m_per_s } => {
                let start = Start {
                    position_m: positions_m.clone(),
                    radius_m: radii_m.clone(),
                    velocity_m_per_s: velocities_m_per_s.clone(),
                    ..Start::default()
                };
                Ok((start, self.given_box()?))
            }
            ParticlesTable::Lattice { counts, radius_m, overlap, origin_m } => {
                let name = "particles.lattice.radius_m";
                within(name, *radius_m, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
                let pair = self.material_of(*radius_m)?.pair_of_radius(*radius_m)?;
                let adhesive = pair.x0() * self.approach().factor();
                let overlap = overlap.unwrap_or(adhesive);
                let remedy = "use -100 radii up to the overlap of the adhesive contact, which is that of a field left out";
                let most = adhesive * (1.0 + 1e-6);
                within("particles.lattice.overlap", overlap, -100.0, most, remedy)?;
                let origin_m = origin_m.unwrap_or([*radius_m; 3]);
                Ok((lattice(counts, *radius_m, overlap, origin_m)?, self.given_box()?))
            }
            ParticlesTable::Packing { count, relative_density, radii, seed } => {
                let radius_m = packing_radii(*count, radii, *seed)?;
                let table = self.region.as_ref().ok_or_else(|| {
                    field("box", "left out", "a packing needs a box: give at least box.sides")
                })?;
                let (size_m, sides) = (table.size_m, table.sides);
                match relative_density {
                    None => packed_jammed(radius_m, size_m, sides, *seed),
                    Some(density) => packed_to(*density, radius_m, size_m, sides, *seed),
                }
            }
        }
    }

    /// The box around particles that do not make it.
    fn given_box(&self) -> Result<Region, BedError> {
        let Some(table) = &self.region else { return Ok(Region::OPEN) };
        let size_m = table.size_m.ok_or_else(|| {
            field("box.size_m", "left out", "give the size; only a packing makes it")
        })?;
        Ok(Region { size_m, sides: table.sides })
    }

    fn material_of(&self, radius_m: f64) -> Result<Material, BedError> {
        let table = &self.material;
        let mut spec = PairSpec::new(
            Powder {
                radius_m,
                youngs_modulus_pa: table.youngs_modulus_pa,
                surface_tension_n_per_m: table.surface_tension_n_per_m,
                density_kg_per_m3: table.density_kg_per_m3,
            },
            table.final_contact_ratio,
        );
        spec.k1 = table.k1_n_per_m;
        spec.k2_max_over_k1 = table.k2_max_over_k1;
        spec.kc_over_k1 = table.kc_over_k1;
        spec.damping = Damping::Restitution(table.restitution);
        let neck_viscosity = self.sintering.as_ref().map_or(0.0, |table| table.neck_viscosity);
        let material = Material::new(spec)?.with_approach(self.approach());
        let material = material.with_neck_viscosity(neck_viscosity)?;
        match self.adhesion_n(radius_m) {
            Some(force_n) => {
                let material = material.with_adhesion(force_n / radius_m);
                material.map_err(|error| self.in_words_of_the_file(error))
            }
            None => Ok(material),
        }
    }

    /// The pair of two particles of a radius of this scene.
    ///
    /// # Errors
    ///
    /// [`BedError`] as for the bed.
    pub fn pair_of_radius(&self, radius_m: f64) -> Result<PairScene, BedError> {
        self.material_of(radius_m)?.pair_of_radius(radius_m)
    }

    fn approach(&self) -> Approach {
        self.sintering.as_ref().map(|table| table.approach).unwrap_or_default()
    }

    /// The adhesive force of two particles of a radius \[N\], where it is stated.
    fn adhesion_n(&self, radius_m: f64) -> Option<f64> {
        let weight =
            self.material.density_kg_per_m3 * solid_m3(&[radius_m]) * self.gravity_m_per_s2();
        self.adhesion.as_ref()?.force_of(weight)
    }

    /// An error of the adhesive force with the fields of this file.
    fn in_words_of_the_file(&self, error: BedError) -> BedError {
        match &self.adhesion {
            Some(table) => table.named(error),
            None => error,
        }
    }

    fn gravity_m_per_s2(&self) -> f64 {
        self.gravity.as_ref().map_or(0.0, |g| norm(g.acceleration_m_per_s2))
    }

    /// Checks adhesion against gravity, and friction against the modes.
    fn check_forces(&self) -> Result<(), BedError> {
        let gravity = self.gravity_m_per_s2();
        within("gravity.acceleration_m_per_s2", gravity, 0.0, 1e6, "use 0 to 1e6 m/s2")?;
        check_adhesion(self.adhesion.as_ref(), gravity > 0.0)?;
        let still = self.phases.iter().find(|phase| phase.mode == Mode::QuasiStatic);
        let rubs = self.friction.filter(|friction| friction.coefficient != 0.0);
        if let (Some(_), Some(phase)) = (rubs, still) {
            let remedy = "a balance of forces has no friction: use mode = \"dynamic\" in every phase (mass_scaling makes it \
                          shorter), or leave [friction] out";
            let with = format!("given with the quasi-static phase {}", phase.name);
            return Err(field("friction", with, remedy));
        }
        Ok(())
    }

    fn growing(&self) -> Result<Option<Growing>, BedError> {
        let Some(table) = &self.sintering else { return Ok(None) };
        let kinetics: Kinetics = table.kinetics.parse().map_err(|_| {
            let remedy =
                "use three-stage, frenkel, pokluda, three-stage-pokluda, regime-map or bellehumeur";
            field("sintering.kinetics", &table.kinetics, remedy)
        })?;
        let radius = table.calibrated_radius_m;
        within("sintering.calibrated_radius_m", radius, 1e-9, 1e3, "give it in metres")?;
        Ok(Some(Growing {
            kinetics,
            sintering: Sintering {
                c1: table.c1,
                tau_s: table.tau_s,
                delta_c: table.delta_c,
                lambda: table.lambda,
            },
            calibrated_radius_m: radius,
        }))
    }
}

/// A scene file before its particles are placed.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Number of particles.
    pub particles: usize,
    /// Mean of their radii \[m\].
    pub mean_radius_m: f64,
    /// Growth of contacts, where the scene has it.
    pub growing: Option<Growing>,
    /// Loading stiffness K1 of each phase \[N/m\].
    pub phase_k1_n_per_m: Vec<f64>,
}
