//! Reasons to suspect the clock of a table, or the priors, before the measurements and the model.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::careful;
use crate::number::{shown_unit, significant};

/// A reason to suspect what a calibration of a pair was told: found by calibrating it once more with a clock or with
/// priors that are free.
///
/// [`Doubt::what`] says what is wrong and by how much, [`Doubt::meaning`] what that means for the result,
/// [`Doubt::remedy`] what to do; `Display` says all three.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Doubt {
    /// The data are far more probable where first contact is not at time 0 of the table.
    Clock {
        /// Time of the first observation \[s\].
        first_s: f64,
        /// Time of first contact in the clock of the table \[s\]: posterior median.
        t0_s: f64,
        /// Equal-tailed 95 % interval of it.
        eti95_s: [f64; 2],
        /// Log of how many times more probable the data are.
        log_gain: f64,
        /// Root mean square residual of the best curve that begins at 0, and of that which begins at t0.
        rmse: [f64; 2],
    },
    /// The best curve lies outside the priors, and is far better than any inside.
    Prior {
        /// The parameters whose priors exclude it.
        excluded: Vec<Excluded>,
        /// Log likelihood of the best curve outside less that of the best inside.
        log_gain: f64,
        /// Root mean square residual of the best curve inside the priors, and of that outside.
        rmse: [f64; 2],
    },
}

/// A parameter whose prior excludes what the data ask for.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excluded {
    /// Name of the parameter.
    pub parameter: String,
    /// Its unit.
    pub unit: String,
    /// Its prior, in words.
    pub prior: String,
    /// What the data ask for: posterior median under a prior many decades wide.
    pub median: f64,
    /// Equal-tailed 95 % interval of it.
    pub eti95: [f64; 2],
}

impl Doubt {
    /// The problem and its size.
    pub fn what(&self) -> String {
        let three = |value: &f64| significant(*value, 3);
        match self {
            Self::Clock {
                first_s,
                t0_s,
                eti95_s: [lower, upper],
                log_gain,
                rmse: [before, after],
            } => {
                // Digits that tell the time from the first observation.
                let digits = |value: &f64| significant(*value, 5);
                let unseen = if *t0_s > 0.0 && *first_s > 0.0 {
                    format!(", and nothing was observed before {} s", digits(first_s))
                } else {
                    String::new()
                };
                format!(
                    "the clock of the table is suspected{unseen}: with first contact at t0 = {} s (95 % {} .. {} s) instead of 0 the data are {} times more probable (RMSE of a/R {} instead of {})",
                    digits(t0_s),
                    digits(lower),
                    digits(upper),
                    times(*log_gain),
                    three(after),
                    three(before)
                )
            }
            Self::Prior { excluded, rmse: [inside, outside], .. } => {
                let each = excluded.iter().map(|one| {
                    let unit = shown_unit(&one.unit);
                    let [lower, upper] = one.eti95;
                    format!(
                        "for {} they ask for {} {unit} (95 % {} .. {}), where its prior is {}",
                        one.parameter,
                        three(&one.median),
                        three(&lower),
                        three(&upper),
                        one.prior
                    )
                });
                let each: Vec<String> = each.collect();
                format!(
                    "the prior excludes what the data ask for: {}; outside the prior the best curve misses the data by {} in a/R (RMSE), inside by {}",
                    each.join(", and "),
                    three(outside),
                    three(inside)
                )
            }
        }
    }

    /// Consequence for the result.
    pub fn meaning(&self) -> &'static str {
        match self {
            Self::Clock { .. } => {
                "the times do not count from first contact, and the parameters make up for it"
            }
            Self::Prior { .. } => {
                "the posterior is the corner of the prior that is nearest to the data"
            }
        }
    }

    /// Remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Clock { .. } => "add [t0] to the prior, or correct the times",
            Self::Prior { .. } => {
                "correct the prior or the units of the table; only if both are certain, doubt the model or the data"
            }
        }
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let section = careful::section(self);
        write!(f, "{}: {}; {}{section}", self.what(), self.meaning(), self.remedy())
    }
}

/// How many times more, from its logarithm; beyond what a number holds only that it is more.
fn times(log_gain: f64) -> String {
    const MOST: f64 = 690.0;
    if log_gain > MOST { "more than 1e299".to_owned() } else { significant(log_gain.exp(), 2) }
}
