//! Heat: rates that follow a temperature.
//!
//! The rates of zipping (C1) and of stretching (`1/tau_s`) are those of a viscous polymer at its temperature. Where both
//! go with one mobility m, 1 at a reference, every law of growth without explicit time runs in the reduced time s:
//!
//! ```text
//! dx/dt = m(t) F(x)   ->   x(t) = x_iso(s(t)),   s(t) = integral of m from 0 to t
//! ```
//!
//! [`regime-map`](crate::kinetics::RegimeMap), which has explicit time, is taken with s in its place. The adhesive start is elastic and
//! does not scale. Time 0 is first contact, where s = 0. A history with a finite [`Heat::reduced_time_at_end`] freezes
//! the pair below full coalescence.
//!
//! | history | temperature | s |
//! |---|---|---|
//! | [`History::Constant`] | T | `m(T) t`, closed |
//! | [`Heat::direct`] | none: `m = M exp(-u/t_cool)` | `M t_cool (1 - exp(-u/t_cool))`, closed |
//! | [`History::Pulse`] | `T_amb + H exp(-u/t_cool)` | quadrature |
//! | [`History::RampAndHold`] | straight lines | quadrature; closed while it is held |
//! | [`History::Table`] | straight lines between rows | quadrature; closed where T rests |
//!
//! u is the time since the history began, [`start_s`](Heat::start_s) after first contact (negative: before). Quadrature is Gauss and Kronrod's, adaptive, to
//! 1e-10 of s and better.
//!
//! Mobility laws are those of [`MobilityLaw`]: Arrhenius, WLF, Vogel. s at the reference temperature is time, so that C1 and
//! tau_s are those of the reference temperature.
//!
//! ```
//! use dem_core::heat::{Heat, History, Mobility, MobilityLaw};
//!
//! let law = MobilityLaw::Arrhenius { activation_energy_j_per_mol: 100e3, reference_k: 450.0 };
//! let mobility = Mobility::new(law)?.frozen_below(373.0)?;
//! let pulse = History::Pulse { ambient_k: 300.0, rise_k: 200.0, cooling_s: 0.5 };
//! let heat = Heat::new(&pulse, &mobility, 0.0)?;
//! assert!((heat.reduced_time_at_end() - 0.7730).abs() < 1e-4); // s: it freezes
//! assert_eq!(heat.time(1.0), None);
//! # Ok::<(), dem_core::heat::HeatError>(())
//! ```

mod error;
mod history;
pub mod literature;
mod mobility;
mod pace;
mod piece;
mod quadrature;
mod reduced_time;

pub use error::HeatError;
pub use history::{CoolDown, History};
pub use mobility::{GAS_CONSTANT, Mobility, MobilityLaw};
pub use pace::{Heated, Isothermal, Pace};

use error::within;
use history::cooling;
use piece::{Course, Piece};
use reduced_time::Walk;

/// The mobility over time: a history of the temperature with the law of a powder, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Heat {
    start_s: f64,
    pieces: Vec<Piece>,
}

impl Heat {
    /// A history that begins `start_s` after first contact, before it where negative.
    ///
    /// # Errors
    ///
    /// A [`HeatError`] with the field, its value and the remedy.
    pub fn new(history: &History, mobility: &Mobility, start_s: f64) -> Result<Self, HeatError> {
        check_start(start_s)?;
        history.check()?;
        Ok(Self { start_s, pieces: history.pieces(mobility, start_s) })
    }

    /// A mobility without a temperature: `m = M exp(-u/t_cool)`, 0 before the pulse. An infinite `t_cool` is a constant M.
    ///
    /// # Errors
    ///
    /// [`HeatError::Field`] for an amplitude outside 0 to 1e100, a cooling time outside 1e-12 to 1e12 s (or infinite), a start beyond 1e12 s.
    pub fn direct(amplitude: f64, cooling_s: f64, start_s: f64) -> Result<Self, HeatError> {
        check_start(start_s)?;
        within("amplitude", amplitude, (0.0, 1e100), "give a mobility, 0 to 1e100")?;
        cooling("cooling_s", cooling_s)?;
        let course = if cooling_s.is_infinite() || amplitude == 0.0 {
            Course::Constant(amplitude)
        } else {
            Course::Decay { from_s: start_s, amplitude, cooling_s }
        };
        let pieces = vec![
            Piece { until_s: start_s, course: Course::Constant(0.0) },
            Piece { until_s: f64::INFINITY, course },
        ];
        Ok(Self { start_s, pieces })
    }

    /// Time from first contact to the beginning of the history \[s\].
    #[must_use]
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// m at a time after first contact, before it where negative \[s\].
    #[must_use]
    pub fn mobility(&self, time_s: f64) -> f64 {
        if time_s.is_nan() {
            return time_s;
        }
        let at = self.pieces.partition_point(|piece| piece.until_s <= time_s);
        self.pieces
            .get(at)
            .or(self.pieces.last())
            .map_or(f64::NAN, |piece| piece.course.mobility(time_s))
    }

    /// Reduced time s at a time after first contact \[s\]; 0 up to there.
    #[must_use]
    pub fn reduced_time(&self, time_s: f64) -> f64 {
        if time_s.is_nan() {
            return time_s;
        }
        Walk::new(&self.pieces).to(time_s.max(0.0))
    }

    /// Reduced times at times that increase, integrated once through, written to `out`.
    ///
    /// Fills as many places as both have. A time below the one before it counts as that one.
    pub fn reduced_times(&self, times_s: &[f64], out: &mut [f64]) {
        let mut walk = Walk::new(&self.pieces);
        let mut now_s = 0f64;
        for (reduced, &time_s) in out.iter_mut().zip(times_s) {
            now_s = now_s.max(time_s);
            *reduced = walk.to(now_s);
        }
    }

    /// s after infinite time: finite where the pair freezes.
    #[must_use]
    pub fn reduced_time_at_end(&self) -> f64 {
        Walk::new(&self.pieces).to(f64::INFINITY)
    }

    /// The time \[s\] at which the reduced time has a value: 0 for values up to 0, `None` where it never has.
    #[must_use]
    pub fn time(&self, reduced_s: f64) -> Option<f64> {
        Walk::time(&self.pieces, reduced_s)
    }

    /// What solvers follow.
    #[must_use]
    pub fn pace(&self) -> Heated<'_> {
        Heated::new(&self.pieces)
    }
}

fn check_start(start_s: f64) -> Result<(), HeatError> {
    within("start_s", start_s, (-1e12, 1e12), "give seconds, up to 1e12 either way")
}

/// A cooling time at another radius, `t_cool (R/R_cal)^power`.
///
/// The power is 1 where heat leaves by a constant transfer coefficient h, `t_cool = rho c R/(3 h)`, and 2 where it is conducted:
/// into a still gas, `h = k/R`, or within the particle.
#[must_use]
pub fn at_radius(cooling_s: f64, calibrated_radius_m: f64, radius_m: f64, power: f64) -> f64 {
    cooling_s * (radius_m / calibrated_radius_m).powf(power)
}
