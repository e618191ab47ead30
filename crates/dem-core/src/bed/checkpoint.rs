//! The whole state of a bed as bytes, so that a run goes on with the same bits.
//!
//! Layout, little-endian: the magic, the version, every field in the order of [`Bed::checkpoint`], and the
//! FNV-1a sum of all that. A vector is its length and its elements. What a scene describes (material,
//! surroundings, how contacts grow) is not in it: a checkpoint is read into the bed of the same scene.

use super::contact::Memory;
use super::engine::{Bed, Drive};
use super::error::BedError;
use super::material::Growing;
use super::material::Material;
use super::vec3::Vec3;

const MAGIC: &[u8; 8] = b"dem-bed\0";
const VERSION: u64 = 1;

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
        sum(&bytes).put(&mut bytes);
        bytes
    }

    /// Takes up the state of a checkpoint of the same scene, in a phase with the same growth.
    ///
    /// # Errors
    ///
    /// [`BedError::Checkpoint`] for bytes that are damaged, of another version or of another scene; the bed
    /// is then as it was.
    pub fn restore(&mut self, bytes: &[u8], growing: Option<Growing>) -> Result<(), BedError> {
        let damaged = BedError::Checkpoint("damaged, or not a checkpoint of a bed");
        let Some((content, stored_sum)) = bytes.split_last_chunk::<8>() else {
            return Err(damaged);
        };
        let Some(mut from) = content.strip_prefix(MAGIC.as_slice()) else { return Err(damaged) };
        if sum(content) != u64::from_le_bytes(*stored_sum) {
            return Err(damaged);
        }
        if u64::take(&mut from) != Some(VERSION) {
            return Err(BedError::Checkpoint("of another version of this program"));
        }
        let mut fresh = self.clone();
        let mut spec = *self.material.spec();
        spec.k1 = f64::take(&mut from).ok_or_else(|| damaged.clone())?;
        fresh.set_material(Material::new(spec)?);
        let mass_scaling = f64::take(&mut from).ok_or_else(|| damaged.clone())?;
        fresh.drive = Drive { growing, mass_scaling, ..fresh.drive };
        macro_rules! take {
            ($field:expr) => {
                $field = Stored::take(&mut from).ok_or_else(|| damaged.clone())?
            };
        }
        for_each_field!(fresh, take);
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
