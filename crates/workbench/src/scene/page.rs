//! A scene as the sections of its report.

use super::record::{SceneRecord, State};
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, Page};
use crate::plan::shell_word;

/// The role of the scene file.
pub(super) const SCENE: &str = "scene";

/// The report of a scene: its record, what it says in words, its figures and the files that it was made of.
pub(super) fn page(
    record: &SceneRecord,
    described: &[String],
    drawn: &[Drawn],
    inputs: &Inputs,
) -> Page {
    let version = &record.plan.version;
    let mut page = Page {
        title: record.plan.name.clone(),
        kind: "Bed of particles".to_owned(),
        version: version.clone(),
        summary: record.text(None),
        advice: record.advice.clone(),
        cite: page::citation(version),
        ..Page::default()
    };
    page.asked.say("What becomes of these particles in the phases of the scene?");
    page.model.listings.push(described.join("\n"));
    if let Some(heat) = record.heat_in_words() {
        page.model.fact("Heat", heat);
    }
    let numbers = |what: &str, state: &State| {
        let density = state.relative_density.map_or_else(|| "–".to_owned(), |d| significant(d, 4));
        vec![
            what.to_owned(),
            significant(state.time_s, 4),
            density,
            significant(state.coordination, 3),
            significant(state.mean_contact_ratio, 3),
            significant(state.largest_driving, 3),
            significant(100.0 * state.necks_meet, 2),
        ]
    };
    let mut rows: Vec<_> = record.start.iter().map(|state| numbers("start", state)).collect();
    rows.extend(record.phases.iter().map(|phase| numbers(&phase.name, &phase.end)));
    let columns = [
        "end of",
        "time [s]",
        "relative density",
        "coordination",
        "a/R",
        "largest force over fa",
        "necks meet [%]",
    ];
    page.answer.table("The bed after each phase", &columns, rows);
    let work = &record.work;
    page.checked.fact("Particles", record.particles.to_string());
    page.checked.fact("Steps with inertia", work.steps.to_string());
    let steps =
        format!("{} taken, {} rejected", work.quasi_static_steps, work.quasi_static_rejected);
    page.checked.fact("Quasi-static steps", steps);
    page.checked.fact("Error of a/R, summed over steps", significant(work.quasi_static_error, 2));
    let file = inputs.by_role(SCENE).map_or("SCENE.toml", |file| &file.name);
    let vtk = if record.plan.vtk { " --vtk" } else { "" };
    page.repeat.listings.push(format!("calibrate scene {}{vtk}", shell_word(file)));
    page::provenance(&mut page.repeat, (version, None), Some(inputs), "");
    page.show(drawn, |name| {
        match name {
            "series" => "Density, coordination, contact ratios and forces over time.",
            "bed-start" => "The bed at the start, coloured by contact ratio.",
            _ => "The bed at the end, coloured by contact ratio.",
        }
        .to_owned()
    });
    page
}
