//! `calibrate simulate`: one neck growth curve.

use std::path::PathBuf;

use dem_core::Kinetics;
use workbench::error::Failure;
use workbench::input::material::Material;
use workbench::output;
use workbench::simulate::{CurveOptions, Times, simulate};

use crate::arguments::{self, SolverChoice};
use crate::terminal;

const EXAMPLES: &str = "\
Examples:
  calibrate simulate --material pa12 --table3
  calibrate simulate --material pa12 --c1 1.2e-5 --tau-s 3.8 \\
      --delta-c 9.5e-8 --t-end 10 --points 50
  calibrate simulate --material ps --table3 --solver verlet \\
      --from-contact --out ps.csv
  calibrate simulate --material ps --table3 --heat pulse.toml

The curve goes to standard output (or --out) as CSV: time_s, overlap_m, plastic_overlap_m, contact_ratio. \
Which solver ran and why, and what happens when, goes to standard error.";

/// One curve.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct SimulateArgs {
    /// Built-in material: its powder, final contact ratio and observation times
    #[arg(short, long, value_name = "NAME", value_parser = arguments::material(), help_heading = "Particles")]
    material: Option<Material>,

    /// Take powder, final contact ratio and times from a description (.toml) or a built-in experiment
    #[arg(short, long, value_name = "FILE", help_heading = "Particles")]
    experiment: Option<PathBuf>,

    /// Final contact ratio a/R, from 0.1 to 2, where coalescence stops [default: the experiment's]
    #[arg(long, value_name = "A/R", value_parser = arguments::final_contact_ratio, allow_negative_numbers = true, help_heading = "Particles")]
    phi: Option<f64>,

    /// Fluidity C1, in 1/(Pa s), above 0
    #[arg(long, value_name = "C1", value_parser = arguments::positive, allow_negative_numbers = true, help_heading = "Sintering")]
    c1: Option<f64>,

    /// Sintering time tau_s, in s, above 0
    #[arg(long, value_name = "S", value_parser = arguments::positive, allow_negative_numbers = true, help_heading = "Sintering")]
    tau_s: Option<f64>,

    /// Cut-off distance of the adhesive traction delta_c, in m, above 0
    #[arg(long, value_name = "M", value_parser = arguments::positive, allow_negative_numbers = true, help_heading = "Sintering")]
    delta_c: Option<f64>,

    /// Relaxation time lambda of the kinetics bellehumeur, in s, above 0
    #[arg(long, value_name = "S", value_parser = arguments::positive, allow_negative_numbers = true, help_heading = "Sintering")]
    lambda: Option<f64>,

    /// Take C1, tau_s and delta_c from Table 3 of the paper, converted to SI
    #[arg(long, conflicts_with_all = ["c1", "tau_s", "delta_c", "lambda"], help_heading = "Sintering")]
    table3: bool,

    /// How the neck grows
    #[arg(long, value_name = "NAME", default_value = "three-stage", value_parser = arguments::kinetics(), help_heading = "Model")]
    kinetics: Kinetics,

    /// Under this heat: a file with a heat section, or an experiment's description. Every number of it is stated, here or in the experiment
    #[arg(long, value_name = "FILE", help_heading = "Model")]
    heat: Option<PathBuf>,

    /// How the curve is computed; auto takes the cheapest solver within --tolerance
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = arguments::solver(), help_heading = "Model")]
    solver: SolverChoice,

    /// Largest error of a/R allowed to the solver, from 1e-12 to 0.1
    #[arg(long, value_name = "A/R", default_value = "1e-4", value_parser = arguments::tolerance, allow_negative_numbers = true, help_heading = "Model")]
    tolerance: f64,

    /// Time step of verlet over the collision time, above 0 [default: 0.02]
    #[arg(long, value_name = "DT/TC", value_parser = arguments::positive, allow_negative_numbers = true, help_heading = "Model")]
    step: Option<f64>,

    /// Let verlet start at first contact, as the paper's runs did, instead of in adhesive equilibrium
    #[arg(long, help_heading = "Model")]
    from_contact: bool,

    /// Times of the curve: a CSV file with a column time_s
    #[arg(long, value_name = "FILE", conflicts_with_all = ["t_end", "points"], help_heading = "Times")]
    times: Option<PathBuf>,

    /// Last time of the curve, in s, from 1e-15 to 1e15 [default: the last observation's]
    #[arg(long, value_name = "S", value_parser = arguments::time, allow_negative_numbers = true, help_heading = "Times")]
    t_end: Option<f64>,

    /// Points of the curve, from 2 to 1000000, evenly spaced from time 0
    #[arg(long, value_name = "N", default_value_t = 201, value_parser = arguments::points, allow_negative_numbers = true, help_heading = "Times")]
    points: usize,

    /// Write the curve to a file [default: standard output]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    out: Option<PathBuf>,

    /// Write JSON, with what happens when, instead of CSV
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Say nothing but errors on standard error
    #[arg(short, long, help_heading = "Output")]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &SimulateArgs) -> Result<(), Failure> {
    if let Some(out) = &args.out {
        output::check_file(out)?;
    }
    let found = terminal::working(args.quiet, "the curve", || simulate(&args.options()))?;
    if !args.quiet {
        eprint!("{}", found.text());
    }
    let text = if args.json { found.json()? } else { found.csv() };
    let Some(out) = &args.out else {
        return terminal::write(text.as_bytes());
    };
    output::write_file(out, text.as_bytes())?;
    if !args.quiet {
        eprintln!("curve     {} points -> {}", found.curve.time_s.len(), out.display());
    }
    Ok(())
}

impl SimulateArgs {
    fn options(&self) -> CurveOptions {
        CurveOptions {
            material: self.material,
            experiment: self.experiment.clone(),
            phi: self.phi,
            c1: self.c1,
            tau_s: self.tau_s,
            delta_c: self.delta_c,
            lambda: self.lambda,
            table3: self.table3,
            kinetics: self.kinetics,
            heat: self.heat.clone(),
            solver: self.solver,
            tolerance: self.tolerance,
            step: self.step,
            from_contact: self.from_contact,
            times: match &self.times {
                Some(file) => Times::File(file.clone()),
                None => Times::Even { end_s: self.t_end, points: self.points },
            },
        }
    }
}
