//! `calibrate check`: what the program understands of files, or what is wrong with them.

use std::path::PathBuf;

use workbench::check::{file_at, missing, together};
use workbench::error::Failure;

use crate::columns::ColumnArgs;
use crate::terminal;

/// Files to validate.
#[derive(Debug, Clone, PartialEq, clap::Args)]
pub(crate) struct CheckArgs {
    /// Descriptions, priors and plans (.toml), observation tables (.csv), posteriors (.json)
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Say nothing about files that are right
    #[arg(short, long)]
    quiet: bool,

    /// Columns of the tables.
    #[command(flatten)]
    columns: ColumnArgs,
}

/// Runs the command, and holds experiments and priors against each other; it goes on after a mistake, so that all are reported.
pub(crate) fn run(args: &CheckArgs) -> Result<(), Failure> {
    let mut right = true;
    let columns = args.columns.columns();
    for file in &args.files {
        match file_at(file, &columns) {
            Ok(understood) => {
                if !args.quiet {
                    let mut text = format!("{}: ok, {}\n", file.display(), understood.headline);
                    for detail in &understood.details {
                        text.push_str(&format!("  {detail}\n"));
                    }
                    terminal::report(&text)?;
                }
                for warning in &understood.warnings {
                    terminal::warning(warning);
                }
            }
            Err(error) => {
                right = false;
                terminal::error(&error.to_string());
            }
        }
    }
    for error in missing(&args.files, &columns) {
        right = false;
        terminal::error(&error.to_string());
    }
    for warning in together(&args.files, &columns) {
        terminal::warning(&warning);
    }
    if right { Ok(()) } else { Err(Failure::InputReported) }
}
