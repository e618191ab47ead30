#![doc = include_str!("../README.md")]

pub mod calibration;
mod careful;
pub mod check;
pub mod compare;
pub mod densify;
pub mod error;
pub mod export;
mod given_up;
pub mod init;
pub mod input;
pub mod number;
pub mod output;
pub mod pair;
pub mod plan;
pub mod predict;
pub mod record;
pub mod report;
pub mod run_task;
pub mod scene;
pub mod simulate;
mod simulator;
pub mod status;
pub mod table3;
pub mod validation;
pub mod verify;
pub mod watch;
mod worker;
