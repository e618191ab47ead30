//! `calibrate reproduce`: an archived calibration, run again and compared.

use std::io::{BufRead, IsTerminal as _, Write};
use std::path::PathBuf;

use workbench::archive::reproduce;
use workbench::calibration::RunOptions;
use workbench::error::Failure;
use workbench::output::pretty;

use crate::arguments;
use crate::terminal::{OnInterrupt, Terminal, plain};

const EXAMPLES: &str = "\
Examples:
  calibrate reproduce ps.zip
  calibrate reproduce impact.zip --yes
      runs the programs of its plan without asking

Says \"same bits\", \"same within Monte Carlo error: largest difference 0.02 sd\", or what differs (exit code 1): a mean or the \
log evidence by more than four standard errors. An archive is read as if it came from a stranger: names that lead out of it, links, bombs and \
damage are refused, and programs are run only after you have said so.

Exit code 0 for the same bits or the same within Monte Carlo error, 1 for what differs or is not known, 2 for an archive that is refused.";

/// An archive to run again.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ReproduceArgs {
    /// An archive that calibrate archive wrote
    #[arg(value_name = "ARCHIVE.zip")]
    archive: PathBuf,

    /// Run the programs of its plan without asking
    #[arg(long)]
    yes: bool,

    /// Keep the new results in this folder, with the files of its programs [default: compared and removed]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &ReproduceArgs) -> Result<(), Failure> {
    let terminal = Terminal::new(args.quiet, OnInterrupt::Cancel);
    let options =
        RunOptions { out: args.out.clone(), threads: args.threads, ..RunOptions::default() };
    let allow = |commands: &[String]| {
        if args.yes {
            return Ok(true);
        }
        if !std::io::stdin().is_terminal() || !std::io::stderr().is_terminal() {
            return Ok(false);
        }
        ask(commands, &mut std::io::stdin().lock(), &mut std::io::stderr())
    };
    let found = reproduce(&args.archive, &options, &allow, &terminal)?;
    terminal.print_result(args.json, || pretty(&found), || found.text())?;
    Ok(found.passed()?)
}

/// Shows the programs, and asks whether they may be run.
fn ask(
    commands: &[String],
    input: &mut impl BufRead,
    output: &mut impl Write,
) -> Result<bool, Failure> {
    writeln!(output, "This archive runs programs, as you and with your rights:")?;
    for command in commands {
        writeln!(output, "  {}", plain(command))?;
    }
    write!(output, "Run them? [yes/NO] ")?;
    output.flush()?;
    let mut line = String::new();
    input.read_line(&mut line)?;
    Ok(line.trim().eq_ignore_ascii_case("yes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_are_shown_and_run_only_after_a_whole_yes() {
        for (said, runs) in [
            ("yes\n", true),
            ("YES\n", true),
            ("y\n", false),
            ("\n", false),
            ("", false),
            ("no\n", false),
        ] {
            let mut output = Vec::new();
            let commands = ["sh \u{1b}[31m./evil.sh".to_owned()];
            let allowed = ask(&commands, &mut said.as_bytes(), &mut output).expect("asked");
            let shown = String::from_utf8(output).expect("UTF-8");
            assert_eq!(allowed, runs, "{said:?}");
            assert!(shown.contains("./evil.sh") && !shown.contains('\u{1b}'), "{shown}");
        }
    }
}
