//! The directory and the executors, as a program uses them.

#![cfg(unix)]
#![allow(clippy::unwrap_used)]

mod damage;
mod fed;
mod full_disk;
mod kills;
mod local;
mod outages;
mod persistent;
mod sandbox;
mod status;
mod store;
mod worker;
