//! Temperature over time.

use super::error::{HeatError, TEMPERATURES_K, temperature, within};
use super::mobility::Mobility;
use super::piece::{Piece, Pieces};

/// A temperature over the time u since the history began. [`Heat::new`](super::Heat::new) checks the ranges: temperatures are 1e-3 to 1e6 K,
/// those of a fit being effective ones, and times up to 1e12 s.
#[derive(Debug, Clone, PartialEq)]
pub enum History {
    /// One temperature, before the beginning too.
    Constant {
        /// \[K\].
        temperature_k: f64,
    },
    /// Heated at once, cooling by a time constant: `T = T_amb + H exp(-u/t_cool)`, and `T_amb` before.
    Pulse {
        /// T_amb \[K\].
        ambient_k: f64,
        /// H \[K\], 0 to 1e6.
        rise_k: f64,
        /// t_cool \[s\], 1e-12 to 1e12, or infinite: see [`at_radius`](super::at_radius).
        cooling_s: f64,
    },
    /// A ramp to a temperature that is held: an oven, a dilatometer. The start temperature before.
    RampAndHold {
        /// Temperature at the beginning \[K\].
        start_k: f64,
        /// Rate of the ramp \[K/s\], 1e-12 to 1e12; its sign follows from the two temperatures.
        rate_k_per_s: f64,
        /// Temperature that is held \[K\].
        hold_k: f64,
        /// What comes after the hold; without it the hold has no end.
        then: Option<CoolDown>,
    },
    /// Straight lines between rows of time u \[s\] and temperature \[K\], by increasing time; the first and the last
    /// temperature before and after.
    Table(Vec<(f64, f64)>),
}

/// The end of a ramp and hold: back to the start temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoolDown {
    /// Duration of the hold \[s\], 0 to 1e12.
    pub hold_s: f64,
    /// Rate of cooling \[K/s\], 1e-12 to 1e12.
    pub rate_k_per_s: f64,
}

/// Durations that are taken \[s\].
const LONGEST_S: f64 = 1e12;
const RATES: (f64, f64) = (1e-12, 1e12);

impl History {
    /// Temperature \[K\] at the time u \[s\] since the beginning.
    #[must_use]
    pub fn temperature_k(&self, since_start_s: f64) -> f64 {
        let u = since_start_s;
        match *self {
            Self::Constant { temperature_k } => temperature_k,
            Self::Pulse { ambient_k, .. } if u < 0.0 => ambient_k,
            Self::Pulse { ambient_k, rise_k, cooling_s } => {
                ambient_k + rise_k * (-u / cooling_s).exp()
            }
            Self::RampAndHold { start_k, rate_k_per_s, hold_k, then } => {
                let ramp_s = (hold_k - start_k).abs() / rate_k_per_s;
                let rises = (hold_k - start_k).signum();
                let back_s = then.map_or(f64::INFINITY, |then| ramp_s + then.hold_s);
                let cooled = |then: CoolDown| (u - back_s).max(0.0) * then.rate_k_per_s;
                let there =
                    rises * (rate_k_per_s * u.clamp(0.0, ramp_s)).min((hold_k - start_k).abs());
                let left = (there * rises - then.map_or(0.0, cooled)).max(0.0);
                start_k + rises * left
            }
            Self::Table(ref rows) => {
                let after = rows.partition_point(|&(time, _)| time <= u);
                match (after.checked_sub(1).and_then(|i| rows.get(i)), rows.get(after)) {
                    (Some(&(t0, k0)), Some(&(t1, k1))) => k0 + (k1 - k0) * ((u - t0) / (t1 - t0)),
                    (Some(&(_, k)), None) | (None, Some(&(_, k))) => k,
                    (None, None) => f64::NAN,
                }
            }
        }
    }

    pub(super) fn check(&self) -> Result<(), HeatError> {
        match *self {
            Self::Constant { temperature_k } => temperature("temperature_k", temperature_k),
            Self::Pulse { ambient_k, rise_k, cooling_s } => {
                temperature("ambient_k", ambient_k)?;
                let remedy = "give the heating above ambient in kelvin, 0 to 1e6";
                within("rise_k", rise_k, (0.0, TEMPERATURES_K.1), remedy)?;
                cooling("cooling_s", cooling_s)
            }
            Self::RampAndHold { start_k, rate_k_per_s, hold_k, then } => {
                let remedy = "give a rate in K/s, 1e-12 to 1e12, without a sign";
                temperature("start_k", start_k)?;
                temperature("hold_k", hold_k)?;
                within("rate_k_per_s", rate_k_per_s, RATES, remedy)?;
                let Some(then) = then else { return Ok(()) };
                within("hold_s", then.hold_s, (0.0, LONGEST_S), "give seconds, 0 to 1e12")?;
                within("cooling rate_k_per_s", then.rate_k_per_s, RATES, remedy)
            }
            Self::Table(ref rows) => check_table(rows),
        }
    }

    /// The pieces of the history, which begins at `start_s`.
    pub(super) fn pieces(&self, mobility: &Mobility, start_s: f64) -> Vec<Piece> {
        let begin = |before_k| Pieces::new(mobility, start_s, before_k);
        match *self {
            Self::Constant { temperature_k } => {
                Pieces::new(mobility, f64::INFINITY, temperature_k).into_vec()
            }
            Self::Pulse { ambient_k, rise_k, cooling_s } => {
                let mut pieces = begin(ambient_k);
                pieces.cool(ambient_k, rise_k, cooling_s);
                pieces.into_vec()
            }
            Self::RampAndHold { start_k, rate_k_per_s, hold_k, then } => {
                let mut pieces = begin(start_k);
                let span_k = (hold_k - start_k).abs();
                pieces.ramp(start_k, hold_k, pieces.now_s() + span_k / rate_k_per_s);
                match then {
                    None => pieces.constant(hold_k, f64::INFINITY),
                    Some(CoolDown { hold_s, rate_k_per_s }) => {
                        pieces.constant(hold_k, pieces.now_s() + hold_s);
                        pieces.ramp(hold_k, start_k, pieces.now_s() + span_k / rate_k_per_s);
                        pieces.constant(start_k, f64::INFINITY);
                    }
                }
                pieces.into_vec()
            }
            Self::Table(ref rows) => {
                let (first, last) = (rows[0], rows[rows.len() - 1]);
                let mut pieces = Pieces::new(mobility, start_s + first.0, first.1);
                for pair in rows.windows(2) {
                    pieces.ramp(pair[0].1, pair[1].1, start_s + pair[1].0);
                }
                pieces.constant(last.1, f64::INFINITY);
                pieces.into_vec()
            }
        }
    }
}

/// A time constant, which may be infinite.
pub(super) fn cooling(field: &'static str, value_s: f64) -> Result<(), HeatError> {
    if value_s == f64::INFINITY {
        return Ok(());
    }
    let remedy = "give the cooling time in seconds, 1e-12 to 1e12, or infinity";
    within(field, value_s, (1e-12, LONGEST_S), remedy)
}

fn check_table(rows: &[(f64, f64)]) -> Result<(), HeatError> {
    let mut before_s = f64::NEG_INFINITY;
    for (index, &(time_s, temperature_k)) in rows.iter().enumerate() {
        let row = index + 1;
        let wrong = |field, value, remedy| Err(HeatError::Row { row, field, value, remedy });
        if !(-LONGEST_S..=LONGEST_S).contains(&time_s) {
            return wrong("time_s", time_s, "give seconds, up to 1e12");
        }
        if time_s <= before_s {
            return wrong("time_s", time_s, "times must increase from row to row");
        }
        if !(TEMPERATURES_K.0..=TEMPERATURES_K.1).contains(&temperature_k) {
            let remedy = "give a temperature in kelvin, 1e-3 to 1e6";
            return wrong("temperature_k", temperature_k, remedy);
        }
        before_s = time_s;
    }
    if rows.is_empty() { Err(HeatError::NoRows) } else { Ok(()) }
}
