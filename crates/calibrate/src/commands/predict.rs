//! `calibrate predict`: sintering times of a pair from a saved posterior, or from the average of compared models.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::input::heat::HeatFields;
use workbench::output::{pretty, write_file};
use workbench::pair::draws::PairDraws;
use workbench::predict::{Wanted, predict, predict_average};

use crate::arguments;
use crate::terminal;

const EXAMPLES: &str = "\
Examples:
  calibrate predict --posterior results/pa12 --contact-ratio 0.9
  calibrate predict --posterior results/pa12 \\
      --coalescence 60 --coalescence 100
  calibrate predict --posterior results/pa12 --after 1,2,5 --radius-m 25e-6
  calibrate predict --average results/compare --of pa12 --contact-ratio 0.9
  calibrate predict --average results/compare --of pa12 --after 1,2,5 \\
      --with-noise
  calibrate predict --posterior results/ps-heat --of e23 \\
      --pulse-energy 25 --energy-for 1";

/// Options of a prediction from a saved posterior.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PredictArgs {
    /// A posterior.json, or the folder it is in; draws.csv must be beside it
    #[arg(
        short,
        long,
        value_name = "FILE",
        required_unless_present = "average",
        conflicts_with = "average"
    )]
    posterior: Option<PathBuf>,

    /// Average over kinetics and noise by evidence: the folder of a comparison (calibrate compare)
    #[arg(long, value_name = "DIR")]
    average: Option<PathBuf>,

    /// The experiment of a posterior of several, or with --average the material or experiment of a comparison of several
    #[arg(long, value_name = "NAME")]
    of: Option<String>,

    /// When is this contact ratio a/R reached? Above 0, at most 2
    #[arg(short, long, value_name = "A/R", value_delimiter = ',', value_parser = arguments::contact_ratio, allow_negative_numbers = true)]
    contact_ratio: Vec<f64>,

    /// When is this much coalescence reached, in percent of a/R = 1? Above 0, at most 200
    #[arg(long, value_name = "PERCENT", value_delimiter = ',', value_parser = arguments::percent, allow_negative_numbers = true)]
    coalescence: Vec<f64>,

    /// What is a/R after this time in seconds, from 1e-15 to 1e15?
    #[arg(short, long, value_name = "S", value_delimiter = ',', value_parser = arguments::time, allow_negative_numbers = true)]
    after: Vec<f64>,

    /// With --after: say too how a/R would be measured there in a new experiment, with the noise of each draw
    #[arg(long)]
    with_noise: bool,

    /// Radius of the pair in metres, from 1e-9 to 1e-2 [default: the one that was calibrated]; tau_s moves in proportion
    #[arg(short, long, value_name = "M", value_parser = arguments::radius, allow_negative_numbers = true)]
    radius_m: Option<f64>,

    /// Under another heat: a file with a heat section, or an experiment's description. What it leaves open is taken from the posterior
    #[arg(long, value_name = "FILE")]
    heat: Option<PathBuf>,

    /// Under a pulse of this energy, from 1e-12 to 1e12 in the unit of the calibrated ones
    #[arg(long, value_name = "E", value_parser = arguments::pulse_energy, allow_negative_numbers = true)]
    pulse_energy: Option<f64>,

    /// Which pulse energy reaches this contact ratio a/R, above 0 and at most 2, with --probability?
    #[arg(long, value_name = "A/R", value_parser = arguments::contact_ratio, allow_negative_numbers = true)]
    energy_for: Option<f64>,

    /// With --energy-for: the probability with which the energy is to be enough, above 0 and below 1
    #[arg(long, value_name = "P", default_value = "0.95", value_parser = arguments::probability, allow_negative_numbers = true)]
    probability: f64,

    /// Write the predictions as CSV too
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &PredictArgs) -> Result<(), Failure> {
    let mut targets = args.contact_ratio.clone();
    // The paper counts coalescence in percent of a/R = 1.
    targets.extend(args.coalescence.iter().map(|percent| percent / 100.0));
    let wanted = Wanted {
        targets,
        after_s: args.after.clone(),
        radius_m: args.radius_m,
        with_noise: args.with_noise,
        heat: args.heat.as_deref().map(HeatFields::open).transpose()?,
        pulse_energy: args.pulse_energy,
        enough: args.energy_for.map(|ratio| (ratio, args.probability)),
    };
    let prediction = match (&args.average, &args.posterior) {
        (Some(folder), _) => predict_average(folder, args.of.as_deref(), &wanted)?,
        (None, Some(posterior)) => {
            predict(&PairDraws::read_of(posterior, args.of.as_deref())?, &wanted)?
        }
        (None, None) => return Ok(()),
    };
    if let Some(out) = &args.out {
        write_file(out, prediction.csv().as_bytes())?;
    }
    if args.json {
        return terminal::write(pretty(&prediction)?.as_bytes());
    }
    terminal::report(&prediction.text())
}
