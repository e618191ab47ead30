//! Check of a file: its contents in words, or its first mistake.

mod together;

pub use together::{missing, together};

use std::path::Path;

use smc_calib::Prior;

use crate::error::{InputError, Mistake};
use crate::input::columns::Columns;
use crate::input::experiment::{Experiment, is_toml};
use crate::input::heat::HeatFields;
use crate::input::observation_table::ObservationTable;
use crate::input::prior_file::PriorFile;
use crate::input::toml_fields::Document;
use crate::pair::parameter::ParameterName;
use crate::plan::{Planned, Understood, prior_in_words, short, understood};
use crate::{input::material::Material, input::scene_file, input::text_file, record, report};

/// Checks one file, of the kind that its name and contents say. What is `said` of the columns is for tables.
pub fn file_at(path: &Path, said: &Columns) -> Result<Understood, InputError> {
    let name = path.display().to_string();
    if path.is_dir() {
        return record::read(path).map(|record| report::understood(&record));
    }
    if is_toml(path) {
        let text = text_file::read(path)?;
        return match toml_kind(&name, &text)? {
            TomlKind::Prior => PriorFile::read(path).map(|priors| of_priors(&priors)),
            TomlKind::Experiment => {
                Experiment::read(path, said).and_then(|experiment| of(&experiment))
            }
            TomlKind::Scene => of_scene(path, &text, false),
            TomlKind::Heat => of_heat(path),
            TomlKind::Plan => Planned::parse(path, text).map(|plan| understood(&plan)),
        };
    }
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
        let text = text_file::read(path)?;
        let object: serde_json::Map<_, _> = serde_json::from_str(&text).unwrap_or_default();
        let has = |key| object.contains_key(key);
        return if has("particles") && has("phases") {
            of_scene(path, &text, true)
        } else if has("experiments") && !has("schema_version") {
            Planned::parse(path, text).map(|plan| understood(&plan))
        } else {
            record::read(path).map(|record| report::understood(&record))
        };
    }
    let table = ObservationTable::read(path, said, None)?;
    Ok(Understood {
        headline: format!("an observation table with {}", of_table(&table)),
        details: table.how.iter().map(|how| format!("read      {how}")).collect(),
        warnings: few_points(&table, 3).into_iter().collect(),
    })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum TomlKind {
    Scene,
    Experiment,
    Heat,
    Prior,
    Plan,
}

fn toml_kind(name: &str, text: &str) -> Result<TomlKind, InputError> {
    let document = Document::parse(name, text)?;
    let keys = document.keys();
    let any_of = |names: &[&str]| keys.iter().any(|key| names.contains(key));
    if any_of(&["particles", "phases"]) {
        Ok(TomlKind::Scene)
    } else if any_of(&["parameters", "experiments"]) {
        Ok(TomlKind::Plan)
    } else if any_of(&["table", "material", "powder"]) {
        Ok(TomlKind::Experiment)
    } else if keys == ["heat"] {
        Ok(TomlKind::Heat)
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

/// A heat for the option `--heat`.
fn of_heat(path: &Path) -> Result<Understood, InputError> {
    let heat = HeatFields::open(path)?.plan()?;
    Ok(Understood { headline: format!("a heat, {}", heat.in_words()), ..Understood::default() })
}

/// A scene of many particles. What it says is checked; its packing is not made.
fn of_scene(path: &Path, text: &str, json: bool) -> Result<Understood, InputError> {
    let file = scene_file::parse(path, text, json)?;
    Ok(Understood {
        headline: format!("a scene of many particles, {}", file.file.name),
        details: file.describe(),
        ..Understood::default()
    })
}

fn of_table(table: &ObservationTable) -> String {
    let [first, last] = table.span_s();
    let low = table.contact_ratio.iter().copied().fold(f64::INFINITY, f64::min);
    let high = table.contact_ratio.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let points = table.len();
    format!(
        "{points} point{}, {} to {} s, a/R {} to {}{}",
        if points == 1 { "" } else { "s" },
        short(first),
        short(last),
        short(low),
        short(high),
        if table.sigma.is_some() { ", with sigma" } else { "" }
    )
}

/// A table in words, and how it was read.
pub(crate) fn words_of_table(name: &str, table: &ObservationTable) -> String {
    let how = table.how.iter().map(|how| format!("  read      {how}\n"));
    format!("{name}: {}\n{}", of_table(table), how.collect::<String>())
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

fn of(experiment: &Experiment) -> Result<Understood, InputError> {
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
    details.extend(experiment.table.how.iter().map(|how| format!("read      {how}")));
    // A plan may say what the experiment leaves out: the law of the mobility.
    match experiment.heat.as_ref().map(HeatFields::plan) {
        None => {}
        Some(Ok(heat)) => details.push(format!("heat      {}", heat.in_words())),
        Some(Err(error)) if error.mistake == Mistake::MissingField => {
            details.push(format!("heat      in part: {}", error.to_string().replace('\n', ";")));
        }
        Some(Err(error)) => return Err(error),
    }
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
    Ok(Understood {
        headline: format!(
            "the experiment {}{}",
            experiment.name,
            title.map_or_else(String::new, |title| format!(", {title}"))
        ),
        details,
        warnings,
    })
}

/// The priors of a file, a line each.
pub(crate) fn words_of_priors(priors: &PriorFile) -> Vec<String> {
    let given = |name| Some((name, priors.get(name)?));
    let words = |(name, prior): (ParameterName, &Prior)| {
        format!("{:<9} {} [{}]", name.name(), prior_in_words(prior.spec()), name.unit())
    };
    ParameterName::ALL.into_iter().filter_map(given).map(words).collect()
}

fn of_priors(priors: &PriorFile) -> Understood {
    let details = words_of_priors(priors);
    let mut warnings = Vec::new();
    if [ParameterName::C1, ParameterName::DeltaC].iter().any(|name| priors.get(*name).is_none()) {
        warnings.push(format!(
            "{}: without [c1] and [delta_c] only --kinetics frenkel, pokluda and bellehumeur can be calibrated",
            priors.file_name
        ));
    }
    Understood { headline: format!("priors for {} parameters", details.len()), details, warnings }
}
