//! `calibrate completions`: the completion script for a shell.

use clap_complete::Shell;
use workbench::error::Failure;

use crate::terminal;

/// Shell completions.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub(crate) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Prints the script for a command line.
pub(crate) fn run(args: &CompletionsArgs, mut all: clap::Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut all, "calibrate", &mut script);
    terminal::write(&script)
}
