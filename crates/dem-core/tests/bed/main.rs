//! Many particles against known answers, and against the pair.

mod builders;
mod carried;
mod closure;
mod files;
mod heated;
mod invariance;
mod necks;
mod packing;
mod pair;
mod quasi_static;
mod scenes;
mod single_contact;
