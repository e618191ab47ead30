//! The command `calibrate`: parses the command line, calls what it names, and turns failures into
//! exit codes.

#[allow(dead_code)]
mod arguments;
mod commands;
#[allow(dead_code)]
mod terminal;

use std::process::ExitCode;

use clap::Parser as _;

use commands::{Args, SHORT_HELP};

fn main() -> ExitCode {
    let args = Args::parse();
    if args.is_empty() && std::env::args_os().len() == 1 {
        eprintln!("{SHORT_HELP}");
        return ExitCode::from(2);
    }
    match commands::dispatch(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
