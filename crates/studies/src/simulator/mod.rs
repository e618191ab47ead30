//! Time per curve against error of a/R, for every solver and a sweep of its control.
//!
//! Two errors are kept apart, each the largest over the observation times and against a reference that
//! shares no code with the solvers ([`crate::stiff_reference`]): against the quasi-static limit, which is what
//! is calibrated, and against the equations of motion, which shows the error of the time step alone.

mod drawn;
mod method;
mod order;
mod paper;
mod row;

use std::path::Path;

use workbench::error::Failure;
use workbench::input::material::Material;

use crate::args::SimulatorArgs;
use crate::pair::{Calibration, Pair};
use crate::report::{Report, Table};

const TEXT: &str = "\
Error: the largest |a/R - reference| over the observation times. Against the *quasi-static limit*, which is what is
calibrated (force balance, Radau IIA, tolerance tightened until it moves by less than 1e-9 twice running, for a few draws 1e-7): that is the error
that counts. Against the *equations of motion* (likewise, settled to 1e-8, where the long run of PEEK keeps it from that to 1e-6): the error of the time step alone. The difference
of the two is the inertia of the soft contact, which no smaller step removes. The reference has errors
too: after the knee up to 30 times what it settled to, because an error of the time of the knee is carried into the
faster stage. Where closed form and quasi-static solver at 1e-12, which share no formula, show the same error, it
is the reference's.

Time: wall time of one curve on one core up to the last observation, median over interleaved rounds with quartiles; for
draws from the prior the mean over the draws, for verlet in batches of eight lanes. `stops when coalesced`:
whether the run ends with full coalescence (quasi-static and closed form have nothing to run after it).

Which solver: the closed form, wherever the kinetics have one (all five do): nothing is faster, and its error is rounding. The
quasi-static solver to check it, and for a law without a closed form. Verlet for what the paper ran, with its inertia.
";

pub(crate) fn run(args: &SimulatorArgs, out: &Path) -> Result<(), Failure> {
    let mut report = Report::begin(out, "simulator")?;
    let mut table = Table::new(&row::COLUMNS);
    let mut findings = String::new();
    for material in Material::ALL {
        let pair = Pair::of(material)?;
        eprintln!("{material}: the paper's parameters");
        let found = paper::study(&pair)?;
        found.rows.into_iter().for_each(|row| table.push(row));
        findings += &found.finding;
        report.figure(material.name(), &found.figure)?;
        eprintln!("{material}: {} draws from the prior", args.draws);
        let found = drawn::study(&pair, &Calibration::of(material)?.draws(args.draws))?;
        found.rows.into_iter().for_each(|row| table.push(row));
        findings += &found.finding;
        report.figure(&format!("{material}-prior"), &found.figure)?;
    }
    findings += &order::study()?;
    report.table(&table)?;
    let text = format!("{TEXT}\n{findings}\n{}", table.markdown());
    Ok(report.page("Simulator: time per curve against error of a/R", &text)?)
}
