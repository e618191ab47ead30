//! Many particles against known answers, and against the pair.

mod builders;
mod invariance;
mod packing;
mod pair;
mod quasi_static;
mod single_contact;
