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
    /// A member whose likelihood rests on too few of its samples.
    FewMemberSamples { member: String, effective: f64, fitted: f64, fewest: f64 },
    /// A population that reaches beyond what a member's prior allowed.
    BeyondMemberPrior { member: String, parameter: String, share: f64 },
    /// A member whose own result is not to be trusted.
    UntrustedMember { member: String },
}

impl OfPopulation {
    fn what(&self) -> String {
        match self {
            Self::FewMembers { members, fewest } => format!(
                "{members} members are fewer than {fewest}: how far they spread is hardly measured, and the next one's interval is mostly what was assumed of the spread"
            ),
            Self::FewMemberSamples { member, effective, fitted, fewest } => format!(
                "{member}: its likelihood rests on {} effective samples (5 % of the posterior have fewer), below {fewest:.0}, as the population is narrow beside it: a fitted density stood in for {} % of the posterior",
                significant(*effective, 2),
                significant(100.0 * fitted, 2)
            ),
            Self::BeyondMemberPrior { member, parameter, share } => format!(
                "{} % of the population lies beyond the prior that {member} was calibrated with in {parameter}: what that pair says of it there is unknown, and counts as impossible",
                significant(100.0 * share, 2)
            ),
            Self::UntrustedMember { member } => format!(
                "{member} is a result that is not to be trusted as it is: the spread between members takes its error for a difference"
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
                "calibrate it again with a wider prior of that parameter"
            }
            Self::UntrustedMember { .. } => "see what its own summary says, and repeat it",
        }
    }
}

impl fmt::Display for OfPopulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}{}", self.what(), self.remedy(), section(self))
    }
}
