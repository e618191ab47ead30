//! Scene files: what a bed is, in TOML.
//!
//! A field that is not known is refused, and a field that is missing is named. All numbers are SI.

use serde::{Deserialize, Serialize};

use super::engine::{Bed, Start, Surroundings};
use super::error::{BedError, field, within};
use super::material::{Friction, Growing, Material};
use super::packing::{Radii, jammed_packing, random_packing};
use super::region::{Region, Side};
use crate::{Damping, Kinetics, PairSpec, Powder, Sintering, paper};

/// A scene as it is written, not yet checked.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// A name for outputs.
    pub name: String,
    /// What it shows; not used.
    #[serde(default)]
    pub description: String,
    /// The material of all particles.
    pub material: MaterialTable,
    /// The growth of contacts; left out where no phase is heated.
    pub sintering: Option<SinteringTable>,
    /// The box; left out where there is nothing around the particles.
    #[serde(rename = "box")]
    pub region: Option<BoxTable>,
    /// The particles: one of three ways.
    pub particles: ParticlesTable,
    /// Gravity.
    pub gravity: Option<GravityTable>,
    /// Drag of a fluid in the background.
    pub drag: Option<DragTable>,
    /// Friction.
    pub friction: Option<FrictionTable>,
    /// What happens, in order.
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
    /// Radius that `tau_s` was calibrated at \[m\].
    pub calibrated_radius_m: f64,
}

/// `[box]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// Lengths \[m\]; left out, a packing makes the box, a cube.
    pub size_m: Option<[f64; 3]>,
    /// What is at the two ends of each axis: `open`, `periodic`, `walls` or `lower-wall`.
    pub sides: [SideName; 3],
    /// Whether a box that is periodic on all sides shrinks with its particles (quasi-static phases).
    #[serde(default)]
    pub free: bool,
}

/// Name of a [`Side`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SideName {
    /// [`Side::Open`].
    Open,
    /// [`Side::Periodic`].
    Periodic,
    /// [`Side::Walls`].
    Walls,
    /// [`Side::LowerWall`].
    LowerWall,
}

impl From<SideName> for Side {
    fn from(name: SideName) -> Self {
        match name {
            SideName::Open => Self::Open,
            SideName::Periodic => Self::Periodic,
            SideName::Walls => Self::Walls,
            SideName::LowerWall => Self::LowerWall,
        }
    }
}

/// `[particles.table]`, `[particles.lattice]` or `[particles.packing]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum ParticlesTable {
    /// One by one.
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
        /// How many along each axis.
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
        /// How many.
        count: usize,
        /// Relative density; left out, the particles are jammed.
        relative_density: Option<f64>,
        /// Radii.
        radii: RadiiTable,
        /// Seed of positions and radii.
        seed: u64,
    },
}

/// `radii = { equal = {..} }`, `{ log-normal = {..} }` or `{ histogram = {..} }`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum RadiiTable {
    /// [`Radii::Equal`].
    Equal {
        /// Radius \[m\].
        radius_m: f64,
    },
    /// [`Radii::LogNormal`].
    LogNormal {
        /// Median \[m\].
        median_m: f64,
        /// Standard deviation of the logarithm.
        sigma: f64,
    },
    /// [`Radii::Histogram`].
    Histogram {
        /// Edges \[m\].
        edges_m: Vec<f64>,
        /// Weights.
        weights: Vec<f64>,
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

/// `[friction]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionTable {
    /// Coefficient of friction.
    pub coefficient: f64,
    /// k_t over K1.
    #[serde(default = "two_sevenths")]
    pub tangential_stiffness_over_k1: f64,
    /// gamma_t over gamma_n.
    #[serde(default = "half")]
    pub tangential_damping_over_normal: f64,
}

fn two_sevenths() -> f64 {
    2.0 / 7.0
}
fn half() -> f64 {
    0.5
}

/// How a phase is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Newton's law.
    #[default]
    Dynamic,
    /// Force balance at every instant.
    QuasiStatic,
}

/// `[[phases]]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// A name for outputs.
    pub name: String,
    /// How long it is \[s\].
    pub duration_s: f64,
    /// Whether contacts grow.
    pub heated: bool,
    /// How it is computed.
    #[serde(default)]
    pub mode: Mode,
    /// Number of observations, evenly spread over the phase.
    #[serde(default = "outputs")]
    pub outputs: usize,
    /// Step over collision time (dynamic).
    #[serde(default = "step")]
    pub step_over_collision_time: f64,
    /// Factor on inertia (dynamic).
    #[serde(default = "one")]
    pub mass_scaling: f64,
    /// Largest inertial number at an observation of a heated phase (dynamic); left out, it is only recorded.
    pub inertial_number_limit: Option<f64>,
    /// Another K1 than the material's for this phase \[N/m\]: a bed may settle with a softer one.
    pub k1_n_per_m: Option<f64>,
    /// Error of a/R that one step may make (quasi-static).
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Largest number of steps.
    #[serde(default = "max_work")]
    pub max_work: u64,
}

fn outputs() -> usize {
    100
}
fn step() -> f64 {
    0.02
}
fn one() -> f64 {
    1.0
}
fn tolerance() -> f64 {
    1e-4
}
fn max_work() -> u64 {
    1_000_000_000
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

    /// Checks what can be checked without making a packing or placing the particles.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the field, its value and the remedy.
    pub fn outline(&self) -> Result<Outline, BedError> {
        let radii_m = match &self.particles {
            ParticlesTable::Table { radii_m, .. } => radii_m.clone(),
            ParticlesTable::Lattice { counts, radius_m, .. } => {
                let total =
                    counts.iter().try_fold(1usize, |total, &count| total.checked_mul(count));
                match total {
                    Some(total @ 1..=10_000_000) => vec![*radius_m; total],
                    _ => {
                        let remedy = "use 1 to 1e7 particles in all";
                        let counts = format!("{counts:?}");
                        return Err(field("particles.lattice.counts", counts, remedy));
                    }
                }
            }
            ParticlesTable::Packing { count, radii, seed, .. } => {
                if !(1..=10_000_000).contains(count) {
                    return Err(field("particles.packing.count", count, "use 1 to 1e7"));
                }
                radii.checked().draw(*count, *seed)?
            }
        };
        for (particle, &radius_m) in radii_m.iter().enumerate() {
            let name = format!("radius_m of particle {particle}");
            within(&name, radius_m, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
        }
        let particles = radii_m.len();
        let mean_radius_m = radii_m.iter().sum::<f64>() / particles.max(1) as f64;
        if particles > 0 {
            self.material_of(mean_radius_m)?;
        }
        let growing = self.growing()?;
        for (index, phase) in self.phases.iter().enumerate() {
            phase.check(index, growing.is_some())?;
        }
        if self.phases.is_empty() {
            return Err(field("phases", "none", "give at least one [[phases]]"));
        }
        let free_box = self.region.as_ref().is_some_and(|region| region.free);
        if free_box
            && self
                .region
                .as_ref()
                .is_some_and(|r| r.sides.iter().any(|s| *s != SideName::Periodic))
        {
            let remedy = "only a box that is periodic on all sides can shrink freely";
            return Err(field("box.free", "true", remedy));
        }
        let heated_dynamic =
            |phase: &&Phase| phase.heated && phase.mode == Mode::Dynamic && free_box;
        if let Some(phase) = self.phases.iter().find(heated_dynamic) {
            let remedy = "a free box is followed by mode = \"quasi-static\" only";
            return Err(field("mode of phase", &phase.name, remedy));
        }
        let allowed = self.gravity.as_ref().map_or(0.1, |g| g.allowed_load_over_adhesion);
        within("gravity.allowed_load_over_adhesion", allowed, 1e-6, 1e6, "use 1e-6 to 1e6")?;
        Ok(Outline { particles, mean_radius_m, growing })
    }

    /// Checks everything, makes packings and places the particles.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the field, its value and the remedy.
    pub fn build(&self) -> Result<Scene, BedError> {
        let Outline { growing, .. } = self.outline()?;
        let (start, region) = self.particles()?;
        let radius_m = start.radius_m.iter().sum::<f64>() / start.radius_m.len().max(1) as f64;
        let material = self.material_of(radius_m)?;
        let free_box = self.region.as_ref().is_some_and(|region| region.free);
        let allowed = self.gravity.as_ref().map_or(0.1, |g| g.allowed_load_over_adhesion);
        let around = Surroundings {
            region,
            gravity_m_per_s2: self.gravity.as_ref().map_or([0.0; 3], |g| g.acceleration_m_per_s2),
            drag_viscosity_pa_s: self.drag.as_ref().map_or(0.0, |drag| drag.viscosity_pa_s),
            friction: self.friction.as_ref().map(|friction| Friction {
                coefficient: friction.coefficient,
                tangential_stiffness_over_k1: friction.tangential_stiffness_over_k1,
                tangential_damping_over_normal: friction.tangential_damping_over_normal,
            }),
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
        Ok(Scene {
            name: self.name.clone(),
            bed,
            growing,
            phases: self.phases.clone(),
            free_box,
            allowed_load_over_adhesion: allowed,
        })
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
        Material::new(spec)
    }

    fn growing(&self) -> Result<Option<Growing>, BedError> {
        let Some(table) = &self.sintering else { return Ok(None) };
        let kinetics: Kinetics = table.kinetics.parse().map_err(|_| {
            let remedy = "use three-stage, frenkel, pokluda, three-stage-pokluda or regime-map";
            field("sintering.kinetics", &table.kinetics, remedy)
        })?;
        let radius = table.calibrated_radius_m;
        within("sintering.calibrated_radius_m", radius, 1e-9, 1e3, "give it in metres")?;
        Ok(Some(Growing {
            kinetics,
            sintering: Sintering { c1: table.c1, tau_s: table.tau_s, delta_c: table.delta_c },
            calibrated_radius_m: radius,
        }))
    }

    fn particles(&self) -> Result<(Start, Region), BedError> {
        let sides = self.region.as_ref().map(|region| region.sides.map(Side::from));
        let size = self.region.as_ref().and_then(|region| region.size_m);
        let given = match (sides, size) {
            (None, _) => Some(Region::OPEN),
            (Some(sides), Some(size_m)) => Some(Region { size_m, sides }),
            (Some(_), None) => None,
        };
        let must = || field("box.size_m", "left out", "give the size; only a packing makes it");
        match &self.particles {
            ParticlesTable::Table { positions_m, radii_m, velocities_m_per_s } => Ok((
                Start {
                    position_m: positions_m.clone(),
                    radius_m: radii_m.clone(),
                    velocity_m_per_s: velocities_m_per_s.clone(),
                    ..Start::default()
                },
                given.ok_or_else(must)?,
            )),
            ParticlesTable::Lattice { counts, radius_m, overlap, origin_m } => {
                let name = "particles.lattice.radius_m";
                within(name, *radius_m, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
                let pair = self.material_of(*radius_m)?.pair_of_radius(*radius_m)?;
                let overlap = overlap.unwrap_or_else(|| pair.x0());
                within("particles.lattice.overlap", overlap, -100.0, 1.0, "use -100 to 1 radii")?;
                let total = counts.iter().product::<usize>();
                if total == 0 || total > 10_000_000 {
                    let remedy = "use 1 to 1e7 particles in all";
                    return Err(field("particles.lattice.counts", format!("{counts:?}"), remedy));
                }
                let spacing = (2.0 - overlap) * radius_m;
                let origin = origin_m.unwrap_or([*radius_m; 3]);
                let mut start = Start { radius_m: vec![*radius_m; total], ..Start::default() };
                for i in 0..total {
                    let at = [i % counts[0], i / counts[0] % counts[1], i / counts[0] / counts[1]];
                    start
                        .position_m
                        .push([0, 1, 2].map(|axis| origin[axis] + at[axis] as f64 * spacing));
                }
                Ok((start, given.ok_or_else(must)?))
            }
            ParticlesTable::Packing { count, relative_density, radii, seed } => {
                if !(1..=10_000_000).contains(count) {
                    return Err(field("particles.packing.count", count, "use 1 to 1e7"));
                }
                let radius_m = radii.checked().draw(*count, *seed)?;
                let solid = 4.0 / 3.0
                    * std::f64::consts::PI
                    * radius_m.iter().map(|r| r.powi(3)).sum::<f64>();
                let sides = sides.ok_or_else(|| {
                    field("box", "left out", "a packing needs a box: give at least box.sides")
                })?;
                let cube = |density: f64| Region { size_m: [(solid / density).cbrt(); 3], sides };
                let Some(density) = *relative_density else {
                    if size.is_some() {
                        let remedy = "leave it out, or give particles.packing.relative_density";
                        return Err(field("box.size_m", "given for a jammed packing", remedy));
                    }
                    let overlap = 0.3 * paper::ADHESION_OVER_K1_RADIUS;
                    let (packed, position_m) =
                        jammed_packing(&cube(0.58), &radius_m, overlap, *seed)?;
                    let region = Region { sides, ..packed };
                    return Ok((Start { position_m, radius_m, ..Start::default() }, region));
                };
                let name = "particles.packing.relative_density";
                within(name, density, 1e-6, 1.0, "use 1e-6 to 1; random packings reach 0.6")?;
                // In a box that is given, the packing takes as much of its height as it needs.
                let mut filled = cube(density);
                if let Some(size_m) = size {
                    let height = solid / (density * size_m[0] * size_m[1]);
                    if height > size_m[2] {
                        let reached = solid / (size_m[0] * size_m[1] * size_m[2]);
                        let remedy =
                            "the particles need more than the box: enlarge it or take fewer";
                        return Err(field(
                            name,
                            format!("{density} (full box: {reached})"),
                            remedy,
                        ));
                    }
                    filled.size_m = [size_m[0], size_m[1], height];
                    if height < size_m[2] && sides[2] == Side::Periodic {
                        let remedy = "a periodic box must be filled: leave box.size_m out";
                        return Err(field("box.size_m", format!("{size_m:?}"), remedy));
                    }
                }
                let position_m = random_packing(&filled, &radius_m, *seed)?;
                let region = size.map_or(filled, |size_m| Region { size_m, sides });
                Ok((Start { position_m, radius_m, ..Start::default() }, region))
            }
        }
    }
}

impl RadiiTable {
    fn checked(&self) -> Radii {
        match self.clone() {
            Self::Equal { radius_m } => Radii::Equal { radius_m },
            Self::LogNormal { median_m, sigma } => Radii::LogNormal { median_m, sigma },
            Self::Histogram { edges_m, weights } => Radii::Histogram { edges_m, weights },
        }
    }
}

impl Phase {
    fn check(&self, index: usize, can_heat: bool) -> Result<(), BedError> {
        let name = |name: &str| format!("phases[{index}].{name}");
        let duration = self.duration_s;
        within(
            &name("duration_s"),
            duration,
            1e-12,
            1e9,
            "give the time in seconds, 1e-12 to 1e9",
        )?;
        if !(1..=1_000_000).contains(&self.outputs) {
            return Err(field(name("outputs"), self.outputs, "use 1 to 1e6"));
        }
        if self.heated && !can_heat {
            return Err(field(name("heated"), "true", "give the [sintering] table"));
        }
        let step = self.step_over_collision_time;
        within(&name("step_over_collision_time"), step, 1e-9, 1.0, "use 1e-9 to 1; 0.02 is usual")?;
        within(&name("mass_scaling"), self.mass_scaling, 1.0, 1e18, "use 1 to 1e18")?;
        within(&name("tolerance"), self.tolerance, 1e-9, 0.1, "use 1e-9 to 0.1")?;
        if let Some(k1) = self.k1_n_per_m {
            within(&name("k1_n_per_m"), k1, 1e-15, 1e15, "give it in N/m, 1e-15 to 1e15")?;
        }
        if let Some(limit) = self.inertial_number_limit {
            within(&name("inertial_number_limit"), limit, 1e-12, 1e3, "use 1e-12 to 1e3")?;
        }
        Ok(())
    }
}

/// What a scene file says, without its particles in their places.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// How many particles.
    pub particles: usize,
    /// Mean of their radii \[m\].
    pub mean_radius_m: f64,
    /// How contacts grow, where the scene says so.
    pub growing: Option<Growing>,
}

/// A checked scene, ready to [run](Scene::run).
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) bed: Bed,
    pub(crate) growing: Option<Growing>,
    pub(crate) phases: Vec<Phase>,
    pub(crate) free_box: bool,
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

    /// How contacts grow, where the scene says so.
    #[must_use]
    pub fn growing(&self) -> Option<&Growing> {
        self.growing.as_ref()
    }

    /// The same scene with other kinetics or parameters: a draw of a posterior.
    #[must_use]
    pub fn with_growing(mut self, growing: Growing) -> Self {
        self.growing = Some(growing);
        self
    }

    /// The same particles in the same places with another final contact ratio: a draw of a posterior that
    /// has one.
    ///
    /// # Errors
    ///
    /// [`BedError::Material`], for instance where contacts would start coalesced.
    pub fn with_final_contact_ratio(mut self, phi: f64) -> Result<Self, BedError> {
        let mut spec = *self.bed.material().spec();
        if phi == spec.final_contact_ratio {
            return Ok(self);
        }
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
        self.bed = Bed::new(Material::new(spec)?, *self.bed.surroundings(), &start)?;
        Ok(self)
    }

    /// The same scene with another loading stiffness, also where a phase has its own.
    ///
    /// # Errors
    ///
    /// [`BedError::Material`].
    pub fn with_k1(mut self, k1_n_per_m: f64) -> Result<Self, BedError> {
        let mut spec = *self.bed.material().spec();
        let factor = k1_n_per_m / spec.k1;
        spec.k1 = k1_n_per_m;
        self.bed.set_material(Material::new(spec)?);
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
        let mut spec = *self.bed.material().spec();
        let before = spec.k1;
        spec.k1 = k1_n_per_m;
        Material::new(spec)?;
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
