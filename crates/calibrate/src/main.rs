//! The command `calibrate`.
fn main() {}
