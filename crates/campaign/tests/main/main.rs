//! The directory and the executors, as a program uses them.

#![cfg(unix)]
#![allow(clippy::unwrap_used)]

mod local;
mod sandbox;
mod worker;
