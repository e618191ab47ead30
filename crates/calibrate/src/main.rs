//! The command `calibrate`: parses the command line, calls what it names, and turns failures into
//! exit codes.

mod arguments;
mod columns;
mod commands;
mod terminal;

use std::process::ExitCode;

use clap::Parser as _;

use workbench::error::Failure;

use commands::{Args, SHORT_HELP};

fn main() -> ExitCode {
    let args = Args::parse();
    if args.is_empty() && std::env::args_os().len() == 1 {
        eprintln!("{SHORT_HELP}");
        return ExitCode::from(2);
    }
    match commands::dispatch(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            match &failure {
                Failure::OutputClosed | Failure::InputReported => {}
                Failure::Paused(how) => eprintln!("{}", terminal::plain(how)),
                _ => terminal::error(&failure.to_string()),
            }
            ExitCode::from(failure.code())
        }
    }
}
