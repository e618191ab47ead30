//! Failures one after the other that are most likely nobody's parameters: a licence server, a disk, a network.

use std::collections::HashMap;

use crate::error::ExecutorError;
use crate::outcome::Outcome;

/// Fewest runs in a row that count as an outage.
const FEWEST: u64 = 12;
/// Chance below which failures in a row are taken for an outage.
const CHANCE: f64 = 1e-6;

/// Follows how runs end, in the order in which they do.
#[derive(Debug, Default)]
pub(crate) struct Streak {
    /// Runs that ended before the streak, and those of them that failed, by cause.
    before: u64,
    causes: HashMap<String, u64>,
    /// The failures of one cause since the last run that ended otherwise.
    cause: String,
    count: u64,
    /// What the last of them said.
    detail: String,
}

impl Streak {
    /// A run ended.
    pub(crate) fn add(&mut self, outcome: &Outcome) {
        if let Outcome::Failed { kind, detail, .. } = outcome {
            let cause = kind.to_string();
            if cause != self.cause {
                self.end();
                self.cause = cause;
            }
            self.count += 1;
            self.detail.clone_from(detail);
        } else {
            self.end();
            self.before += 1;
        }
    }

    /// What came so far is the past: it was seen, and going on was asked for.
    pub(crate) fn end(&mut self) {
        let (cause, count) = (std::mem::take(&mut self.cause), std::mem::take(&mut self.count));
        self.before += count;
        if count > 0 {
            *self.causes.entry(cause).or_insert(0) += count;
        }
    }

    /// Whether the last runs look like an outage.
    ///
    /// # Formula
    ///
    /// Of m runs before the streak k failed of its cause: p = (k + 1)/(m + 4), the mean of the share under a Beta(1, 3)
    /// prior. A streak of n >= 12 is an outage where p^n < 1e-6.
    pub(crate) fn outage(&self) -> Option<ExecutorError> {
        let of_cause = self.causes.get(&self.cause).copied().unwrap_or(0);
        let share = (of_cause + 1) as f64 / (self.before + 4) as f64;
        let unlikely = self.count as f64 * share.ln() < CHANCE.ln();
        (self.count >= FEWEST && unlikely).then(|| ExecutorError::Outage {
            count: self.count,
            cause: self.cause.clone(),
            detail: self.detail.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::FailureKind;

    fn failed(code: i32) -> Outcome {
        let kind = FailureKind::ExitCode { code };
        Outcome::Failed { kind, detail: format!("said {code}"), attempts: 1, seconds: 0.0 }
    }

    fn finished() -> Outcome {
        Outcome::Finished { values: vec![1.0], attempts: 1, seconds: 0.0 }
    }

    fn after(outcomes: impl IntoIterator<Item = Outcome>) -> Streak {
        let mut streak = Streak::default();
        outcomes.into_iter().for_each(|outcome| streak.add(&outcome));
        streak
    }

    #[test]
    fn twelve_failures_of_one_cause_are_an_outage_and_eleven_or_two_causes_are_none() {
        let outage = after((0..12).map(|_| failed(3))).outage().expect("an outage");
        let words = outage.to_string();
        assert_eq!(words, "looks like an outage, 12 of the last 12: exit code 3; it said:\nsaid 3");
        assert!(after((0..11).map(|_| failed(3))).outage().is_none());
        assert!(after((0..40).map(|i| failed(3 + i % 2))).outage().is_none());
        let late = (0..50).map(|_| finished()).chain((0..12).map(|_| failed(3)));
        assert!(after(late).outage().is_some());
    }

    #[test]
    fn where_half_of_the_runs_fail_a_dozen_in_a_row_is_no_outage_and_what_was_seen_is_not_said_again()
     {
        // (26/54)^n < 1e-6 from n = 19 on.
        let half = || (0..50).map(|i| if i % 2 == 0 { failed(3) } else { finished() });
        for (count, is) in [(12, false), (18, false), (19, true)] {
            let streak = after(half().chain((0..count).map(|_| failed(3))));
            assert_eq!(streak.outage().is_some(), is, "{count}");
        }
        let mut seen = after((0..12).map(|_| failed(3)));
        seen.end();
        assert!(seen.outage().is_none());
        (0..12).for_each(|_| seen.add(&failed(3)));
        assert!(seen.outage().is_none(), "it was accepted");
    }
}
