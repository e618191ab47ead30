//! What robust noise costs on clean data, and what it does against outliers.

use std::fmt::Write as _;
use std::path::Path;

use rand::SeedableRng as _;
use rand::rngs::ChaCha8Rng;
use rand::seq::index::sample;
use rayon::prelude::*;
use smc_calib::{Noise, Posterior, ShapeSummary};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use crate::args::NoiseArgs;
use crate::pair::{Calibration, settings};
use crate::quantile::quantile;
use crate::report::{Report, Table};

/// How far a row is moved, in a/R.
const BY: f64 = 0.3;
/// Triples of rows.
const TRIPLES: usize = 100;

const TEXT: &str = "\
Three rows of PS (counted from 0) are moved by +0.3 in a/R. Shift: how far the mean of each parameter moves from that of the data as they
are, with the same noise model, in standard deviations of the latter; the largest of C1, tau_s and delta_c. Named: moved rows with a probability above
0.5 to be an outlier, and others so named. Rows that are neighbours in the first rise cannot be recognised by any model of
independent errors: a few rows carry all that is known of the rise, and three moved ones are a slower law.
";

pub(crate) fn run(args: &NoiseArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::part(out, "outliers", &args.command("outliers"))?;
    let mut text = format!("{} simulations.\n{TEXT}\n## Clean data\n\n", args.samples);
    let mut clean = Table::new(&["material", "noise", "ln Z", "sd C1", "sd tau_s", "sd delta_c"]);
    for material in Material::ALL {
        for (name, noise) in super::models::models() {
            let found = posterior(material, &noise, &[], args.samples)?;
            let sds = found.parameters.iter().map(|p| format!("{:.4}", p.in_coordinate.sd));
            let mut row = vec![material.title().to_owned(), name.to_owned()];
            row.push(format!("{:.3}", found.log_evidence.value));
            row.extend(sds);
            clean.push(row);
        }
    }
    text += &clean.markdown();
    let columns = ["rows", "noise", "largest shift", "sd over clean", "named", "others named"];
    let mut table = Table::new(&columns);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut triples = vec![vec![10, 20, 30], vec![2, 15, 30], vec![2, 3, 4]];
    for _ in 0..TRIPLES {
        let mut rows = sample(&mut random, 44, 3).into_vec();
        rows.sort_unstable();
        triples.push(rows);
    }
    for (name, noise) in [("independent", Noise::default()), ("robust", Noise::robust())] {
        let clean = posterior(Material::Ps, &noise, &[], args.samples)?;
        let all: Vec<Moved> = triples
            .par_iter()
            .map(|rows| {
                let found = posterior(Material::Ps, &noise, rows, args.samples)?;
                Ok(Moved::of(rows, &clean, &found))
            })
            .collect::<Result<_, Failure>>()?;
        for moved in &all {
            table.push(moved.row(name));
        }
        let _ = writeln!(text, "\n## {TRIPLES} random triples, {name} errors\n");
        summary(&mut text, &all[3..]);
        let _ = writeln!(text);
        for moved in &all[..3] {
            let _ = writeln!(text, "- rows {:?}: {}", moved.rows, moved.words());
        }
    }
    report.table(&table)?;
    Ok(report.page("Outliers", &text)?)
}

/// What moved rows do.
struct Moved {
    rows: Vec<usize>,
    shift: f64,
    /// Largest standard deviation over that on clean data.
    wider: f64,
    named: usize,
    others: usize,
}

impl Moved {
    fn of(rows: &[usize], clean: &Posterior, found: &Posterior) -> Self {
        let (mut shift, mut wider) = (0.0_f64, 0.0_f64);
        for (a, b) in clean.parameters.iter().zip(&found.parameters) {
            let (a, b) = (a.in_coordinate, b.in_coordinate);
            shift = shift.max(((b.mean - a.mean) / a.sd).abs());
            wider = wider.max(b.sd / a.sd);
        }
        let named: Vec<usize> = match &found.noise_shape {
            Some(ShapeSummary::Robust { outliers, .. }) => {
                (0..outliers.len()).filter(|i| outliers[*i] > 0.5).collect()
            }
            _ => Vec::new(),
        };
        let right = named.iter().filter(|i| rows.contains(i)).count();
        Self { rows: rows.to_vec(), shift, wider, named: right, others: named.len() - right }
    }

    fn row(&self, name: &str) -> Vec<String> {
        vec![
            self.rows.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
            name.to_owned(),
            format!("{:.3}", self.shift),
            format!("{:.2}", self.wider),
            self.named.to_string(),
            self.others.to_string(),
        ]
    }

    fn words(&self) -> String {
        format!(
            "shift {:.2}, largest sd over clean {:.2}, {} of 3 named, {} others",
            self.shift, self.wider, self.named, self.others
        )
    }
}

fn summary(text: &mut String, all: &[Moved]) {
    let mut shifts: Vec<f64> = all.iter().map(|m| m.shift).collect();
    shifts.sort_by(f64::total_cmp);
    let count = |holds: &dyn Fn(&Moved) -> bool| all.iter().filter(|m| holds(m)).count();
    let _ = writeln!(
        text,
        "Largest shift: median {:.2}, 90 % below {:.2}, worst {:.2}; below 0.5 in {} of {}. All three named in {}, others named in {}.",
        quantile(&shifts, 0.5),
        quantile(&shifts, 0.9),
        shifts.last().copied().unwrap_or_default(),
        count(&|m| m.shift < 0.5),
        all.len(),
        count(&|m| m.named == 3),
        count(&|m| m.others > 0),
    );
    let mut worst: Vec<&Moved> = all.iter().filter(|m| m.shift >= 0.5).collect();
    worst.sort_by(|a, b| b.shift.total_cmp(&a.shift));
    if !worst.is_empty() && worst.len() <= 30 {
        let rows: Vec<String> =
            worst.iter().map(|m| format!("{:?} ({:.2})", m.rows, m.shift)).collect();
        let _ = writeln!(text, "\nShift of 0.5 and more: {}.", rows.join(", "));
    }
}

fn posterior(
    material: Material,
    noise: &Noise,
    rows: &[usize],
    samples: usize,
) -> Result<Posterior, Failure> {
    let calibration = Calibration::under(material, noise)?.moved(rows, BY)?;
    let settings = smc_calib::Settings { map_simulations: 0, path: false, ..settings(samples, 1) };
    Ok(calibration.sampled(&settings).map_err(RunError::new)?)
}
