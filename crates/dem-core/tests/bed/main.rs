//! Many particles against known answers, and against the pair.

mod builders;
mod invariance;
mod pair;
mod single_contact;
