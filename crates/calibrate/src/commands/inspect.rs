//! `calibrate inspect`: a saved posterior as tables in the terminal.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::input::text_file::folder_of;
use workbench::{record, report};

use crate::terminal;

/// A saved run.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub(crate) struct InspectArgs {
    /// A posterior.json, or the folder it is in
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &InspectArgs) -> Result<(), Failure> {
    let record = record::read(&args.file)?;
    if args.json {
        return terminal::write(report::json(&record, None)?.as_bytes());
    }
    let file = record::locate(&args.file);
    let summary = report::in_folder(&report::text(&record, None, None), folder_of(&file));
    let details = report::details(&record);
    terminal::report(&format!("{summary}\n{}\n", details.trim_end()))
}
