//! Reasons to be careful with a population.

use std::fmt;

use serde::Serialize;

use super::section;
use crate::number::significant;

/// A reason to be careful with a population that its sampler does not see.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum OfPopulation {
    /// Too few members to learn their spread from.
    FewMembers { members: usize, fewest: usize },
    /// Members whose likelihood rests on too few of their samples; the fewest, and the largest share of the fitted density.
    FewMemberSamples { members: Vec<String>, effective: f64, fitted: f64, fewest: f64 },
    /// A population that reaches beyond what the priors of some members allowed; the largest share.
    BeyondMemberPrior { members: Vec<String>, parameter: String, share: f64 },
    /// Members whose own result is not to be trusted.
    UntrustedMember { members: Vec<String> },
}

impl OfPopulation {
    fn what(&self) -> String {
        match self {
            Self::FewMembers { members, fewest } => format!(
                "{members} members are fewer than {fewest}: how far they spread is hardly measured, and the next one's interval is mostly what was assumed of the spread"
            ),
            Self::FewMemberSamples { members, effective, fitted, fewest } => format!(
                "{}: the population is narrow beside what a member's own data say: its likelihood rests on {} effective samples or more in 95 % of the posterior, below {fewest:.0}, and a fitted density stood in for up to {} %",
                members.join(", "),
                significant(*effective, 2),
                significant(100.0 * fitted, 2)
            ),
            Self::BeyondMemberPrior { members, parameter, share } => format!(
                "{} % of the population lies beyond the prior of {parameter} that was calibrated with ({}): what a member's data say there is unknown, and counts as impossible",
                significant(100.0 * share, 2),
                members.join(", ")
            ),
            Self::UntrustedMember { members } => format!(
                "not to be trusted as they are: {}; the spread between members takes an error of theirs for a difference",
                members.join(", ")
            ),
        }
    }

    fn remedy(&self) -> &'static str {
        match self {
            Self::FewMembers { .. } => {
                "measure more of them, or say what is known of the spread with --spread"
            }
            Self::FewMemberSamples { .. } => "give its calibration more --samples",
            Self::BeyondMemberPrior { .. } => {
                "calibrate them again with a wider prior of that parameter"
            }
            Self::UntrustedMember { .. } => "see what their own summaries say, and repeat them",
        }
    }
}

impl fmt::Display for OfPopulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}{}", self.what(), self.remedy(), section(self))
    }
}
