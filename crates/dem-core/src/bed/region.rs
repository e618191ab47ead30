//! The box around the particles.

use serde::{Deserialize, Serialize};

use super::error::{BedError, within};
use super::vec3::Vec3;

/// The two ends of an axis of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// No bound: particles may leave.
    #[default]
    Open,
    /// Particles that leave on one side come in on the other.
    Periodic,
    /// A wall at both ends.
    Walls,
    /// A wall at the lower end; the upper one is open.
    LowerWall,
}

impl Side {
    /// Its name in a scene file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Periodic => "periodic",
            Self::Walls => "walls",
            Self::LowerWall => "lower-wall",
        }
    }
}

/// A box with one corner in the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Lengths \[m\].
    pub size_m: [f64; 3],
    /// Sides of each axis.
    pub sides: [Side; 3],
}

impl Region {
    /// Open space: no walls, no images.
    pub const OPEN: Self = Self { size_m: [1.0; 3], sides: [Side::Open; 3] };

    /// A box with the same sides on all axes.
    #[must_use]
    pub fn new(size_m: [f64; 3], sides: Side) -> Self {
        Self { size_m, sides: [sides; 3] }
    }

    pub(crate) fn check(&self) -> Result<(), BedError> {
        for (axis, &size) in self.size_m.iter().enumerate() {
            let name = format!("box.size_m[{axis}]");
            within(&name, size, 1e-9, 1e6, "give the length of the box in metres, 1e-9 to 1e6")?;
        }
        Ok(())
    }

    /// Refuses a periodic side so short that a particle could touch two images of another, where pairs
    /// are listed up to a distance of `reach_m`.
    pub(crate) fn check_images(&self, reach_m: f64) -> Result<(), BedError> {
        let needed_m = 2.0 * reach_m;
        for axis in 0..3 {
            let size_m = self.size_m[axis];
            if self.sides[axis] == Side::Periodic && size_m <= needed_m {
                return Err(BedError::PeriodicSideTooShort { axis, size_m, needed_m });
            }
        }
        Ok(())
    }

    /// Volume of the box \[m3\].
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        self.size_m[0] * self.size_m[1] * self.size_m[2]
    }

    /// Whether any axis is periodic.
    #[must_use]
    pub fn has_images(&self) -> bool {
        self.sides.contains(&Side::Periodic)
    }

    /// The walls of the box, in the order of the axes, the lower one first.
    #[must_use]
    pub fn walls(&self) -> Vec<Wall> {
        let mut walls = Vec::new();
        for axis in 0..3 {
            let lower = Wall { axis, position_m: 0.0, inward: 1.0 };
            match self.sides[axis] {
                Side::Walls => {
                    walls.push(lower);
                    walls.push(Wall { axis, position_m: self.size_m[axis], inward: -1.0 });
                }
                Side::LowerWall => walls.push(lower),
                Side::Open | Side::Periodic => {}
            }
        }
        walls
    }

    /// Vectors to the images of the box, `code = (cx + 1) + 3 (cy + 1) + 9 (cz + 1)`.
    pub(crate) fn image_shifts(&self) -> [Vec3; 32] {
        let mut shifts = [[0.0; 3]; 32];
        for (code, shift) in shifts.iter_mut().enumerate().take(27) {
            let steps = [code % 3, code / 3 % 3, code / 9];
            for axis in 0..3 {
                shift[axis] = (steps[axis] as f64 - 1.0) * self.size_m[axis];
            }
        }
        shifts
    }

    /// The nearest image of a distance vector, and its code.
    #[inline]
    pub(crate) fn nearest_image(&self, mut d: Vec3) -> (Vec3, u32) {
        let mut code = NO_SHIFT;
        let mut weight = 1;
        for (axis, along) in d.iter_mut().enumerate() {
            if self.sides[axis] == Side::Periodic {
                let size = self.size_m[axis];
                if *along > 0.5 * size {
                    *along -= size;
                    code -= weight;
                } else if *along < -0.5 * size {
                    *along += size;
                    code += weight;
                }
            }
            weight *= 3;
        }
        (d, code)
    }

    /// Brings a position back into the periodic box.
    pub(crate) fn wrap(&self, position: &mut Vec3) {
        for (axis, along) in position.iter_mut().enumerate() {
            if self.sides[axis] == Side::Periodic {
                let size = self.size_m[axis];
                *along -= size * (*along / size).floor();
                if *along >= size {
                    *along = 0.0;
                }
            }
        }
    }
}

/// The code of no shift.
pub(crate) const NO_SHIFT: u32 = 13;

/// A plane wall across an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// 0, 1 or 2.
    pub axis: usize,
    /// Position on the axis \[m\].
    pub position_m: f64,
    /// The direction of the axis into the box, 1 or -1.
    pub inward: f64,
}

impl Wall {
    /// Distance of a point from the wall, positive inside.
    #[inline(always)]
    pub(crate) fn distance(&self, position: Vec3) -> f64 {
        self.inward * (position[self.axis] - self.position_m)
    }
}
