//! `calibrate archive`: a calibration as one file to keep.

use std::path::PathBuf;

use workbench::archive::pack;
use workbench::error::Failure;
use workbench::output::check_file;

use crate::terminal::{OnInterrupt, Terminal};
use workbench::watch::Watch as _;

const EXAMPLES: &str = "\
Examples:
  calibrate archive results/ps ps.zip
  calibrate reproduce ps.zip

Packs results and report, your files that the run was made of (tables, priors, plan, programs beside it), and a \
description as RO-Crate 1.1 (ro-crate-metadata.json) with the SHA-256 of each. The same folder gives the same bytes. What is left out is said.";

/// A calibration to pack.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ArchiveArgs {
    /// A posterior.json, or the folder it is in
    #[arg(value_name = "RUN")]
    run: PathBuf,

    /// The archive to write
    #[arg(value_name = "OUT.zip")]
    out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &ArchiveArgs) -> Result<(), Failure> {
    check_file(&args.out)?;
    let packed = pack(&args.run, &args.out)?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    packed.notes.iter().for_each(|note| terminal.note(note));
    terminal.print(|| {
        let out = args.out.display();
        format!("{out}: {} files, {} kB\n", packed.files, packed.bytes.div_ceil(1000))
    })
}
