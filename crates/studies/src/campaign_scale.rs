//! How far a campaign scales: the driver's own cost, and what it makes of many slots, on a cluster of simulated time.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use campaign::{
    Account, Campaign, CampaignSpec, CommandSpec, Executor as _, RunTimes, Simulated, SimulatedRun,
    Stop, Task,
};
use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries};
use serde::{Deserialize, Serialize};
use smc_calib::Settings;
use workbench::calibration::{self, RunOptions};
use workbench::error::{Failure, RunError};
use workbench::number::significant;
use workbench::plan::Planned;
use workbench::record::Record;
use workbench::watch::Unwatched;

use crate::args::CampaignScaleArgs;
use crate::cases::{Case, Errors};
use crate::pair::settings;
use crate::quantile::quantile;
use crate::report::{Report, Table};
use crate::seeds::over_seeds;
use crate::spread::Spreads;
use crate::timing::{Clock, peak_memory_mib};

const ABOUT: &str = "\
The real driver (sampler, journal with checksums, flushes, report) makes a plan of one program, two parameters and four observations on
a cluster whose slots only wait, in simulated time: `campaign::Simulated`. Run times have the mean 1, so that the slots' time does not depend on it;
log-normal ones have the standard deviation of the logarithm that is named. A run fails where a > 1.9. Every campaign is a process of its own, with one
thread beside that of the simulated cluster, whose work counts as the driver's. Processor time is that of the whole process, from the plan to the files of the posterior.
A tenth of a core is what the driver takes where runs take as long on average as the column says, or longer. *Resumed*: the finished campaign is opened, checked, sampled and
reported again; the result is the same, or the study fails. Slots are idle at the barriers between stages; after the last start they are
free for others, which is why both shares are named.
";

const LIMITS: &str = "\
What limits each:

- **Processor time**: JSON and checksums of a task and an outcome, their fingerprints, two looks at the lock per write, the sampler, and the report at the end. It hardly grows with
  the number of runs and does not depend on the slots.
- **Memory**: a task, its outcome and its fingerprint are about 0.9 of the 1.1 kB of a run here; the rest is what the sampler keeps of a sample (see growth).
- **Journals**: a line per task and per outcome, each with its checksum; linear in parameters and observations.
- **Resuming**: reading and checking these lines, then the sampler and the report once more; linear in the runs. Wall times were taken with other work on the machine.
- **Slots**: the longest of n log-normal run times of sd 1 is about exp(z - 1/2) times the mean, z the normal quantile of 1 - 1/n: 22 times for the 6250 runs of a stage of 100 000.
  Without overlap every stage ends by such a wait. With overlap L on S slots a run may be late by L/S mean run times before anything waits for it. After the last
  start nothing can be done without knowing run times: with all runs placed at once 15 % are lost at the end with 100 runs per slot (by the seed, up to 21 %), and most with 10. So with 1000
  slots 85 % until the last start takes an overlap of a fifth of the samples, 84 of the possible 85 % until the end a quarter; with 10 runs per slot no placing gets there, and a million
  runs on 10 000 slots, whose longest run is later still, would need more than the quarter that is allowed.
";

const COST: &str = "\
Overlap is right at any size, and not free: a stage placed from fewer samples has a proposal that fits less well. The built-in problems with exact answers, 16 384
simulations, 10 seeds; the final stage begins as much later as the overlap says, and keeps at least a quarter of the samples. Where the posterior takes many stages to be found (PS, PEEK),
a fifth costs more effective samples than the slots win: 0.13 and 0.06 of them are left for PS and PEEK, for 2.3 times the use of the slots at an sd of 1. A tenth costs a factor of 1.1 to 3.4 for a factor of 1.9. So
overlap pays where posteriors are not much narrower than priors or runs are very unequal, and where the time of slots, not the number of runs, is what is paid for.
";

/// A campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Setup {
    slots: usize,
    runs: usize,
    /// Standard deviation of the logarithm of run times.
    sigma: f64,
    overlap: usize,
}

/// What it took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Measured {
    setup: Setup,
    /// Processor time of this process from the plan to the posterior's files \[s\].
    processor_s: f64,
    /// Wall time of taking the finished campaign up again \[s\].
    resume_s: f64,
    /// Highest memory of this process, before it was taken up again \[MiB\].
    memory_mib: Option<f64>,
    /// Size of the journals \[bytes\].
    journal: u64,
    stages: usize,
    /// Times on the slots, in mean run times.
    until_end: f64,
    until_last_start: f64,
    worked: f64,
    worked_until_last_start: f64,
}

const PLAN: &str = r#"name = "decay"
[parameters.a]
distribution = "uniform"
lower = 0.0
upper = 2.0
[parameters.b]
unit = "1/s"
distribution = "log-uniform"
lower = 0.05
upper = 20.0
[experiments.decay.simulator]
kind = "command"
argv = ["true", "{a}", "{b}"]
[experiments.decay.observables.y]
table = "decay.csv"
control = "t"
noise = { kind = "fixed", sigma = 0.02 }
result = { file = "out.csv", control = "t", value = "y" }
[sampler]
"#;
const TIMES_S: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
const MEASURED: [f64; 4] = [0.62, 0.35, 0.15, 0.01];

/// a exp(-b t); a run fails in a corner of the prior.
fn decay(task: &Task) -> SimulatedRun {
    let (a, b) = (task.parameters[0], task.parameters[1]);
    if a > 1.9 {
        return SimulatedRun::Fails;
    }
    SimulatedRun::Values(TIMES_S.iter().map(|t| a * (-b * t).exp()).collect())
}

impl Setup {
    fn planned(&self, folder: &Path) -> Result<Planned, Failure> {
        let rows = TIMES_S.iter().zip(MEASURED).map(|(t, y)| format!("{t},{y}\n"));
        let table = format!("t,y\n{}", rows.collect::<String>());
        std::fs::write(folder.join("decay.csv"), table).map_err(RunError::new)?;
        let plan = format!("{PLAN}samples = {}\noverlap = {}\n", self.runs, self.overlap);
        let path = folder.join("plan.toml");
        std::fs::write(&path, plan).map_err(RunError::new)?;
        Ok(Planned::read(&path)?)
    }

    /// Makes the campaign in a process of its own, whose memory is that of this campaign alone.
    fn apart(self) -> Result<Measured, RunError> {
        let program = std::env::current_exe().map_err(RunError::new)?;
        let sigma = (100.0 * self.sigma).round() as usize;
        let numbers = [self.slots, self.runs, sigma, self.overlap].map(|number| number.to_string());
        let output = Command::new(program)
            .args(["campaign-scale", "--one"])
            .args(numbers)
            .output()
            .map_err(RunError::new)?;
        if !output.status.success() {
            return Err(RunError::new(String::from_utf8_lossy(&output.stderr)));
        }
        serde_json::from_slice(&output.stdout).map_err(RunError::new)
    }

    /// Makes the campaign with the real driver and its journal.
    fn measure(self, seed: u64) -> Result<(Measured, Record), Failure> {
        let folder = tempfile::tempdir().map_err(RunError::new)?;
        let planned = self.planned(folder.path())?;
        let out = folder.path().join("run");
        let options =
            RunOptions { out: Some(out.clone()), threads: Some(1), ..RunOptions::default() };
        let mut cluster = Simulated::new(self.slots, run_times(self.sigma), seed, decay);
        let (processor_s, ran) = Clock::Process.measure(|| {
            calibration::run_by(&planned, Box::new(&mut cluster), &options, &Unwatched::default())
        });
        let record = ran?.record;
        let memory_mib = peak_memory_mib();
        let size = |name: &str| out.join("campaign").join(name).metadata().map(|it| it.len());
        let journal = size("tasks.jsonl").map_err(RunError::new)?
            + size("results.jsonl").map_err(RunError::new)?;
        let (resume_s, resumed) = Clock::Wall
            .measure(|| calibration::resume(&out, None, &options, &Unwatched::default()));
        if resumed?.record != record {
            return Err(
                RunError::new("the campaign that was taken up again gave another result").into()
            );
        }
        let Account { until_end, until_last_start, worked, worked_until_last_start, .. } =
            cluster.account;
        let measured = Measured {
            setup: self,
            processor_s,
            resume_s,
            memory_mib,
            journal,
            stages: record.stages.len(),
            until_end,
            until_last_start,
            worked,
            worked_until_last_start,
        };
        Ok((measured, record))
    }
}

/// Account of the slots where all runs are placed at once: what no order of placing that knows no run times can better by much.
fn at_once(slots: usize, runs: usize, sigma: f64) -> Result<Account, Failure> {
    let folder = tempfile::tempdir().map_err(RunError::new)?;
    let spec = CampaignSpec {
        parameter_names: vec!["a".to_owned()],
        commands: vec![CommandSpec::in_process("nothing")],
        seed: 1,
    };
    let dir = folder.path().join("campaign");
    let campaign = Campaign::create(&dir, &spec, &BTreeMap::new()).map_err(RunError::new)?;
    // Numbered as those of a plan.
    let tasks: Vec<Task> = (1..=runs as u64)
        .map(|number| Task { number, command: 0, parameters: vec![0.0] })
        .collect();
    let nothing = |_: &Task| SimulatedRun::Values(vec![0.0]);
    let mut cluster = Simulated::new(slots, run_times(sigma), 1, nothing);
    cluster.run(&campaign, &tasks, &mut |_| (), &Stop::new()).map_err(RunError::new)?;
    Ok(cluster.account)
}

fn run_times(sigma: f64) -> RunTimes {
    if sigma > 0.0 { RunTimes::LogNormal(sigma) } else { RunTimes::Equal }
}

/// Slots, runs, standard deviation of the logarithm of run times, overlaps.
const GRID: [(usize, usize, f64, &[usize]); 8] = [
    (1_000, 20_000, 1.0, &[0, 4_000]),
    (100, 100_000, 1.0, &[0, 5_000]),
    (1_000, 100_000, 0.0, &[0, 1_000]),
    (1_000, 100_000, 0.5, &[0, 1_000, 5_000, 10_000]),
    (1_000, 100_000, 1.0, &[0, 5_000, 10_000, 15_000, 20_000, 25_000]),
    (10_000, 100_000, 0.0, &[0, 20_000]),
    (10_000, 100_000, 1.0, &[0, 25_000]),
    (10_000, 1_000_000, 1.0, &[0, 250_000]),
];

pub(crate) fn run(args: &CampaignScaleArgs, out: &Path) -> Result<(), Failure> {
    if let Some([slots, runs, sigma, overlap]) = args.one.as_deref() {
        let sigma = *sigma as f64 / 100.0;
        let setup = Setup { slots: *slots, runs: *runs, sigma, overlap: *overlap };
        let (measured, _) = setup.measure(1)?;
        let text = serde_json::to_string(&measured).map_err(RunError::new)?;
        writeln!(std::io::stdout().lock(), "{text}")?;
        return Ok(());
    }
    let mut report = Report::begin(out, "campaign-scale")?;
    let (mut rows, mut table) = (Vec::new(), Table::new(&COLUMNS));
    for (slots, runs, sigma, overlaps) in GRID {
        let bound = at_once(slots, runs, sigma)?;
        for &overlap in overlaps {
            let measured = Setup { slots, runs, sigma, overlap }.apart()?;
            table.push(measured.cells(&bound));
            rows.push(measured);
        }
    }
    let accuracy = accuracy()?;
    report.figure("figure", &figure(&rows))?;
    report.table(&table)?;
    let text = format!(
        "{ABOUT}\n{}\n{LIMITS}\n## What overlap costs\n\n{COST}\n{}",
        table.markdown(),
        accuracy.markdown()
    );
    Ok(report.page("How far a campaign scales", &text)?)
}

const COLUMNS: [&str; 13] = [
    "slots",
    "runs",
    "sd of ln(run time)",
    "overlap",
    "stages",
    "processor time per run (ms)",
    "mean run time for a tenth of a core (s)",
    "memory (MiB)",
    "journals (MB)",
    "resumed in (s)",
    "slots used until the last start (%)",
    "slots used until the end (%)",
    "the same with all runs placed at once (%)",
];

impl Measured {
    /// Shares of the slots' time that were used until the last start and until the end \[%\].
    fn used(&self) -> [f64; 2] {
        let slots = self.setup.slots as f64;
        [
            100.0 * self.worked_until_last_start / (slots * self.until_last_start),
            100.0 * self.worked / (slots * self.until_end),
        ]
    }

    fn ms_per_run(&self) -> f64 {
        1e3 * self.processor_s / self.setup.runs as f64
    }

    fn cells(&self, bound: &Account) -> Vec<String> {
        let Setup { slots, runs, sigma, overlap } = self.setup;
        let [until_last_start, until_end] = self.used();
        let most = 100.0 * bound.worked / (slots as f64 * bound.until_end);
        vec![
            slots.to_string(),
            runs.to_string(),
            sigma.to_string(),
            overlap.to_string(),
            self.stages.to_string(),
            significant(self.ms_per_run(), 2),
            significant(self.processor_s / (0.1 * self.until_end), 2),
            self.memory_mib.map_or_else(|| "–".to_owned(), |mib| significant(mib, 3)),
            significant(self.journal as f64 / 1e6, 3),
            significant(self.resume_s, 2),
            significant(until_last_start, 3),
            significant(until_end, 3),
            significant(most, 3),
        ]
    }
}

/// Errors against the exact answers at 16 384 simulations, by overlap.
fn accuracy() -> Result<Table, Failure> {
    const SAMPLES: usize = 16_384;
    const SEEDS: u64 = 10;
    let mut table = Table::new(&[
        "problem",
        "overlap / samples",
        "rms error of a mean (posterior sd)",
        "rms error of a sd (relative)",
        "rms error of ln Z",
        "median ESS",
    ]);
    for case in Case::all()? {
        for (overlap, share) in
            [(0, "0"), (SAMPLES / 10, "1/10"), (SAMPLES / 5, "1/5"), (SAMPLES / 4, "1/4")]
        {
            let runs = over_seeds(SEEDS, &|seed| {
                let settings = Settings { overlap, ..settings(SAMPLES, seed) };
                case.sampled(&settings).map_err(RunError::new)
            })?;
            let errors: Vec<Errors> =
                runs.iter().map(|run| Errors::of(&case.exact, &run.estimate)).collect();
            let mut ess: Vec<f64> = runs.iter().map(|run| run.ess).collect();
            ess.sort_by(f64::total_cmp);
            let mut cells = vec![case.title.clone(), share.to_owned()];
            let spreads = Spreads::new(&errors).of;
            cells.extend(spreads.map(|of| of.map_or("–".to_owned(), |of| significant(of.rms, 2))));
            cells.push(significant(quantile(&ess, 0.5), 3));
            table.push(cells);
        }
    }
    Ok(table)
}

/// Idle slots against overlap; processor time and memory of the driver against runs.
fn figure(rows: &[Measured]) -> WorkPrecisionGrid {
    let series = |name: &str, role, points: Vec<(f64, f64)>| {
        let (cost, error) = points.into_iter().unzip();
        WorkPrecisionSeries { name: name.to_owned(), role, cost, error, band: Band::default() }
    };
    let of = |slots, runs, sigma| {
        rows.iter().filter(move |row| {
            (row.setup.slots, row.setup.runs, row.setup.sigma) == (slots, runs, sigma)
        })
    };
    let idle = |row: &Measured| 100.0 - row.used()[0];
    let with = of(1_000, 100_000, 1.0).filter(|row| row.setup.overlap > 0);
    let with: Vec<_> = with.map(|row| (row.setup.overlap as f64 / 1e3, idle(row))).collect();
    // The same at any overlap.
    let without = |sigma: f64| {
        let none = of(1_000, 100_000, sigma).filter(|row| row.setup.overlap == 0).map(idle);
        none.flat_map(|idle| with.iter().map(move |(overlap, _)| (*overlap, idle))).collect()
    };
    let by_runs = |value: fn(&Measured) -> f64| {
        let sizes = [(1_000, 20_000), (1_000, 100_000), (10_000, 1_000_000)];
        let largest = |(slots, runs)| of(slots, runs, 1.0).max_by_key(|row| row.setup.overlap);
        sizes
            .into_iter()
            .filter_map(largest)
            .map(|row| (row.setup.runs as f64, value(row)))
            .collect::<Vec<_>>()
    };
    let panel = |[cost_name, cost_unit]: [&str; 2], [error_name, error_unit]: [&str; 2], series| {
        WorkPrecisionFigure {
            cost_name: cost_name.to_owned(),
            cost_unit: cost_unit.to_owned(),
            error_name: error_name.to_owned(),
            error_unit: error_unit.to_owned(),
            series,
            ..WorkPrecisionFigure::default()
        }
    };
    let idle = vec![
        series("sd of ln(run time) 1", Role::Series(1), with.clone()),
        series("1, without overlap", Role::Series(2), without(1.0)),
        series("0.5, without overlap (none idle with any)", Role::Series(0), without(0.5)),
    ];
    let processor = vec![series("driver", Role::Posterior, by_runs(Measured::ms_per_run))];
    let memory = by_runs(|row| row.memory_mib.unwrap_or(f64::NAN).max(1e-3));
    let memory = vec![series("driver", Role::Posterior, memory)];
    WorkPrecisionGrid {
        title: "Idle slots by overlap (100 000 runs, 1000 slots), and the driver's own cost"
            .to_owned(),
        rows: vec![
            vec![panel(["overlap per slot", "runs"], ["idle until the last start", "%"], idle)],
            vec![
                panel(["runs", ""], ["processor time per run", "ms"], processor),
                panel(["runs", ""], ["memory", "MiB"], memory),
            ],
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn stragglers_overlap_with_the_next_stages_to_the_same_result_in_any_order_of_ends() {
        let setup = Setup { slots: 40, runs: 4_000, sigma: 1.0, overlap: 1_000 };
        let (with, first) = setup.measure(1).expect("a campaign");
        let (_, other) = setup.measure(2).expect("a campaign");
        assert_eq!(first, other, "run times and the order of ends are no part of the result");
        let (without, _) = Setup { overlap: 0, ..setup }.measure(1).expect("a campaign");
        let [with, without] = [with, without].map(|measured| measured.used());
        assert!(with[0] > 85.0 && without[0] < 60.0, "{with:?} {without:?}");
        let bound = at_once(40, 4_000, 1.0).expect("a campaign");
        let most = 100.0 * bound.worked / (40.0 * bound.until_end);
        assert!(with[1] <= most + 1e-6 && with[1] > most - 10.0, "{with:?} {most}");
    }
}
