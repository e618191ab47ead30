//! The whole state of a bed as bytes, so that a run goes on with the same bits.
//!
//! Layout, little-endian: the magic, the version, every field in the order of [`Bed::checkpoint`], and the
//! FNV-1a sum of all that. A vector is its length and its elements. The description of the scene (material,
//! surroundings, growth) is not in it: a checkpoint is read into the bed of the same scene.

use super::closure::{EndRates, Law};
use super::contact::Memory;
use super::engine::{Bed, Drive};
use super::error::BedError;
use super::material::Growing;
use super::measure::{Energies, Sample};
use super::quasi_static::QuasiStaticReport;
use super::run::{Run, Series};
use super::scene::Scene;
use super::stiffness::PhaseEntry;
use super::vec3::Vec3;

const MAGIC: &[u8; 8] = b"dem-bed\0";
const RUN_MAGIC: &[u8; 8] = b"dem-run\0";
const VERSION: u64 = 4;

/// Something that is stored as a fixed number of bytes.
trait Stored: Sized {
    fn put(&self, to: &mut Vec<u8>);
    fn take(from: &mut &[u8]) -> Option<Self>;
}

macro_rules! stored_number {
    ($($number:ty),*) => {$(
        impl Stored for $number {
            fn put(&self, to: &mut Vec<u8>) {
                to.extend_from_slice(&self.to_le_bytes());
            }
            fn take(from: &mut &[u8]) -> Option<Self> {
                let (bytes, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(Self::from_le_bytes(*bytes))
            }
        }
    )*};
}
stored_number!(f64, u64, u32, u8);

impl Stored for Vec3 {
    fn put(&self, to: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(to));
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Some([f64::take(from)?, f64::take(from)?, f64::take(from)?])
    }
}

impl Stored for Memory {
    fn put(&self, to: &mut Vec<u8>) {
        [self.overlap, self.drift, self.plastic, self.pull].iter().for_each(|value| value.put(to));
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        let mut next = || f64::take(from);
        Some(Self { overlap: next()?, drift: next()?, plastic: next()?, pull: next()? })
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, to: &mut Vec<u8>) {
        (self.len() as u64).put(to);
        self.iter().for_each(|value| value.put(to));
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        let count = u64::take(from)? as usize;
        // A length that cannot be true must not reserve memory.
        if count > from.len() {
            return None;
        }
        (0..count).map(|_| T::take(from)).collect()
    }
}

impl Stored for usize {
    fn put(&self, to: &mut Vec<u8>) {
        (*self as u64).put(to);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Self::try_from(u64::take(from)?).ok()
    }
}

impl<T: Stored> Stored for Option<T> {
    fn put(&self, to: &mut Vec<u8>) {
        u8::from(self.is_some()).put(to);
        if let Some(value) = self {
            value.put(to);
        }
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        match u8::take(from)? {
            0 => Some(None),
            _ => T::take(from).map(Some),
        }
    }
}

/// A struct as its fields, in order.
macro_rules! stored_struct {
    ($name:ident: $($field:ident),*) => {
        impl Stored for $name {
            fn put(&self, to: &mut Vec<u8>) {
                $(self.$field.put(to);)*
            }
            fn take(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: Stored::take(from)?),* })
            }
        }
    };
}
stored_struct!(Energies: translation_j, rotation_j, elastic_j, springs_j, adhesion_j, gravity_j);
stored_struct!(
    Sample: time_s, relative_density, coordination, mean_contact_ratio, contact_ratio_deciles, mean_driving,
    largest_driving, inertial_number, necks_meet, law, energies
);
stored_struct!(
    QuasiStaticReport: steps, rejected, newton, conjugate_gradients, error_estimate, mean_error,
    squared_error, balanced_at_s, next_step_s
);
stored_struct!(EndRates: by_pairs, by_closed_law);
stored_struct!(PhaseEntry: k1_n_per_m, box_before_m, box_m, keeps_overlaps);
stored_struct!(Series: samples, phase, phase_start_s, quasi_static, hand_over, end_rates, entries, stopped);

impl Stored for Law {
    fn put(&self, to: &mut Vec<u8>) {
        (*self as u8).put(to);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        let stored = u8::take(from)?;
        Self::ALL.into_iter().find(|law| *law as u8 == stored)
    }
}

impl Stored for bool {
    fn put(&self, to: &mut Vec<u8>) {
        u8::from(*self).put(to);
    }
    fn take(from: &mut &[u8]) -> Option<Self> {
        Some(u8::take(from)? != 0)
    }
}

/// Adds the sum that [`unsealed`] looks at.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    sum(&bytes).put(&mut bytes);
    bytes
}

/// The content after magic and version, if it is whole.
fn unsealed<'a>(bytes: &'a [u8], magic: &[u8; 8]) -> Result<&'a [u8], BedError> {
    let damaged = BedError::Checkpoint("damaged, or not a checkpoint");
    let (content, stored_sum) = bytes.split_last_chunk::<8>().ok_or_else(|| damaged.clone())?;
    let mut from = content.strip_prefix(magic.as_slice()).ok_or_else(|| damaged.clone())?;
    if sum(content) != u64::from_le_bytes(*stored_sum) {
        return Err(damaged);
    }
    if u64::take(&mut from) != Some(VERSION) {
        return Err(BedError::Checkpoint("of another version of this program"));
    }
    Ok(from)
}

fn sum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, &byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Calls a macro with everything that is stored and restored, in order.
macro_rules! for_each_field {
    ($bed:ident, $each:ident) => {
        $each!($bed.around.region.size_m);
        $each!($bed.drive.step_over_collision_time);
        $each!($bed.step_s);
        $each!($bed.time_s);
        $each!($bed.phase_steps);
        $each!($bed.phase_start_s);
        $each!($bed.skin);
        $each!($bed.travelled);
        $each!($bed.closed);
        $each!($bed.fastest);
        $each!($bed.work.steps);
        $each!($bed.work.rebuilds);
        $each!($bed.work.displacement_checks);
        $each!($bed.particles.position_m);
        $each!($bed.particles.half_velocity);
        $each!($bed.particles.velocity_m_per_s);
        $each!($bed.particles.spin);
        $each!($bed.particles.angular_velocity_per_s);
        $each!($bed.particles.radius_m);
        $each!($bed.particles.inertia);
        $each!($bed.particles.id);
        $each!($bed.listed_position);
        $each!($bed.list.start);
        $each!($bed.list.other);
        $each!($bed.list.reverse_start);
        $each!($bed.list.reverse);
        $each!($bed.pairs.memory);
        $each!($bed.pairs.plastic_before);
        $each!($bed.pairs.force);
        $each!($bed.pairs.spring);
        $each!($bed.pairs.torque);
        $each!($bed.pairs.turn);
        $each!($bed.pairs.moment);
        $each!($bed.wall_list.start);
        $each!($bed.wall_list.wall);
        $each!($bed.wall_list.memory);
        $each!($bed.wall_list.spring);
    };
}

impl Bed {
    /// The state as bytes.
    #[must_use]
    pub fn checkpoint(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        VERSION.put(&mut bytes);
        self.material.k1_n_per_m().put(&mut bytes);
        self.drive.mass_scaling.put(&mut bytes);
        macro_rules! put {
            ($field:expr) => {
                $field.put(&mut bytes)
            };
        }
        for_each_field!(self, put);
        sealed(bytes)
    }

    /// Takes up the state of a checkpoint of the same scene, in a phase with the same growth.
    ///
    /// # Errors
    ///
    /// [`BedError::Checkpoint`] for bytes that are damaged, of another version or of another scene; the bed
    /// is then as it was.
    pub fn restore(&mut self, bytes: &[u8], growing: Option<Growing>) -> Result<(), BedError> {
        let damaged = BedError::Checkpoint("damaged, or not a checkpoint of a bed");
        let mut from = unsealed(bytes, MAGIC)?;
        let mut fresh = self.clone();
        let k1 = f64::take(&mut from).ok_or_else(|| damaged.clone())?;
        fresh.set_material(self.material.with_k1(k1)?);
        let mass_scaling = f64::take(&mut from).ok_or_else(|| damaged.clone())?;
        fresh.drive = Drive { growing, mass_scaling, ..fresh.drive };
        macro_rules! take {
            ($field:expr) => {
                $field = Stored::take(&mut from).ok_or_else(|| damaged.clone())?
            };
        }
        for_each_field!(fresh, take);
        fresh.walls = fresh.around.region.walls();
        let n = self.particles.len();
        let radii = |bed: &Self| {
            let mut radii = vec![0.0; n];
            for (&id, &radius) in bed.particles.id.iter().zip(&bed.particles.radius_m) {
                if let Some(place) = radii.get_mut(id as usize) {
                    *place = radius;
                }
            }
            radii
        };
        if fresh.particles.len() != n
            || fresh.particles.radius_m.len() != n
            || fresh.particles.spin.len() != self.particles.spin.len()
            || radii(&fresh) != radii(self)
        {
            return Err(BedError::Checkpoint("of another scene: its particles are not these"));
        }
        fresh.fill_constants()?;
        *self = fresh;
        Ok(())
    }
}

impl Run {
    /// The state between two observations as bytes: the bed, and all that was observed.
    #[must_use]
    pub fn checkpoint(&self) -> Vec<u8> {
        let mut bytes = RUN_MAGIC.to_vec();
        VERSION.put(&mut bytes);
        self.phase.put(&mut bytes);
        self.output.put(&mut bytes);
        self.steps.put(&mut bytes);
        self.closure_time.put(&mut bytes);
        self.series.put(&mut bytes);
        self.bed.checkpoint().put(&mut bytes);
        sealed(bytes)
    }
}

impl Scene {
    /// Takes up a run of this very scene where a checkpoint left it.
    ///
    /// # Errors
    ///
    /// [`BedError::Checkpoint`] for bytes that are damaged, of another version or of another scene.
    pub fn resume(&self, bytes: &[u8]) -> Result<Run, BedError> {
        let damaged = BedError::Checkpoint("damaged, or not a checkpoint of a run");
        let mut from = unsealed(bytes, RUN_MAGIC)?;
        let mut run = self.start();
        let mut take = || -> Option<(usize, usize, u64, f64, Series, Vec<u8>)> {
            Some((
                usize::take(&mut from)?,
                usize::take(&mut from)?,
                u64::take(&mut from)?,
                f64::take(&mut from)?,
                Series::take(&mut from)?,
                Vec::take(&mut from)?,
            ))
        };
        let (phase, output, steps, closure_time, series, bed) = take().ok_or(damaged)?;
        let fits = |output: usize| {
            self.phases.get(phase).map_or(output == 0, |phase| output <= phase.outputs)
        };
        let before = series.phase.last().and_then(|&phase| self.phases.get(phase));
        if !fits(output) || (before.is_none() && !series.phase.is_empty()) {
            return Err(BedError::Checkpoint("of another scene: its phases are not these"));
        }
        // As it was in the phase of the last observation.
        run.bed.restore(&bed, self.growing.filter(|_| before.is_some_and(|phase| phase.heated)))?;
        let mut run = Run { phase, output, steps, closure_time, series, ..run };
        run.bed.heat = run.heat_clock();
        Ok(run)
    }
}
