//! Resistance of sintered necks to shear, rolling and twist.
//!
//! A contact that grows is a viscous neck. Along the line of the centres it gives way with the speed of its growth, `D rate s R` under the
//! force `D fa`, s the factor of the [approach](crate::densification::Approach): its resistance there is
//!
//! ```text
//! c_n = fa/(s R rate) = alpha K1/rate   [N s/m],   rate = dx/dt of the kinetics.
//! ```
//!
//! A Newtonian neck of radius a and of any length l resists being drawn out with `3 eta pi a^2/l` and being sheared with `eta pi a^2/l`: a
//! third (F.T. Trouton, Proc. R. Soc. Lond. A 77 (1906) 426). Bent, its fibres are drawn out and shortened, and the second moment of
//! its section `pi a^4/4` stands for `pi a^2`; twisted, they are sheared, with `pi a^4/2`. So that, times the `neck_viscosity` nu of the scene,
//!
//! ```text
//! F = -nu c_n/3 v_t,   M_bending = -nu c_n a^2/4 omega_t,   M_twist = -nu c_n a^2/6 omega_n,
//! ```
//!
//! with the velocity v_t at the middle of the neck and the relative angular velocity omega. nu = 1 is one viscosity for all motions; 0, or none,
//! a neck that turns and slides freely. Boundaries of grains that matter diffuses along follow another law, whose sliding term has a viscosity of its own
//! (F. Parhami, R.M. McMeeking, Mech. Mater. 27 (1998) 111): nu is then a free number.
//!
//! Newton's law sees each of these dashpots in series with a spring, the friction's or `2/7 K1`, as the normal contact is a dashpot and a spring, with the friction's
//! damping beside the spring. The balance of forces has the dashpots alone, and without growth nothing. Necks take the place of friction between particles while contacts grow; walls do not sinter.

use super::material::Friction;
use super::vec3::{Vec3, add, dot, scale, sub};

/// Shares of the normal resistance: shear, bending over a^2, twist over a^2.
const SHEAR: f64 = 1.0 / 3.0;
const BENDING: f64 = 1.0 / 4.0;
const TWIST: f64 = 1.0 / 6.0;

/// Coefficients of a neck: of any resistance, or stiffness, to motion along its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Neck {
    /// To shear.
    pub(crate) shear: f64,
    /// To bending, in the unit of shear times m2.
    pub(crate) bending: f64,
    /// To twist.
    pub(crate) twist: f64,
}

impl Neck {
    /// Of a neck of squared radius `neck_squared_m2` with a resistance to motion along its axis, times nu.
    #[inline(always)]
    pub(crate) fn new(resistance: f64, neck_squared_m2: f64) -> Self {
        let turning = resistance * neck_squared_m2;
        Self { shear: SHEAR * resistance, bending: BENDING * turning, twist: TWIST * turning }
    }
}

/// The necks of a bed for its dynamic phases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NeckLaw {
    /// nu.
    viscosity: f64,
    /// Of the springs \[N/m\].
    stiffness: f64,
    damping_over_normal: f64,
}

/// Springs of a neck: shift \[m\] and turn \[rad\] that they hold.
pub(crate) struct NeckSprings<'a> {
    pub(crate) shift: &'a mut Vec3,
    pub(crate) turn: &'a mut Vec3,
}

impl NeckLaw {
    pub(crate) fn new(viscosity: f64, friction: &Friction, k1: f64) -> Self {
        Self {
            viscosity,
            stiffness: friction.tangential_stiffness_over_k1 * k1,
            damping_over_normal: friction.tangential_damping_over_normal,
        }
    }

    /// Energy of the spring that holds a turn of a neck \[J\].
    pub(crate) fn turn_energy_j(&self, turn: Vec3, neck_squared_m2: f64) -> f64 {
        0.5 * self.stiffness * BENDING * neck_squared_m2 * dot(turn, turn)
    }

    /// Force on the first body and moment on it, after a step with relative velocities `sliding` and `turning`.
    #[inline(always)]
    pub(crate) fn step(
        &self,
        springs: NeckSprings<'_>,
        normal: Vec3,
        [sliding, turning]: [Vec3; 2],
        (resistance, normal_damping, neck_squared_m2): (f64, f64, f64),
        step_s: f64,
    ) -> (Vec3, Vec3) {
        let viscous = Neck::new(self.viscosity * resistance, neck_squared_m2);
        let damping = self.damping_over_normal * normal_damping;
        let lever = BENDING * neck_squared_m2;
        let across = |v: Vec3| sub(v, scale(normal, dot(normal, v)));
        let along = |v: Vec3| scale(normal, dot(normal, v));
        let stiff = [self.stiffness, damping];
        let shear = yielding(across(*springs.shift), across(sliding), viscous.shear, stiff, step_s);
        let stiff = [self.stiffness * lever, damping * lever];
        let held = *springs.turn;
        let bent = yielding(across(held), across(turning), viscous.bending, stiff, step_s);
        let twisted = yielding(along(held), along(turning), viscous.twist, stiff, step_s);
        *springs.shift = shear.0;
        *springs.turn = add(bent.0, twisted.0);
        (shear.1, add(bent.1, twisted.1))
    }
}

/// A spring with its damping, in series with a dashpot, after an implicit step: its length and the force.
#[inline(always)]
fn yielding(
    spring: Vec3,
    velocity: Vec3,
    viscous: f64,
    [stiffness, damping]: [f64; 2],
    step_s: f64,
) -> (Vec3, Vec3) {
    let sum = viscous + damping;
    let next = scale(
        add(scale(spring, sum), scale(velocity, step_s * viscous)),
        1.0 / (sum + step_s * stiffness),
    );
    let rate = scale(sub(next, spring), 1.0 / step_s);
    (next, scale(add(scale(next, stiffness), scale(rate, damping)), -1.0))
}
