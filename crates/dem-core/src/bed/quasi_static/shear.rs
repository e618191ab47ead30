//! Necks that resist shear and rolling over a step: dashpots between two particles that shift and turn.
//!
//! Turns are lengths, the angle times the radius, so that forces and torques over the radius are of one kind. The
//! resistances are means over the step.

use crate::bed::necks::Neck;
use crate::bed::vec3::{Vec3, add, cross, dot, scale, sub};

/// A neck over a step. Resistances over the length of the step \[N/m\], those to turning over the squared radius.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shear {
    pub(crate) ends: [usize; 2],
    /// From the second end to the first.
    pub(crate) normal: Vec3,
    /// Distance of the centres over the sum of the radii.
    pub(crate) arm: f64,
    pub(crate) radius: [f64; 2],
    /// Shear \[N/m\]; bending and twist \[N m\].
    pub(crate) neck: Neck,
}

/// What a neck does at its first end: force, torque over the radius of the first, and over that of the second.
pub(crate) struct Reaction {
    pub(crate) force: Vec3,
    pub(crate) turning: [Vec3; 2],
}

impl Shear {
    fn across(&self, v: Vec3) -> Vec3 {
        sub(v, scale(self.normal, dot(self.normal, v)))
    }

    /// The force against shifts and turns of the two ends, positive along them: the matrix of the neck times these.
    pub(crate) fn times(&self, shift: [Vec3; 2], turn: [Vec3; 2]) -> Reaction {
        let rolled = cross(self.normal, scale(add(turn[0], turn[1]), self.arm));
        let force = scale(self.across(add(sub(shift[0], shift[1]), rolled)), self.neck.shear);
        let relative =
            sub(scale(turn[0], 1.0 / self.radius[0]), scale(turn[1], 1.0 / self.radius[1]));
        let across = self.across(relative);
        let moment =
            add(scale(across, self.neck.bending), scale(sub(relative, across), self.neck.twist));
        // The gradient of F . (n x turn arm) with respect to the turn.
        let lever = scale(cross(force, self.normal), self.arm);
        Reaction {
            force,
            turning: [
                add(lever, scale(moment, 1.0 / self.radius[0])),
                sub(lever, scale(moment, 1.0 / self.radius[1])),
            ],
        }
    }

    /// Diagonal blocks `p n n + q (1 - n n)` of an end: of its shift and of its turn, as `[p, q]`.
    pub(crate) fn diagonal(&self, end: usize) -> [[f64; 2]; 2] {
        let per_squared_radius = 1.0 / (self.radius[end] * self.radius[end]);
        let rolling = self.neck.shear * self.arm * self.arm;
        let Neck { shear, bending, twist } = self.neck;
        [[0.0, shear], [twist * per_squared_radius, rolling + bending * per_squared_radius]]
    }
}

/// Adds `factor` times what the necks do against shifts and turns: of `n` particles in `moves` their shifts, and then their turns.
pub(crate) fn add_reactions(necks: &[Shear], moves: &[Vec3], factor: f64, to: &mut [Vec3]) {
    let n = moves.len() / 2;
    for neck in necks {
        let [i, j] = neck.ends;
        let Reaction { force, turning } =
            neck.times([moves[i], moves[j]], [moves[n + i], moves[n + j]]);
        to[i] = add(to[i], scale(force, factor));
        to[j] = sub(to[j], scale(force, factor));
        to[n + i] = add(to[n + i], scale(turning[0], factor));
        to[n + j] = add(to[n + j], scale(turning[1], factor));
    }
}
