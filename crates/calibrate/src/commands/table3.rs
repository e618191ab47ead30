//! `calibrate table3`: the paper's Table 3, regenerated.

use std::path::{Path, PathBuf};
use std::process::Command;

use workbench::error::Failure;
use workbench::output::{RunFolder, pool};
use workbench::table3::{RECORD, Table3, render};
use workbench::watch::Watch as _;

use crate::arguments;
use crate::terminal::{OnInterrupt, Terminal};

const NOTES: &str = "\
Writes table3.md, .csv, .json and .tex (the table), report.md (errors, statements of the paper, the check that \
was not fitted, how the table is read), and Figures 2, 4, 5 and 6 of the paper. The same seed gives the same bytes.";

/// The paper's Table 3.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = NOTES)]
pub(crate) struct Table3Args {
    /// Simulations per calibration, from 16 to 100000000
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = arguments::samples, allow_negative_numbers = true)]
    samples: usize,

    /// Seed of the random numbers, from 0 to 18446744073709551615
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true)]
    seed: u64,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/table3")]
    out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Table3Args) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, RECORD)?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    let (table, published) = pool(args.threads)?.install(|| {
        let table = Table3::regenerate(args.samples, args.seed, &terminal)?;
        let published = table.publish(&folder, &revision())?;
        Ok::<_, Failure>((table, published))
    })?;
    terminal.announce(&published, &args.out);
    for material in &table.report.materials {
        material
            .advice
            .iter()
            .for_each(|line| terminal.warn(&format!("{}: {line}", material.name)));
    }
    terminal.print(|| {
        format!(
            "{}files: {}/ (table3.md, .csv, .json, .tex; report.md; figure2, 4, 5, 6)\n",
            render::terminal(&table.report),
            args.out.display()
        )
    })
}

/// The commit of the source that this program was built from, as far as it can be told: the last one that
/// touched it, and whether it was changed since.
fn revision() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let git = |arguments: &[&str]| {
        let paths = ["--", "crates", "priors", "experiments", "Cargo.toml", "Cargo.lock"];
        let output = Command::new("git")
            .arg("-C")
            .arg(&root)
            .args(arguments)
            .args(paths)
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match git(&["log", "-1", "--format=%h of %cs"]) {
        Some(commit) if !commit.is_empty() => {
            let clean = git(&["status", "--porcelain"]).is_some_and(|changes| changes.is_empty());
            if clean { commit } else { format!("{commit}, with changes that were not committed") }
        }
        _ => format!("version {}", env!("CARGO_PKG_VERSION")),
    }
}
