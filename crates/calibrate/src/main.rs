//! The command `calibrate`: parses the command line, calls what it names, and turns failures into
//! exit codes.

use std::io::Write as _;
use std::process::ExitCode;

#[allow(dead_code)]
mod terminal;

use clap::{CommandFactory as _, Parser as _};
use workbench::args::{Args, Command, SHORT_HELP};
use workbench::error::Failure;
use workbench::{
    check, compare, densify, external, inspect, plot_command, predict, run, scene_command,
    simulate, table3, validation,
};

fn main() -> ExitCode {
    let args = Args::parse();
    if args.is_empty() && std::env::args_os().len() == 1 {
        eprintln!("{SHORT_HELP}");
        return ExitCode::from(2);
    }
    match dispatch(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn dispatch(args: &Args) -> Result<(), Failure> {
    match &args.command {
        None => run::run(&args.run),
        Some(Command::Simulate(args)) => simulate::run(args),
        Some(Command::Inspect(args)) => inspect::run(args),
        Some(Command::Plot(args)) => plot_command::run(args),
        Some(Command::Compare(args)) => compare::run(args),
        Some(Command::Table3(args)) => table3::run(args),
        Some(Command::Check(args)) => check::run(args, inspect::understand),
        Some(Command::Predict(args)) => predict::run(args),
        Some(Command::Densify(args)) => densify::run(args),
        Some(Command::Scene(args)) => scene_command::run(args),
        Some(Command::Validate(args)) => validation::run(args),
        Some(Command::Status(args)) => external::status::run(args),
        Some(Command::Export(args)) => external::export::run(args),
        Some(Command::RunTask(args)) => external::run_task::run(args),
        Some(Command::Completions(args)) => {
            let mut script = Vec::new();
            clap_complete::generate(args.shell, &mut Args::command(), "calibrate", &mut script);
            Ok(std::io::stdout().lock().write_all(&script)?)
        }
    }
}
