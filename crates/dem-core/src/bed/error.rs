//! Errors of a bed and of its run.

use thiserror::Error;

use crate::{SceneError, SolveError};

/// A bed that cannot be made, or a run of it that cannot be finished.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BedError {
    /// A field is outside its range.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field, as it is called in the scene file.
        field: String,
        /// Its value.
        value: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// The scene file is not TOML, misses a field, or has one that is not known.
    #[error("{place}: {message}")]
    File {
        /// File and line.
        place: String,
        /// The mistake and the remedy.
        message: String,
    },
    /// The material and its contact law do not go together.
    #[error("material: {0}")]
    Material(#[from] SceneError),
    /// The sintering parameters cannot be used.
    #[error("sintering: {0}")]
    Sintering(#[from] SolveError),
    /// Two particles overlap at the start by more than an adhesive contact.
    #[error(
        "particles {first} and {second} overlap by {overlap} effective radii at the start, more than the adhesive \
         contact's {allowed}: move them apart",
        overlap = short(overlap),
        allowed = short(allowed),
    )]
    OverlappingStart {
        /// One particle, by its place in the scene.
        first: usize,
        /// The other.
        second: usize,
        /// Overlap in effective radii.
        overlap: f64,
        /// The largest overlap that a scene may start with, in effective radii.
        allowed: f64,
    },
    /// A particle is outside the box.
    #[error(
        "particle {particle} at {position_m:?} m with radius {radius_m} m reaches out of the box along axis {axis}: \
         move it inside or enlarge box.size_m",
        radius_m = short(radius_m),
    )]
    OutsideBox {
        /// The particle, by its place in the scene.
        particle: usize,
        /// Its centre.
        position_m: [f64; 3],
        /// Its radius.
        radius_m: f64,
        /// 0, 1 or 2.
        axis: usize,
    },
    /// A periodic side is so short that a particle could touch two images of another.
    #[error(
        "box.size_m[{axis}] = {size_m} m is periodic and shorter than twice the reach of the neighbour list, {needed_m} m: \
         enlarge the box or take more particles",
        needed_m = short_up(needed_m),
        size_m = short(size_m),
    )]
    PeriodicSideTooShort {
        /// 0, 1 or 2.
        axis: usize,
        /// Its length.
        size_m: f64,
        /// Length that it must exceed \[m\].
        needed_m: f64,
    },
    /// The time step is not stable for the present contacts.
    #[error(
        "step of {step_s} s at t = {time_s} s is at or above the stability limit {limit_s} s of a particle with \
         {contacts} contacts: lower step_over_collision_time below {}",
        short(&(0.999 * step_over_collision_time * limit_s / step_s)),
        step_s = short(step_s),
        time_s = short(time_s),
        limit_s = short(limit_s),
    )]
    UnstableStep {
        /// The step.
        step_s: f64,
        /// The setting that gave it.
        step_over_collision_time: f64,
        /// Largest stable step \[s\].
        limit_s: f64,
        /// Contacts of the particle that decides.
        contacts: usize,
        /// Time \[s\].
        time_s: f64,
    },
    /// A particle moved further in one step than the neighbour list can follow, or to a place that is not a number.
    #[error(
        "at t = {time_s} s a particle moves {displacement_m} m in one step, more than the {allowed_m} m that the neighbour \
         list allows: lower the starting velocities or step_over_collision_time",
        time_s = short(time_s),
        displacement_m = short(displacement_m),
        allowed_m = short(allowed_m),
    )]
    RunAway {
        /// Time \[s\].
        time_s: f64,
        /// Displacement in one step \[m\].
        displacement_m: f64,
        /// Largest displacement allowed \[m\].
        allowed_m: f64,
    },
    /// No packing of the wanted density was found.
    #[error(
        "a random packing of relative density {wished} was not reached: {particles} particles jam at about {reached}; \
         wish for less, or use a lattice",
        reached = short(reached),
    )]
    PackingDensity {
        /// Wanted relative density.
        wished: f64,
        /// Relative density reached without overlaps.
        reached: f64,
        /// Number of particles.
        particles: usize,
    },
    /// The weight of the bed, and not adhesion, would drive the growth of its contacts.
    #[error(
        "adhesion: the load on a particle at the bottom of the bed, {load_over_adhesion} of the adhesive force, would drive the growth; \
         heat fewer layers, state an adhesion.force_n of {needed_n} N or more, or allow it by gravity.allowed_load_over_adhesion \
         (now {allowed})",
        allowed = short(allowed),
        load_over_adhesion = short(load_over_adhesion),
        needed_n = short_up(needed_n),
    )]
    WeightDrives {
        /// Load on a bottom contact over fa.
        load_over_adhesion: f64,
        /// The largest ratio allowed.
        allowed: f64,
        /// An adhesive force that would do \[N\].
        needed_n: f64,
    },
    /// The contacts are too soft for the adhesive force that is stated.
    #[error(
        "{place} = {k1}: the adhesive force alone would press two particles {overlap} radii into each other, and hard \
         particles are meant; a K1 of {needed_k1} N/m or more will do, or a smaller adhesion",
        overlap = short(overlap),
        needed_k1 = short_up(needed_k1),
    )]
    Adhesion {
        /// The field of the stiffness, as it is called in the scene file.
        place: String,
        /// The loading stiffness.
        k1: f64,
        /// Overlap by adhesion, in effective radii.
        overlap: f64,
        /// A stiffness that would do.
        needed_k1: f64,
    },
    /// The contacts are so soft that the bed is denser than its matter.
    #[error(
        "at t = {time_s} s the particles overlap so far that the relative density would be {relative_density}: \
         raise k1_n_per_m (now {k1}), or lower what presses the bed",
        time_s = short(time_s),
        relative_density = short(relative_density),
    )]
    Overfull {
        /// Time \[s\].
        time_s: f64,
        /// Mass over density and bed volume.
        relative_density: f64,
        /// The loading stiffness.
        k1: f64,
    },
    /// Mass scaling has made inertia too large.
    #[error(
        "at t = {time_s} s the inertial number {inertial_number} exceeds inertial_number_limit = {limit}: lower mass_scaling, \
         or use mode = \"quasi-static\"",
        time_s = short(time_s),
        inertial_number = short(inertial_number),
    )]
    Inertia {
        /// Time \[s\].
        time_s: f64,
        /// The inertial number.
        inertial_number: f64,
        /// Its limit.
        limit: f64,
    },
    /// The quasi-static mode found no force balance.
    #[error(
        "no force balance at t = {time_s} s after {iterations} iterations: residual force {residual} of the adhesive force, \
         wanted {wanted}; begin with a phase of mode = \"dynamic\" in which the bed comes to rest, or heat in that mode",
        time_s = short(time_s),
        residual = short(residual),
        wanted = short(wanted),
    )]
    NoBalance {
        /// Time \[s\].
        time_s: f64,
        /// Iterations spent.
        iterations: u64,
        /// Residual force reached, over fa.
        residual: f64,
        /// Residual force wanted, over fa.
        wanted: f64,
    },
    /// The quasi-static mode came near no force balance in ever shorter steps.
    #[error(
        "at t = {time_s} s contacts open and close, or particles roll, without an end in force balance; begin with a phase of \
         mode = \"dynamic\" in which the bed comes to rest, or heat in that mode",
        time_s = short(time_s),
    )]
    NoRest {
        /// Time \[s\].
        time_s: f64,
    },
    /// A particle has no support against gravity in the quasi-static mode.
    #[error(
        "at t = {time_s} s nothing carries particle {particle} along axis {axis}, where gravity acts: no chain of contacts leads from it to \
         a wall across that axis, and a balance of forces follows no fall; begin with a phase of mode = \"dynamic\" in which the \
         bed comes to rest on a wall (box.sides), or leave [gravity] out",
        time_s = short(time_s),
    )]
    NothingCarries {
        /// The particle, by its place in the scene.
        particle: usize,
        /// 0, 1 or 2.
        axis: usize,
        /// Time \[s\].
        time_s: f64,
    },
    /// The run used all the work it was allowed.
    #[error(
        "max_work = {max_work} steps were used up at t = {time_s} s: raise max_work",
        time_s = short(time_s),
    )]
    WorkLimit {
        /// The limit.
        max_work: u64,
        /// Time reached.
        time_s: f64,
    },
    /// A checkpoint cannot be read.
    #[error("checkpoint: {0}")]
    Checkpoint(&'static str),
}

/// A number that is needed, to four digits and not less.
fn short_up(value: &f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(*value);
    short(&if rounded < *value { value * (1.0 + 5e-4) } else { *value })
}

/// A number that was computed, to four digits.
fn short(value: &f64) -> String {
    let rounded = format!("{value:.3e}").parse().unwrap_or(*value);
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}

pub(crate) fn field(
    field: impl Into<String>,
    value: impl std::fmt::Display,
    remedy: &'static str,
) -> BedError {
    BedError::Field { field: field.into(), value: value.to_string(), remedy }
}

/// Refuses what is not within the bounds, NaN included.
pub(crate) fn within(
    name: &str,
    value: f64,
    low: f64,
    high: f64,
    remedy: &'static str,
) -> Result<(), BedError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(field(name, value, remedy)) }
}
