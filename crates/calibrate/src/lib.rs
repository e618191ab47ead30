//! The library behind the command `calibrate`.

pub mod plot;
