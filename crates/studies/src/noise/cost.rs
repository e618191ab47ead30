//! What one likelihood costs with the default nodes, beside the bare recursion with as many.

use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use smc_calib::{Likelihood, Noise};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use crate::pair::Calibration;
use crate::report::{Report, Table, seconds};
use crate::timing::{Clock, Method, interleaved};

const TEXT: &str = "\
PS, 44 rows, one thread; processor times are medians over interleaved rounds with quartiles. The bare recursion: for every node a scalar filter through the
rows (innovation, its square, the next expectation) and one logarithm, written plainly, node after node; the same with eight nodes side
by side, which the compiler may do in vectors for the processor that the program is compiled for. Neither knows of a prior, of
weights or of sums of exponentials. Ratio: over the plain one. Difference: of the log likelihood from that with 40 x 32 nodes, at the posterior's mean.
";

const WHOLE: &str = "\
A calibration of PS with 16 384 simulations, from the prior to the summary with its path and bands, without files and figures:
processor time of all threads. Ratio: over independent errors.
";

const ROWS: usize = 44;
const SIDE: usize = 8;

/// Gains of a filter that look like the real ones, one for each node.
struct Bare {
    decay: Vec<f64>,
    gain: Vec<f64>,
    precision: Vec<f64>,
}

impl Bare {
    fn new(nodes: usize) -> Self {
        let spread = |low: f64, high: f64| -> Vec<f64> {
            (0..nodes * ROWS).map(|k| low + (high - low) * (k % 97) as f64 / 97.0).collect()
        };
        Self { decay: spread(0.3, 0.95), gain: spread(0.1, 0.9), precision: spread(0.5, 3.0) }
    }

    /// Sum over nodes of the logarithm of one plus the sum of squares.
    fn plain(&self, residuals: &[f64]) -> f64 {
        let mut total = 0.0;
        for node in 0..self.decay.len() / ROWS {
            let (mut expected, mut sum) = (0.0, 0.0);
            for (k, residual) in residuals.iter().enumerate() {
                let at = node * ROWS + k;
                let predicted = self.decay[at] * expected;
                let innovation = residual - predicted;
                sum += innovation * innovation * self.precision[at];
                expected = predicted + self.gain[at] * innovation;
            }
            total += (1.0_f64 + sum).ln();
        }
        total
    }

    /// The same, eight nodes side by side.
    fn side_by_side(&self, residuals: &[f64]) -> f64 {
        let mut total = 0.0;
        for block in 0..self.decay.len() / (ROWS * SIDE) {
            let (mut expected, mut sum) = ([0.0; SIDE], [0.0; SIDE]);
            for (k, residual) in residuals.iter().enumerate() {
                let at = (block * ROWS + k) * SIDE;
                let decay = &self.decay[at..at + SIDE];
                let gain = &self.gain[at..at + SIDE];
                let precision = &self.precision[at..at + SIDE];
                for i in 0..SIDE {
                    let predicted = decay[i] * expected[i];
                    let innovation = residual - predicted;
                    sum[i] += innovation * innovation * precision[i];
                    expected[i] = predicted + gain[i] * innovation;
                }
            }
            total += sum.iter().map(|s| (1.0_f64 + s).ln()).sum::<f64>();
        }
        total
    }
}

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let report = Report::part(out, "cost", "noise --only cost")?;
    let table = likelihoods()?;
    report.table(&table)?;
    let text = format!("{TEXT}\n{}\n{WHOLE}\n{}", table.markdown(), whole()?.markdown());
    Ok(report.page("Cost of a likelihood", &text)?)
}

fn correlated(nodes: Option<[usize; 2]>) -> Noise {
    Noise::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes }
}

fn ps(noise: &Noise) -> Result<Calibration, Failure> {
    Calibration::under(Material::Ps, noise)
}

/// Single likelihoods beside the bare recursion.
fn likelihoods() -> Result<Table, Failure> {
    let inferred = ps(&Noise::default())?;
    // The likeliest of some draws of the prior: differences are asked for where the posterior is.
    let likeliest = inferred.posterior(2048, 1).map_err(RunError::new)?;
    let curve = likeliest.map.outputs;
    let residuals: Vec<f64> =
        inferred.observations.values().iter().zip(&curve).map(|(v, o)| v - o).collect();
    let exact = ps(&correlated(Some([40, 32])))?.likelihood.ln_joint(&curve);
    let default = ps(&correlated(None))?.likelihood;
    let (few, fine) =
        (ps(&correlated(Some([8, 11])))?.likelihood, ps(&correlated(Some([20, 16])))?.likelihood);
    let robust = ps(&Noise::robust())?.likelihood;
    let nodes = [88, 150, 320];
    let bare = nodes.map(|nodes| Bare::new(nodes_in_eights(nodes)));
    let path = |likelihood: &Likelihood| {
        let mut cumulative = vec![0.0; ROWS];
        likelihood.ln_cumulative(black_box(&curve), &mut cumulative);
        black_box(cumulative[ROWS - 1]);
    };
    let mut names: Vec<(String, Option<usize>, Option<f64>)> = Vec::new();
    let mut methods: Vec<Method<'_>> = Vec::new();
    for (place, bare) in bare.iter().enumerate() {
        names.push((format!("bare recursion, {} nodes", nodes[place]), Some(place), None));
        methods.push(Box::new(|| {
            black_box(bare.plain(black_box(&residuals)));
        }));
        names.push((format!("eight side by side, {} nodes", nodes[place]), Some(place), None));
        methods.push(Box::new(|| {
            black_box(bare.side_by_side(black_box(&residuals)));
        }));
    }
    let models = [
        ("correlated, 8 x 11 nodes", &few, Some(0)),
        ("correlated, default 10 x 15 nodes", &default, Some(1)),
        ("correlated, 20 x 16 nodes", &fine, Some(2)),
        ("robust", &robust, None),
        ("independent", &inferred.likelihood, None),
    ];
    for (name, likelihood, place) in models {
        let off = place.map(|_| likelihood.ln_joint(&curve) - exact);
        names.push((name.to_owned(), place, off));
        methods.push(Box::new(|| {
            black_box(likelihood.ln_joint(black_box(&curve)));
        }));
        names.push((format!("{name}, path over the rows"), place, None));
        methods.push(Box::new(move || path(likelihood)));
    }
    let times = interleaved(Clock::Thread, &mut methods, 60, Duration::from_secs(4));
    let mut table = Table::new(&["what", "time", "lower quartile", "ratio", "difference"]);
    for ((name, place, off), time) in names.iter().zip(&times) {
        let ratio = place.map(|place| time.median_s / times[2 * place].median_s);
        table.push(vec![
            name.clone(),
            seconds(time.median_s),
            seconds(time.lower_s),
            ratio.map_or_else(String::new, |ratio| format!("{ratio:.2}")),
            off.map_or_else(String::new, |off| format!("{off:+.1e}")),
        ]);
    }
    Ok(table)
}

/// Whole calibrations, each with its own noise; the first is what the others are held against.
fn whole() -> Result<Table, Failure> {
    let calibrations = [
        ("independent", ps(&Noise::default())?),
        ("correlated", ps(&correlated(None))?),
        ("robust", ps(&Noise::robust())?),
    ];
    let mut methods: Vec<Method<'_>> = Vec::new();
    for (_, calibration) in &calibrations {
        methods.push(Box::new(|| {
            let _ = black_box(calibration.posterior(16_384, 1));
        }));
    }
    let times = interleaved(Clock::Process, &mut methods, 15, Duration::from_secs(30));
    let mut table = Table::new(&["noise", "time", "lower quartile", "ratio"]);
    for ((name, _), time) in calibrations.iter().zip(&times) {
        let ratio = time.median_s / times[0].median_s;
        table.push(vec![
            (*name).to_owned(),
            seconds(time.median_s),
            seconds(time.lower_s),
            format!("{ratio:.2}"),
        ]);
    }
    Ok(table)
}

/// The next multiple of eight.
fn nodes_in_eights(nodes: usize) -> usize {
    nodes.div_ceil(SIDE) * SIDE
}
