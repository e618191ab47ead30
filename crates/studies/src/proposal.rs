//! What an earlier posterior is worth as the first proposal: the same model's, moved ones, and that of the closed form for runs
//! of the verlet solver.

use std::fmt::Write as _;
use std::path::Path;

use dem_core::SolverKind;
use smc_calib::{FirstProposal, Parameter, Posterior, Settings};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use crate::args::ProposalArgs;
use crate::cases::{Exact, Run};
use crate::pair::Calibration;
use crate::report::{Report, Table};
use crate::seeds::over_seeds;
use crate::small_budget::{COLUMNS, cells};

/// Simulations of the earlier run, and of that which counts as exact for verlet.
const EARLIER: usize = 16_384;
/// Runs of verlet.
const DEAR: usize = 60;

const TEXT: &str = "\
Errors (root mean square over the seeds, each error counted as 10 at most) of calibrations of the measured neck-growth curves with few simulations, from
the prior and from an earlier posterior (`--proposal`): that of the same model with 16 384 simulations, and the same with every parameter moved by
standard deviations of its own, upwards, as that of a wrong model might be. \"verlet\" has the curve from the full dynamics, whose runs stand for runs of an
hour: the earlier posterior is that of the closed form, the exact one that of verlet (how far apart the two are stands below). Mean and sd are those of the worst
parameter, in posterior standard deviations and relative, ends of 95 % intervals have the error of the worst one; \"spread of z\" is that of the first mean's error over its stated
standard error, of ln Z's and of all ends', over the runs that are to be trusted (others do not know their standard errors); ESS is the median. The last two columns count the runs with a mean off by more than one sd that do
not say that their budget is too small, and those right within one sd that do. Exact is the quadrature of the closed form, and of verlet a run of 16 384
simulations without a process, which of PS is within 0.001 of a quadrature (`--verify`); of PEEK one would take ten hours. The figures depend on seeds only, not on the machine or its load.
";

/// What a run begins from.
#[derive(Clone, Copy)]
enum Begin {
    Prior,
    /// The earlier posterior, every parameter moved by so many standard deviations.
    Earlier(f64),
}

impl Begin {
    fn words(self) -> String {
        match self {
            Self::Prior => "the prior".to_owned(),
            Self::Earlier(0.0) => "earlier posterior".to_owned(),
            Self::Earlier(off) => format!("the same, {off} sd off"),
        }
    }
}

pub(crate) fn run(args: &ProposalArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "proposal")?;
    let mut table = Table::new(&[&["problem", "simulations", "begun from"], &COLUMNS[..]].concat());
    let mut apart =
        "From the closed form to verlet the means move by so many posterior sds, and the sds by these factors:\n\n"
            .to_owned();
    for material in Material::ALL {
        if args.only.as_deref().is_some_and(|only| only != material.name()) {
            continue;
        }
        let cheap = Calibration::of(material)?;
        let earlier = cheap.posterior(EARLIER, 1).map_err(RunError::new)?;
        let exact = Exact::by_quadrature(material, &cheap)?;
        for &samples in &args.samples {
            for begin in [0.0, 1.0, 3.0, 10.0].map(Begin::Earlier).into_iter().chain([Begin::Prior])
            {
                let runs = runs(&cheap, &earlier, begin, (samples, args.seeds))?;
                let what = [material.name().to_uppercase(), samples.to_string(), begin.words()];
                table.push([what.as_slice(), &cells(&exact, &runs)].concat());
            }
        }
        if args.closed_form_only {
            continue;
        }
        let dear = Calibration::solved(material, SolverKind::Verlet)?;
        let of_dear = Exact::of(&dear.posterior(EARLIER, 1).map_err(RunError::new)?);
        let moves = moves(&cheap, [&exact, &of_dear]);
        let _ = writeln!(apart, "- {}: {moves}", material.name().to_uppercase());
        for begin in [Begin::Earlier(0.0), Begin::Prior] {
            let runs = runs(&dear, &earlier, begin, (DEAR, args.seeds))?;
            let name = format!("{}, verlet", material.name().to_uppercase());
            table.push(
                [&[name, DEAR.to_string(), begin.words()][..], &cells(&of_dear, &runs)].concat(),
            );
        }
    }
    report.table(&table)?;
    let text = format!("{} seeds. {TEXT}\n{}\n{apart}", args.seeds, table.markdown());
    Ok(report.page("Beginning from an earlier posterior", &text)?)
}

/// Calibrations over the seeds, errors left out: a run without an answer is none.
fn runs(
    model: &Calibration,
    earlier: &Posterior,
    begin: Begin,
    (samples, seeds): (usize, u64),
) -> Result<Vec<Run>, Failure> {
    let found = over_seeds(seeds, &|seed| {
        let mut settings = Settings { seed, ..Settings::for_budget(samples) };
        if let Begin::Earlier(off) = begin {
            let first = moved(model, earlier, off, &settings).map_err(RunError::new)?;
            settings.first_proposal = Some(first.mixture);
        }
        model.sampled(&settings).map(Run::of_posterior).map_err(RunError::new)
    })?;
    Ok(found)
}

/// The earlier posterior as the first proposal, every normal score moved by so many of its standard deviations.
fn moved(
    model: &Calibration,
    earlier: &Posterior,
    off: f64,
    settings: &Settings,
) -> Result<FirstProposal, smc_calib::CalibrateError> {
    let weights: Vec<f64> = earlier.samples.iter().map(|sample| sample.weight).collect();
    let column = |j: usize| -> Vec<f64> {
        let mean: f64 = earlier.samples.iter().map(|s| s.weight * s.z[j]).sum();
        let square: f64 = earlier.samples.iter().map(|s| s.weight * (s.z[j] - mean).powi(2)).sum();
        let prior = &model.parameters[j].prior;
        earlier.samples.iter().map(|s| prior.from_z(s.z[j] + off * square.sqrt())).collect()
    };
    let columns: Vec<Vec<f64>> = (0..model.parameters.len()).map(column).collect();
    let columns: Vec<Option<&[f64]>> = columns.iter().map(|column| Some(&column[..])).collect();
    FirstProposal::fitted(&model.parameters, &columns, &weights, settings)
}

/// By how much means and sds differ from the first posterior to the second, in words.
fn moves(model: &Calibration, [before, after]: [&Exact; 2]) -> String {
    let one = |(j, parameter): (usize, &Parameter)| {
        let shift = (after.mean[j] - before.mean[j]) / before.sd[j];
        format!("{} {shift:.3} and {:.3}", parameter.name, after.sd[j] / before.sd[j])
    };
    model.parameters.iter().enumerate().map(one).collect::<Vec<_>>().join(", ")
}
