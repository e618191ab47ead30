//! The commands, one file each: its options, and how they become a call of the library.

mod archive;
mod calibrate;
mod check;
mod compare;
mod completions;
mod densify;
mod diff;
mod export;
mod init;
mod inspect;
mod plot;
mod population;
mod predict;
mod report;
mod reproduce;
mod run_task;
mod runs;
mod scene;
mod simulate;
mod status;
mod table3;
mod validate;

use clap::{CommandFactory as _, Parser, Subcommand};
use workbench::error::Failure;

use archive::ArchiveArgs;
use calibrate::CalibrateArgs;
use check::CheckArgs;
use compare::CompareArgs;
use completions::CompletionsArgs;
use densify::DensifyArgs;
use diff::DiffArgs;
use export::ExportArgs;
use init::InitArgs;
use inspect::InspectArgs;
use plot::PlotArgs;
use population::PopulationArgs;
use predict::PredictArgs;
use report::ReportArgs;
use reproduce::ReproduceArgs;
use run_task::RunTaskArgs;
use runs::RunsArgs;
use scene::SceneArgs;
use simulate::SimulateArgs;
use status::StatusArgs;
use table3::Table3Args;
use validate::ValidateArgs;

const AFTER_HELP: &str = "\
Examples:
  calibrate --material ps
      measured neck growth of polystyrene -> results/ps/
  calibrate --material pa12 --dry-run
      say what would be done, and stop
  calibrate --material ps --experiment my.csv
      own measurements of a built-in powder
  calibrate init my.csv
      own powder: writes my.toml and my-priors.toml for a table
  calibrate --experiment experiments/example-my-powder.toml \\
      --prior priors/example-my-powder.toml
      own powder, own measurements, own priors
  calibrate --plan experiments/external/impact.toml
      own simulation program, own measurements of any kind
  calibrate --resume results/impact
      go on after an interruption
  calibrate --resume results/impact --samples 600
      more runs for a run that is there; all it has made count
  calibrate --continue-from results/ps --samples 32768
      the same of a run of a built-in simulator
  calibrate inspect results/ps/posterior.json
      print a posterior again
  calibrate plot results/ps --width full
      draw its figures again
  calibrate compare --material ps
      which kinetics do the data support?
  calibrate table3
      the paper's Table 3, all three materials

All quantities are SI. Exit codes: 0 done, 1 the run failed, 2 a mistake in what was given, \
130 interrupted. calibrate help COMMAND explains a command.";

/// Text printed by `calibrate` without arguments.
pub(crate) const SHORT_HELP: &str = "\
Posteriors of sintering parameters from measured neck growth.

  calibrate --material ps        calibrate polystyrene and write results/ps/
  calibrate init my.csv          the files for a table of your own
  calibrate --help               everything else
  calibrate help COMMAND         the options of a command

Built-in materials: ps, pa12, peek.";

/// Posteriors of sintering parameters (C1, tau_s, delta_c) from the measured neck growth of two
/// particles
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(
    name = "calibrate",
    version,
    override_usage = "calibrate --material <NAME> [OPTIONS]\n       calibrate --experiment <FILE> [--prior <FILE>] [OPTIONS]\n       calibrate --plan <FILE> [OPTIONS]\n       calibrate --resume <DIR> [--samples <N>]\n       calibrate --continue-from <DIR> --samples <N>\n       calibrate <COMMAND>",
    after_help = AFTER_HELP,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    infer_subcommands = false,
    max_term_width = 100
)]
pub(crate) struct Args {
    /// A command other than the main job.
    #[command(subcommand)]
    command: Option<Command>,
    /// The main job.
    #[command(flatten)]
    run: CalibrateArgs,
}

impl Args {
    /// Whether nothing was asked for.
    pub(crate) fn is_empty(&self) -> bool {
        self.command.is_none() && self.run.is_empty()
    }
}

/// The commands beside the main job.
#[derive(Debug, Clone, PartialEq, Subcommand)]
enum Command {
    /// Write the experiment and prior files for a table of measurements: the way in for your own powder
    Init(InitArgs),
    /// Compute one neck growth curve, without calibrating anything
    Simulate(SimulateArgs),
    /// Print the posterior of a run that was saved
    Inspect(InspectArgs),
    /// Draw the figures of a saved run again, without simulating anything
    Plot(PlotArgs),
    /// Make the report.html of a saved calibration again: one file for readers who were not there
    Report(ReportArgs),
    /// Pack a calibration into one file to keep: results, report, inputs, an RO-Crate description
    Archive(ArchiveArgs),
    /// Run an archived calibration again and say whether its results are the same
    Reproduce(ReproduceArgs),
    /// Compare the kinetics on measured data: evidence, errors, prediction of left-out points
    Compare(CompareArgs),
    /// Regenerate Table 3 of the paper: calibrate PS, PA12 and PEEK 450PF and report
    Table3(Table3Args),
    /// Read experiment, prior or posterior files and say what is wrong with them, without running
    Check(CheckArgs),
    /// How much calibrated pairs differ, and the next pair: a population of finished runs
    Population(PopulationArgs),
    /// Predict sintering times of a pair from a saved posterior, with their intervals
    Predict(PredictArgs),
    /// Run a powder bed for draws of a posterior: density over time, time to a target density
    Densify(DensifyArgs),
    /// Run a scene of many particles: series, pictures, VTK files
    Scene(SceneArgs),
    /// Check the sampler by simulation-based calibration: made data, ranks, coverage
    Validate(ValidateArgs),
    /// Two runs side by side: what differs in their plans, and what that did to parameters and evidence
    Diff(DiffArgs),
    /// List the results in a folder: what each is of, whether to trust it, its age and size, which are superseded
    Runs(RunsArgs),
    /// Say how far the run of a plan is: done, running, failed by cause, time left
    Status(StatusArgs),
    /// Write a posterior for ArviZ, R and Stan's readers; or what the run of a plan has so far as tables
    Export(ExportArgs),
    /// Make given runs of a plan; what a job on a cluster calls
    #[command(hide = true)]
    RunTask(RunTaskArgs),
    /// Print the completion script for a shell
    Completions(CompletionsArgs),
}

/// Runs what was asked for.
pub(crate) fn dispatch(args: &Args) -> Result<(), Failure> {
    match &args.command {
        None => calibrate::run(&args.run),
        Some(Command::Init(args)) => init::run(args),
        Some(Command::Simulate(args)) => simulate::run(args),
        Some(Command::Inspect(args)) => inspect::run(args),
        Some(Command::Plot(args)) => plot::run(args),
        Some(Command::Report(args)) => report::run(args),
        Some(Command::Archive(args)) => archive::run(args),
        Some(Command::Reproduce(args)) => reproduce::run(args),
        Some(Command::Compare(args)) => compare::run(args),
        Some(Command::Table3(args)) => table3::run(args),
        Some(Command::Check(args)) => check::run(args),
        Some(Command::Population(args)) => population::run(args),
        Some(Command::Predict(args)) => predict::run(args),
        Some(Command::Densify(args)) => densify::run(args),
        Some(Command::Scene(args)) => scene::run(args),
        Some(Command::Validate(args)) => validate::run(args),
        Some(Command::Diff(args)) => diff::run(args),
        Some(Command::Runs(args)) => runs::run(args),
        Some(Command::Status(args)) => status::run(args),
        Some(Command::Export(args)) => export::run(args),
        Some(Command::RunTask(args)) => run_task::run(args),
        Some(Command::Completions(args)) => completions::run(args, Args::command()),
    }
}

#[cfg(test)]
mod tests {
    use dem_core::Kinetics;
    use smc_calib::Noise;
    use workbench::input::material::Material;
    use workbench::plan::PairOptions;

    use super::*;

    fn parse(line: &str) -> Result<Args, clap::Error> {
        Args::try_parse_from(std::iter::once("calibrate").chain(line.split_whitespace()))
    }

    fn refused(line: &str) -> String {
        let error = parse(line).expect_err(line);
        assert_eq!(error.exit_code(), 2, "{line}");
        error.to_string()
    }

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn the_main_job_needs_a_material_and_has_the_documented_defaults() {
        let args = parse("--material ps").expect("valid");
        assert_eq!(args.command, None);
        let documented = PairOptions { material: Some(Material::Ps), ..PairOptions::default() };
        assert_eq!(args.run.pair(), documented);
        assert_eq!((documented.samples, documented.iterations), (16_384, None));
        assert_eq!((documented.tolerance, documented.seed), (1e-4, 1));
        assert_eq!((documented.kinetics, documented.solver), (Kinetics::ThreeStage, None));
        assert_eq!(documented.noise, Noise::Inferred { nu0: 4.0, s0: 0.05 });
        assert!(parse("").expect("nothing").is_empty());
    }

    #[test]
    fn mistakes_on_the_command_line_exit_2_and_offer_a_remedy() {
        assert!(refused("--material pekk").contains("peek"));
        assert!(refused("--material ps --kinetics frenkle").contains("frenkel"));
        assert!(refused("--material ps --solver verlett").contains("verlet"));
        assert!(refused("--materiel ps").contains("--material"));
        assert!(refused("--material ps --samples 0").contains("from 16 to"));
        assert!(refused("--material ps --samples 1.5").contains("whole number"));
        assert!(refused("--material ps --tolerance 0").contains("1e-12"));
        assert!(refused("--material ps --window 2:1").contains("1:2"));
        assert!(refused("--material ps --resume").contains("--resume"));
        assert!(refused("simulate --material ps --tau-s -1").contains("> 0"));
        assert!(refused("simulate --material ps --tau-s 1,5").contains("1.5"));
        assert!(refused("simulate --table3 --c1 1").contains("--c1"));
        assert!(refused("check").contains("FILE"));
        assert_eq!(parse("--material ps --samples 1e5").expect("1e5").run.pair().samples, 100_000);
    }

    /// All options of all commands, each with the words before it on a command line.
    fn options() -> Vec<(Vec<String>, clap::Arg)> {
        let command = Args::command();
        let own = |words: Vec<String>, command: &clap::Command| {
            let options = command.get_arguments().filter(|arg| arg.get_long().is_some());
            options.map(|arg| (words.clone(), arg.clone())).collect::<Vec<_>>()
        };
        let mut all = own(vec![], &command);
        for one in command.get_subcommands().filter(|one| !one.is_hide_set()) {
            all.extend(own(vec![one.get_name().to_owned()], one));
        }
        all
    }

    /// Whether the value itself of an option is refused.
    fn is_refused(words: &[String], option: &clap::Arg, value: &str) -> bool {
        let option = format!("--{}", option.get_long().expect("a name"));
        let line = [&["calibrate".to_owned()], words, &[option, value.to_owned()]].concat();
        Args::try_parse_from(line)
            .is_err_and(|error| error.kind() == clap::error::ErrorKind::ValueValidation)
    }

    #[test]
    fn every_option_that_takes_a_number_says_from_where_to_where_and_takes_no_other() {
        const NUMBERS: [&str; 11] =
            ["N", "A/R", "C1", "S", "M", "DT/TC", "PERCENT", "DENSITY", "PA", "N/M", "KG/M3"];
        let mut seen = 0;
        for (words, option) in options() {
            let name = option.get_value_names().and_then(|names| names.first().cloned());
            if !name.is_some_and(|name| NUMBERS.contains(&name.as_str())) {
                continue;
            }
            seen += 1;
            let long = option.get_long().expect("a name");
            let help = option.get_help().expect("a help").to_string();
            let words_of_help: Vec<&str> = help
                .split_whitespace()
                .map(|word| word.trim_end_matches(['.', ',', ';', '?']))
                .collect();
            // The words behind some others, as many as there are names for.
            let behind = |start: &[&str], count: usize| {
                let all = start.len() + count;
                let found = words_of_help.windows(all).find(|found| {
                    let same = |(word, one): (&&str, &&str)| word.eq_ignore_ascii_case(one);
                    let number = found[start.len()].parse::<f64>().is_ok();
                    number && found.iter().zip(start).all(same)
                });
                found.map(|found| found[start.len()..].to_vec())
            };
            let refused = |value: &str| is_refused(&words, &option, value);
            let shifted = |end: &str, by: i128| match end.parse::<i128>() {
                Ok(end) => (end + by).to_string(),
                Err(_) => {
                    format!("{:e}", end.parse::<f64>().expect("a number") * (1.0 + by as f64 / 9.0))
                }
            };
            if let Some(range) = behind(&["from"], 3).filter(|range| range[1] == "to") {
                let [low, high] = [range[0], range[2]];
                assert!(!refused(low) && !refused(high), "{words:?} --{long}: {low} to {high}");
                assert!(refused(&shifted(low, -1)), "{words:?} --{long} below {low}");
                assert!(refused(&shifted(high, 1)), "{words:?} --{long} above {high}");
            } else if behind(&["above"], 1).is_some_and(|bound| bound == ["0"]) {
                assert!(refused("0") && !refused("1e-3"), "{words:?} --{long}: above 0");
                if let Some(most) = behind(&["at", "most"], 1) {
                    let most = most[0];
                    assert!(!refused(most) && refused(&shifted(most, 1)), "{words:?} --{long}");
                }
            } else {
                let least = behind(&["at", "least"], 1);
                let least = least.unwrap_or_else(|| panic!("{words:?} --{long}: {help}"))[0];
                assert!(!refused(least) && refused(&shifted(least, -1)), "{words:?} --{long}");
            }
            assert!(refused("-1"), "{words:?} --{long} -1");
        }
        assert!(seen > 30, "{seen} options");
    }

    #[test]
    fn help_is_a_command_and_texts_below_the_options_wrap_whole() {
        for command in ["plot", "compare", "simulate"] {
            let error = parse(&format!("help {command}")).expect_err("help");
            assert_eq!(error.kind(), clap::error::ErrorKind::DisplayHelp);
            assert!(error.to_string().contains(&format!("calibrate {command}")), "{error}");
        }
        let command = Args::command();
        for one in command.get_subcommands().chain([&command]) {
            let Some(text) = one.get_after_help().map(ToString::to_string) else { continue };
            let lines: Vec<&str> = text.lines().collect();
            let is_text =
                |line: &str| !line.is_empty() && !line.starts_with(' ') && line != "Examples:";
            for (line, next) in lines.iter().zip(lines.iter().skip(1).chain([&""])) {
                // Commands fit into 80 columns; paragraphs are one line, which is wrapped where the terminal ends.
                assert!(is_text(line) || line.len() <= 78, "{}: {line}", one.get_name());
                assert!(!(is_text(line) && is_text(next)), "{}: {line}", one.get_name());
            }
        }
    }
}
