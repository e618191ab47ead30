//! How often intervals hold the truth, for data of four origins calibrated with three noise models.

use std::path::Path;

use dem_core::Kinetics;
use rand::RngExt as _;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;
use smc_calib::sbc::{self, MadeErrors, Origin, Outcome, Study};
use smc_calib::{FixedSigma, Noise, Settings, Simulator};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use super::models::models;
use crate::args::NoiseArgs;
use crate::pair::{Calibration, settings};
use crate::quantile::quantile;
use crate::report::{Report, Table};

/// Share of outliers in the data that have them, and how much wider than the other errors they scatter.
const OUTLIERS: (f64, f64) = (0.07, 10.0);
/// Standard deviation of the errors where the law is another one.
const SMALL: f64 = 0.01;

const TEXT: &str = "\
Data sets at the 44 observation times of PS: parameters drawn from the priors of PS, noise as said, calibrated with each noise
model. Shares of data sets whose interval holds the truth; the Monte Carlo standard error of a share near 50 % is
0.5/sqrt(data sets), of one near 95 % 0.22/sqrt(data sets). Width: the posterior standard deviation over that with the model in bold,
median over data sets and parameters. ln Z: the log evidence beside that of the model in bold, median and the share of data sets that
prefer the row's model. Bold: the noise model that the data come from; for the other law there is none, and independent stands in.

Origins: independent, sigma from its prior; correlated, sigma, length and white share from their priors; outliers, independent and
each observation with probability 0.07 ten times as far off (three of 44); another law, curves of three-stage-pokluda
with errors of 0.01, fitted with three-stage: what is called the truth there are the parameters of the other law.
";

type Errors = dyn Fn(&mut ChaCha8Rng) -> Option<MadeErrors> + Sync;

/// Where data come from, and which of the models is that.
struct Source<'a> {
    name: &'static str,
    simulator: &'a dyn Simulator,
    errors: Box<Errors>,
    model: usize,
}

pub(crate) fn run(args: &NoiseArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::part(out, "coverage", &args.command("coverage"))?;
    let ps = Calibration::of(Material::Ps)?;
    let other = ps.model.with_kinetics(Kinetics::ThreeStagePokluda);
    let mut columns = vec!["data from", "calibrated with", "data sets"];
    let names: Vec<String> = ps.parameters.iter().map(|p| p.name.clone()).collect();
    columns.extend([
        "C1 50 %",
        "C1 95 %",
        "tau_s 50 %",
        "tau_s 95 %",
        "delta_c 50 %",
        "delta_c 95 %",
        "all 50 %",
        "all 95 %",
        "width",
        "ln Z",
        "preferred",
        "k-hat > 0.7",
    ]);
    debug_assert_eq!(names, ["c1", "tau_s", "delta_c"]);
    let mut table = Table::new(&columns);
    for source in sources(&ps, &other) {
        let mut found = Vec::new();
        for (name, noise) in models() {
            eprintln!("data {}, calibrated with {name}", source.name);
            let study = Study {
                simulator: &ps.model,
                parameters: ps.parameters.clone(),
                control: ps.observations.control().to_vec(),
                noise,
                origin: Some(Origin { simulator: source.simulator, errors: &*source.errors }),
                settings: Settings { draws: 256, ..settings(args.samples, 1) },
                data_sets: args.data_sets,
            };
            found.push(sbc::run(&study).map_err(RunError::new)?);
        }
        for (place, (name, _)) in models().iter().enumerate() {
            let bold =
                if place == source.model { format!("**{name}**") } else { (*name).to_owned() };
            let mut row = vec![source.name.to_owned(), bold, args.data_sets.to_string()];
            row.extend(cells(&found[place], &found[source.model]));
            table.push(row);
        }
    }
    report.table(&table)?;
    let text = format!("{} simulations each.\n{TEXT}\n{}", args.samples, table.markdown());
    Ok(report.page("Coverage: truth and model", &text)?)
}

fn sources<'a>(ps: &'a Calibration, other: &'a dyn Simulator) -> [Source<'a>; 4] {
    let control = ps.observations.control().to_vec();
    let of = |noise: Noise| -> Box<Errors> {
        let control = control.clone();
        Box::new(move |rng| noise.draw_errors(&control, rng))
    };
    let normal = control.clone();
    let outliers: Box<Errors> = Box::new(move |rng| {
        let (noise, mut errors) = Noise::default().draw_errors(&normal, rng)?;
        for error in &mut errors {
            let outlier = rng.random::<f64>() < OUTLIERS.0;
            let score: f64 = rng.sample(StandardNormal);
            if outlier {
                *error = OUTLIERS.1 * noise.sigma * score;
            }
        }
        Some((noise, errors))
    });
    let small = Noise::Fixed { sigma: FixedSigma::Absolute(SMALL) };
    let model: &dyn Simulator = &ps.model;
    let source = |name, simulator, errors, model| Source { name, simulator, errors, model };
    [
        source("independent", model, of(Noise::default()), 0),
        source("correlated", model, of(Noise::correlated()), 1),
        source("outliers", model, outliers, 2),
        source("another law", other, of(small), 0),
    ]
}

fn cells(found: &[Outcome], right: &[Outcome]) -> Vec<String> {
    let n = found.len() as f64;
    let share = |holds: &dyn Fn(&Outcome) -> bool| {
        100.0 * found.iter().filter(|outcome| holds(outcome)).count() as f64 / n
    };
    let mut cells = Vec::new();
    let mut sums = [0.0; 2];
    for j in 0..3 {
        let both = [share(&|o: &Outcome| o.inside50[j]), share(&|o: &Outcome| o.inside95[j])];
        cells.extend(both.iter().map(|share| format!("{share:.1}")));
        sums = [sums[0] + both[0] / 3.0, sums[1] + both[1] / 3.0];
    }
    cells.extend(sums.map(|share| format!("{share:.1}")));
    let pairs = || found.iter().zip(right);
    let mut widths: Vec<f64> =
        pairs().flat_map(|(a, b)| a.sd.iter().zip(&b.sd).map(|(a, b)| a / b)).collect();
    widths.sort_by(f64::total_cmp);
    let mut evidence: Vec<f64> = pairs().map(|(a, b)| a.log_evidence - b.log_evidence).collect();
    evidence.sort_by(f64::total_cmp);
    let preferred = evidence.iter().filter(|d| **d > 0.0).count() as f64 / n;
    cells.extend([
        format!("{:.2}", quantile(&widths, 0.5)),
        format!("{:+.2}", quantile(&evidence, 0.5)),
        format!("{:.0} %", 100.0 * preferred),
        format!("{:.1}", share(&|o: &Outcome| o.khat > 0.7)),
    ]);
    cells
}
