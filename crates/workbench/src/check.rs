//! Check of a file: its contents in words, or its first mistake.

use std::path::Path;

use crate::error::{InputError, Mistake};
use crate::input::experiment::{Experiment, is_toml};
use crate::input::observation_table::ObservationTable;
use crate::input::prior_file::PriorFile;
use crate::input::toml_fields::Document;
use crate::pair::parameter::ParameterName;
use crate::plan::{Planned, Understood, looks_like_a_plan, prior_in_words, short, understood};
use crate::{input::material::Material, input::scene_file, input::text_file, record, report};

/// Checks one file, of the kind that its name and contents say.
pub fn file_at(path: &Path) -> Result<Understood, InputError> {
    let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
    if is_toml(path) {
        let name = path.display().to_string();
        let text = text_file::read(path)?;
        return match toml_kind(&name, &text)? {
            TomlKind::Prior => PriorFile::read(path).map(|priors| of_priors(&priors)),
            TomlKind::Experiment => Experiment::read(path).map(|experiment| of(&experiment)),
            TomlKind::Scene => of_scene(&name, &text, false),
            TomlKind::Plan => Planned::parse(path, text).map(|plan| understood(&plan)),
        };
    }
    if path.is_file() && extension.as_deref().is_some_and(|extension| extension == "json") {
        let text = text_file::read(path)?;
        if is_json_scene(&text) {
            return of_scene(&path.display().to_string(), &text, true);
        }
    }
    if let Some(plan) = json_plan(path)? {
        return Ok(understood(&plan));
    }
    if path.is_dir() || extension.as_deref().is_some_and(|extension| extension == "json") {
        return record::read(path).map(|record| report::understood(&record));
    }
    let table = ObservationTable::read(path)?;
    Ok(Understood {
        headline: format!("an observation table with {}", of_table(&table)),
        details: Vec::new(),
        warnings: few_points(&table, 3).into_iter().collect(),
    })
}

/// A plan in JSON; none for a posterior, and for what is no JSON at all.
fn json_plan(path: &Path) -> Result<Option<Planned>, InputError> {
    let json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    if !json || path.is_dir() {
        return Ok(None);
    }
    let text = text_file::read(path)?;
    let is_plan = serde_json::from_str::<serde_json::Map<String, serde_json::Value>>(&text)
        .is_ok_and(|object| {
            object.contains_key("experiments") && !object.contains_key("schema_version")
        });
    if is_plan { Planned::parse(path, text).map(Some) } else { Ok(None) }
}

enum TomlKind {
    Scene,
    Experiment,
    Prior,
    Plan,
}

fn toml_kind(name: &str, text: &str) -> Result<TomlKind, InputError> {
    let document = Document::parse(name, text)?;
    let keys = document.keys();
    let any_of = |names: &[&str]| keys.iter().any(|key| names.contains(key));
    if any_of(&["particles", "phases"]) {
        Ok(TomlKind::Scene)
    } else if looks_like_a_plan(&keys) {
        Ok(TomlKind::Plan)
    } else if any_of(&["table", "material", "powder"]) {
        Ok(TomlKind::Experiment)
    } else if any_of(&ParameterName::ALL.map(ParameterName::name)) {
        Ok(TomlKind::Prior)
    } else {
        let found = if keys.is_empty() {
            "an empty file".to_owned()
        } else {
            format!("the fields {}", keys.join(", "))
        };
        Err(InputError::new(
            name,
            if keys.is_empty() { Mistake::Empty } else { Mistake::MissingField },
        )
        .found(found)
        .expected(
            "an experiment (table, and material or [powder]) or priors ([c1], [tau_s], [delta_c])",
        )
        .help("see experiments/example-my-powder.toml and priors/example-my-powder.toml"))
    }
}

/// A scene of many particles. What it says is checked; its packing is not made.
fn of_scene(name: &str, text: &str, json: bool) -> Result<Understood, InputError> {
    let file = scene_file::parse(name.to_owned(), text, json)?;
    Ok(Understood {
        headline: format!("a scene of many particles, {}", file.file.name),
        details: file.describe(),
        ..Understood::default()
    })
}

/// Whether a JSON file is a scene and no posterior.
fn is_json_scene(text: &str) -> bool {
    let value: Result<serde_json::Value, _> = serde_json::from_str(text);
    value.is_ok_and(|value| value.get("particles").is_some() && value.get("phases").is_some())
}

fn of_table(table: &ObservationTable) -> String {
    let [first, last] = table.span_s();
    let low = table.contact_ratio.iter().copied().fold(f64::INFINITY, f64::min);
    let high = table.contact_ratio.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let points = table.len();
    format!(
        "{points} point{}, {first} to {last} s, a/R {low} to {high}{}",
        if points == 1 { "" } else { "s" },
        if table.sigma.is_some() { ", with sigma" } else { "" }
    )
}

/// The warning that the prior decides, where there are fewer points than parameters.
pub fn few_points(table: &ObservationTable, parameters: usize) -> Option<String> {
    let points = table.len();
    (points < parameters).then(|| {
        format!(
            "{points} observation{} for {parameters} parameters: the prior decides what the data cannot",
            if points == 1 { "" } else { "s" }
        )
    })
}

fn of(experiment: &Experiment) -> Understood {
    let powder = experiment.powder;
    let mut details = vec![format!(
        "powder    {}: R = {} um, E = {} GPa, gamma = {} mN/m, rho = {} kg/m3",
        experiment.material.map_or("own", Material::title),
        short(powder.radius_m * 1e6),
        short(powder.youngs_modulus_pa * 1e-9),
        short(powder.surface_tension_n_per_m * 1e3),
        short(powder.density_kg_per_m3)
    )];
    let reason = experiment.final_contact_ratio_reason.as_deref();
    details.push(format!(
        "phi       {}{}",
        short(experiment.final_contact_ratio),
        reason.map_or_else(String::new, |reason| format!(" ({reason})"))
    ));
    details.push(format!("table     {}: {}", experiment.table_name, of_table(&experiment.table)));
    let mut warnings = experiment.warnings();
    // A window without observations was refused on reading.
    if let Ok(used) = experiment.observations(None) {
        if let Some([start, end]) = experiment.window_s {
            details.push(format!("window    {start} to {end} s: {} points", used.len()));
        }
        warnings.extend(few_points(&used, 3));
    }
    if let Some(source) = &experiment.source {
        details.push(format!("source    {source}"));
    }
    let title = experiment.title.as_deref();
    Understood {
        headline: format!(
            "the experiment {}{}",
            experiment.name,
            title.map_or_else(String::new, |title| format!(", {title}"))
        ),
        details,
        warnings,
    }
}

fn of_priors(priors: &PriorFile) -> Understood {
    let mut details = Vec::new();
    for parameter in ParameterName::ALL {
        if let Some(prior) = priors.get(parameter) {
            details.push(format!(
                "{:<9} {} [{}]",
                parameter.name(),
                prior_in_words(prior.spec()),
                parameter.unit()
            ));
        }
    }
    let mut warnings = Vec::new();
    if [ParameterName::C1, ParameterName::DeltaC].iter().any(|name| priors.get(*name).is_none()) {
        warnings.push(format!(
            "{}: without [c1] and [delta_c] only --kinetics frenkel and pokluda can be calibrated",
            priors.file_name
        ));
    }
    Understood { headline: format!("priors for {} parameters", details.len()), details, warnings }
}
