//! How the cost of a calibration grows with samples, observations, dimensions and threads, and what memory a
//! million samples take.

use std::path::Path;
use std::time::Instant;

use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries};
use smc_calib::{CalibrateError, Settings, reference};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;
use workbench::number::significant;

use crate::cases::{Case, Errors, Exact, Run};
use crate::pair::Calibration;
use crate::report::{self, Report, Table};
use crate::seeds::threads;
use crate::timing::{Clock, Timing, peak_memory_mib};

/// Runs of which each time is the median; one where it takes more than [`SLOW_S`].
const REPEATS: usize = 5;
const SLOW_S: f64 = 2.0;

/// Simulations where their number does not grow.
const SIMULATIONS: usize = 16_384;

/// Growing quantities, in the order of table and figure.
const GROWING: [&str; 4] = ["samples", "observations", "dimensions", "threads"];

/// One row of the table, one point of the figure.
struct Row {
    what: &'static str,
    size: usize,
    threads: usize,
    simulations: usize,
    /// Wall and processor time \[s\].
    times_s: [f64; 2],
    run: Run,
    /// Where the answer is known.
    errors: Option<Errors>,
}

impl Row {
    fn new(
        what: &'static str,
        [size, threads, simulations]: [usize; 3],
        (times_s, run): ([f64; 2], Run),
        exact: Option<&Exact>,
    ) -> Self {
        let errors = exact.map(|exact| Errors::of(exact, &run.estimate));
        Self { what, size, threads, simulations, times_s, run, errors }
    }

    /// Largest standard error of a mean, in posterior sds.
    fn mean_se(&self) -> f64 {
        let shares = self.run.mean_se.iter().zip(&self.run.estimate.sd).map(|(se, sd)| se / sd);
        shares.fold(0.0, f64::max)
    }

    fn cells(&self) -> Vec<String> {
        let Self { run, errors, .. } = self;
        let n = self.simulations as f64;
        let largest = |errors: &[f64]| {
            significant(errors.iter().map(|error| error.abs()).fold(0.0, f64::max), 2)
        };
        let unknown = || "–".to_owned();
        vec![
            self.what.to_owned(),
            self.size.to_string(),
            self.threads.to_string(),
            significant(self.times_s[0], 3),
            significant(self.times_s[1], 3),
            report::seconds(self.times_s[1] / n),
            significant(run.ess, 4),
            significant(run.khat, 2),
            significant(run.component_densities as f64 / n, 3),
            significant(self.mean_se(), 2),
            errors.as_ref().map_or_else(unknown, |errors| largest(&errors.mean)),
            significant(run.log_evidence_se, 2),
            errors.as_ref().map_or_else(unknown, |errors| largest(errors.log_evidence.as_slice())),
        ]
    }
}

/// Numbers of samples, the largest first: the memory of a process is known by its highest mark alone.
const SAMPLES: [usize; 6] = [1_000_000, 262_144, 65_536, 16_384, 4_096, 1_000];

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let mut report = Report::begin(out, "growth")?;
    let polystyrene = Calibration::of(Material::Ps)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut memory = None;
    let mut of_samples = Vec::new();
    for n in SAMPLES {
        of_samples.push((n, median(cores, || sampled(&polystyrene, n))?));
        memory = memory.or_else(peak_memory_mib);
    }
    let exact = Case::material(Material::Ps)?.exact;
    let mut rows: Vec<Row> = of_samples
        .into_iter()
        .rev()
        .map(|(n, timed)| Row::new("samples", [n, cores, n], timed, Some(&exact)))
        .collect();
    for m in [10, 100, 1_000, 10_000] {
        let paper = Material::Ps.table3_sintering();
        let many = Calibration::of(Material::Ps)?.made_up(m, 0.11, &paper, 0.02)?;
        let timed = median(cores, || sampled(&many, SIMULATIONS))?;
        rows.push(Row::new("observations", [m, cores, SIMULATIONS], timed, None));
    }
    for d in 1..=10 {
        rows.push(of_dimension(d, cores)?);
    }
    for threads in [1, 2] {
        let timed = median(threads, || sampled(&polystyrene, SIMULATIONS))?;
        rows.push(Row::new("threads", [threads, threads, SIMULATIONS], timed, Some(&exact)));
    }
    let table = table(&rows);
    report.figure("figure", &figure(&rows))?;
    report.table(&table)?;
    let memory = memory.map_or_else(
        || "not measured here (it is read from /proc)".to_owned(),
        |mib| format!("{} MiB at most, of the whole process", significant(mib, 3)),
    );
    let text = format!(
        "Median wall time and processor time of {REPEATS} runs (of one, where it takes more than {SLOW_S} s), sampler and \
         summary without files and figures. {TEXT}\n{}\nMemory of a calibration of {} samples: {memory}.\n",
        table.markdown(),
        SAMPLES[0],
    );
    Ok(report.page("How the cost of a calibration grows", &text)?)
}

const TEXT: &str = "\
Samples, observations and threads: polystyrene, closed form; the observations are the paper's curve with a scatter of
0.02. Dimensions: the conjugate Gaussian reference, every coordinate measured with a tenth of its prior's standard
deviation. Standard errors are those that the run reports, of its worst mean; errors, of this one seed, are against
quadrature (samples, threads) and the exact answer (dimensions). Where not said otherwise 16 384 simulations; up to 1000
samples are those of the sampler for small budgets.
";

/// The conjugate Gaussian reference in `d` dimensions.
fn of_dimension(d: usize, cores: usize) -> Result<Row, Failure> {
    let case = Case::density(reference::gaussian(d, 0.5, 0.1));
    let settings = Settings { samples: SIMULATIONS, ..Settings::default() };
    let timed = median(cores, || case.sampled(&settings))?;
    Ok(Row::new("dimensions", [d, cores, SIMULATIONS], timed, Some(&case.exact)))
}

fn sampled(calibration: &Calibration, samples: usize) -> Result<Run, CalibrateError> {
    calibration.posterior(samples, 1).map(Run::of_posterior)
}

/// Median wall and processor time \[s\] on a number of threads, and the last run.
fn median(
    count: usize,
    mut job: impl FnMut() -> Result<Run, CalibrateError> + Send,
) -> Result<([f64; 2], Run), RunError> {
    threads(count)?.install(|| {
        let (mut walls_s, mut processors_s) = (Vec::new(), Vec::new());
        loop {
            let start = Instant::now();
            let (processor_s, run) = Clock::Process.measure(&mut job);
            walls_s.push(start.elapsed().as_secs_f64());
            processors_s.push(processor_s);
            let run = run.map_err(RunError::new)?;
            if walls_s.len() == REPEATS || walls_s[0] > SLOW_S {
                let medians = [walls_s, processors_s].map(|times_s| Timing::of(times_s).median_s);
                return Ok((medians, run));
            }
        }
    })
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new(&[
        "what grows",
        "size",
        "threads",
        "wall time (s)",
        "processor time (s)",
        "processor time per simulation",
        "ESS",
        "k-hat",
        "mixture densities per simulation",
        "standard error of a mean (posterior sd)",
        "largest error of a mean (posterior sd)",
        "standard error of ln Z",
        "error of ln Z",
    ]);
    rows.iter().for_each(|row| table.push(row.cells()));
    table
}

/// Name, look and values of a curve of the figure.
type Curve = (&'static str, Role, fn(&Row) -> f64);

/// Rows: what grows; columns: seconds, standard errors that the runs report.
fn figure(rows: &[Row]) -> WorkPrecisionGrid {
    let panel = |what: &str, curves: &[Curve], error_name: &str, unit: &str| {
        let here: Vec<&Row> = rows.iter().filter(|row| row.what == what).collect();
        let series = curves.iter().map(|(name, role, value)| WorkPrecisionSeries {
            name: (*name).to_owned(),
            role: *role,
            cost: here.iter().map(|row| row.size as f64).collect(),
            error: here.iter().map(|row| value(row)).collect(),
            band: Band::default(),
        });
        WorkPrecisionFigure {
            cost_name: what.to_owned(),
            error_name: error_name.to_owned(),
            error_unit: unit.to_owned(),
            series: series.collect(),
            ..WorkPrecisionFigure::default()
        }
    };
    let row_of = |what: &'static str| {
        vec![
            panel(
                what,
                &[
                    ("wall time", Role::Series(2), |row| row.times_s[0]),
                    ("processor time", Role::Series(3), |row| row.times_s[1]),
                ],
                "time",
                "s",
            ),
            panel(
                what,
                &[
                    ("mean (posterior sd)", Role::Series(0), |row| row.mean_se()),
                    ("log evidence", Role::Series(1), |row| row.run.log_evidence_se),
                ],
                "standard error",
                "",
            ),
        ]
    };
    WorkPrecisionGrid {
        title: "How the cost of a calibration and its standard errors grow".to_owned(),
        rows: GROWING.into_iter().map(row_of).collect(),
    }
}
