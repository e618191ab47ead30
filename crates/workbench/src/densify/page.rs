//! A densification as the sections of its report.

use super::curve::Target;
use super::options::DensifyOptions;
use super::report::{Report, interval};
use crate::input::files_read::FilesRead;
use crate::input::scene_file::table_of;
use crate::input::text_file::folder_of;
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, Page, Part};
use crate::pair::heat::HeatPlan;
use crate::plan::shell_word;
use crate::record;

/// The roles of the files that it is made of.
const SCENE: &str = "scene";
const POSTERIOR: &str = "posterior";
const HEAT: &str = "heat";

/// The files that a densification is made of.
pub(super) fn inputs(
    options: &DensifyOptions,
    heat: Option<&HeatPlan>,
    read: &FilesRead,
) -> Inputs {
    let posterior = record::locate(&options.posterior);
    let draws = folder_of(&posterior).join("draws.csv");
    let files = [(SCENE, options.scene.clone()), (POSTERIOR, posterior), ("draws", draws)];
    let of_heat = options.heat.clone().map(|file| (HEAT, file)).into_iter().chain(table_of(heat));
    Inputs::of(files.into_iter().chain(of_heat), None, read)
}

/// The report: the record, the scene in words, the figures and the files that it was made of.
pub(super) fn page(
    report: &Report,
    described: &[String],
    drawn: &[Drawn],
    inputs: &Inputs,
) -> Page {
    let plan = &report.plan;
    let mut page = Page {
        title: format!("{}, draws of {}", plan.scene_name, plan.posterior_name),
        kind: "Densification under a posterior".to_owned(),
        version: plan.version.clone(),
        summary: report.text(None),
        advice: report.advice.clone(),
        answer: answer(report),
        cite: page::citation(&plan.version),
        ..Page::default()
    };
    let (quantity, level) = (plan.target.name(), significant(plan.target.value(), 3));
    page.asked
        .say(format!("When does the bed reach a {quantity} of {level}, and how sure is that?"));
    page.asked.fact("Draws of the posterior", format!("{} of {}", plan.draws, plan.posterior_name));
    page.model.listings.push(described.join("\n"));
    let radius = significant(1e6 * plan.calibrated_radius_m, 4);
    page.model.fact("Kinetics", format!("{}, tau_s calibrated at R = {radius} µm", plan.kinetics));
    if let Some(heat) = &plan.heat {
        page.model.fact("Heat", heat.in_words());
    }
    page.checked.fact("Draws that failed", report.failed.len().to_string());
    let beyond = format!("{} of {}", report.target.outside_model, report.target.draws);
    page.checked.fact("Draws that reach the target after their pairs have ended", beyond);
    let errors = report.draws.iter().map(|draw| draw.error_estimate).fold(0.0, f64::max);
    page.checked.fact("Largest error of a/R of a bed", significant(errors, 2));
    page.repeat.listings.push(command(report, inputs));
    page::provenance(&mut page.repeat, (&plan.version, Some(plan.seed)), Some(inputs), "");
    page.show(drawn, |_| {
        format!("Bands of the {quantity} over time, and when it reaches {level}.")
    });
    page
}

fn answer(report: &Report) -> Part {
    let mut part = Part::default();
    let median = |time: Option<f64>| {
        time.map_or_else(|| "never".to_owned(), |time| format!("{} s", significant(time, 3)))
    };
    let times =
        [("the beds", &report.target.time_s), ("end of the pairs", &report.pairs_end.time_s)];
    let laws = report.other_laws.iter().map(|law| (law.law, &law.time_s));
    let rows = times.into_iter().chain(laws).map(|(what, time)| {
        vec![what.to_owned(), median(time.median), interval(time.eti50), interval(time.eti90)]
    });
    let columns = ["by", "median", "50 % interval", "90 % interval"];
    part.table("Time to the target", &columns, rows.collect());
    if let Some(spread) = &report.spread {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let rows = spread.shares.iter().map(|share| {
            let of = format!("{} ± {:.0}", percent(share.share), 100.0 * share.se);
            vec![share.parameter.clone(), of, percent(share.alone), percent(share.last)]
        });
        let columns = ["parameter", "share", "alone", "last"];
        part.table("Where the spread of ln(time) comes from", &columns, rows.collect());
    }
    part
}

/// The command that makes it again.
fn command(report: &Report, inputs: &Inputs) -> String {
    let plan = &report.plan;
    let named = |role: &str, otherwise: &str| {
        shell_word(inputs.by_role(role).map_or(otherwise, |file| &file.name))
    };
    let (posterior, scene) = (named(POSTERIOR, "posterior.json"), named(SCENE, "SCENE.toml"));
    let target = match plan.target {
        Target::RelativeDensity(density) => format!("--target {density}"),
        Target::ContactRatio(ratio) => format!("--contact-ratio {ratio}"),
    };
    let (draws, seed) = (plan.draws, plan.seed);
    let of = plan.of.as_ref().map(|of| format!(" --of {}", shell_word(of)));
    let heat = inputs.by_role(HEAT).map(|file| format!(" --heat {}", shell_word(&file.name)));
    let energy = plan.pulse_energy.map(|energy| format!(" --pulse-energy {energy}"));
    let heat: String = [of, heat, energy].into_iter().flatten().collect();
    format!(
        "calibrate densify --posterior {posterior}{heat} --scene {scene} --draws {draws} {target} --seed {seed}"
    )
}
