//! The library behind the command `calibrate`.
