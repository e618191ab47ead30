//! Several experiments of one powder, from options: what `--experiment` given several times stands for.
//!
//! All parameters are shared, tau_s in proportion to R; what an experiment states of its own (radius, heat, final contact ratio)
//! stays its own. So does the time of first contact, which belongs to the clock of a table.

use std::collections::BTreeMap;

use dem_core::{Kinetics, Powder};
use smc_calib::Parameter;

use super::heats::{beside_each_other, pairs};
use super::types::{ExperimentPlan, PairPlan, is_word};
use super::words::short;
use crate::error::{InputError, Mistake};
use crate::input::experiment::Experiment;
use crate::input::prior_file::PriorFile;
use crate::pair::heat::HeatPlan;
use crate::pair::parameter::ParameterName;

/// Most characters of the name of an experiment, which is part of other names.
const LONGEST: usize = 48;

/// The option that names them.
const OPTION: &str = "--experiment";

/// Refuses experiments that are not of one powder at one temperature, are there twice, or cannot be told apart.
pub(super) fn check(all: &[Experiment]) -> Result<(), InputError> {
    let Some((first, others)) = all.split_first() else { return Ok(()) };
    for (k, one) in others.iter().enumerate() {
        all[..=k].iter().try_for_each(|before| apart(before, one))?;
        one_powder(first, one)?;
    }
    Ok(())
}

/// Refuses two experiments of one name, or of the same measurements.
fn apart(before: &Experiment, one: &Experiment) -> Result<(), InputError> {
    let earlier = &before.description_name;
    let refused = |found: String| {
        InputError::new(&one.description_name, Mistake::Duplicate)
            .found(found)
            .expected("another experiment of the powder")
    };
    let is_same = before.table.time_s == one.table.time_s
        && before.table.contact_ratio == one.table.contact_ratio;
    if is_same {
        return Err(refused(format!("the measurements of {earlier} once more"))
            .help("each counts once: leave one of the two out"));
    }
    if word(&before.name) == word(&one.name) {
        return Err(refused(format!("the name {} of {earlier}", one.name))
            .help("give one of them another name = \"...\""));
    }
    Ok(())
}

/// Refuses an experiment of another powder, or at another temperature that no heat describes.
fn one_powder(first: &Experiment, one: &Experiment) -> Result<(), InputError> {
    let refused = |found: String| {
        InputError::new(&one.description_name, Mistake::Conflict)
            .found(found)
            .expected("experiments of one powder, which share their parameters")
    };
    let constants = |powder: Powder| {
        [
            ("E", powder.youngs_modulus_pa, "Pa"),
            ("gamma", powder.surface_tension_n_per_m, "N/m"),
            ("rho", powder.density_kg_per_m3, "kg/m3"),
        ]
    };
    let pairs = constants(one.powder).into_iter().zip(constants(first.powder));
    for ((name, own, unit), (_, shared, _)) in pairs {
        if own != shared {
            let of_first = format!("{} has {}", first.description_name, short(shared));
            return Err(refused(format!("{name} {} {unit}, where {of_first}", short(own)))
                .help("calibrate each powder alone, or write a plan that says what they share"));
        }
    }
    match (one.temperature_k, first.temperature_k) {
        (Some(own), Some(other))
            if own != other && one.heat.is_none() && first.heat.is_none() =>
        {
            Err(refused(format!("{own} K, where {} has {other} K", first.description_name)).help(
                "C1 and tau_s are those of one temperature: describe both in [heat] with a mobility law (crates/guide/pages/heat.md)",
            ))
        }
        _ => Ok(()),
    }
}

/// Refuses heats that cannot share their parameters.
pub(super) fn check_heats(
    experiments: &[ExperimentPlan],
    all: &[Experiment],
) -> Result<(), InputError> {
    let place = |mistake, name: &str, field: &str| {
        let of = experiments.iter().position(|experiment| experiment.name == name);
        let file = of.and_then(|of| all.get(of)).map_or(OPTION, |one| &one.description_name);
        InputError::new(file, mistake).in_field(field)
    };
    beside_each_other(experiments, &place).map_err(|error| InputError {
        help: vec![
            "say the same in [heat] of all descriptions: a law of the energy (mobility = \"threshold-power\", \"arrhenius\", \"wlf\"), cooling_radius_m with cooling_power or a prior of it".to_owned(),
            "or write a plan, which can give each its own: experiments/heat has examples".to_owned(),
        ],
        ..error
    })
}

/// The name of an experiment as a plan can have it.
pub(super) fn word(name: &str) -> String {
    if is_word(name) && name.len() <= LONGEST {
        return name.to_owned();
    }
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    let begin = if name.starts_with(|c: char| c.is_ascii_alphabetic()) { "" } else { "e" };
    begin.chars().chain(name.chars().map(plain)).take(LONGEST).collect()
}

/// Names of what is each experiment's own though the priors are shared.
pub(super) fn own_names(priors: &PriorFile, name: &str) -> BTreeMap<ParameterName, String> {
    let t0 = ParameterName::T0;
    priors.get(t0).map(|_| (t0, format!("{}_{name}", t0.name()))).into_iter().collect()
}

/// The parameters of all pairs, each once, in the order of the model's.
pub(super) fn parameters(
    priors: &PriorFile,
    kinetics: Kinetics,
    experiments: &[ExperimentPlan],
) -> Result<Vec<Parameter>, InputError> {
    let of_pairs = pairs(experiments)
        .map(|(_, pair)| Ok((pair, priors.parameters(kinetics, heat_of(pair))?)))
        .collect::<Result<Vec<_>, InputError>>()?;
    let mut found: Vec<Parameter> = Vec::new();
    for model in ParameterName::ALL {
        for (pair, own) in &of_pairs {
            let Some(parameter) = own.iter().find(|one| one.name == model.name()) else { continue };
            let name = pair.calibrated(model);
            if found.iter().all(|one| one.name != name) {
                found.push(Parameter { name: name.to_owned(), ..parameter.clone() });
            }
        }
    }
    Ok(found)
}

/// The heat of a pair, with the radius that it heats \[m\].
fn heat_of(pair: &PairPlan) -> Option<(&HeatPlan, f64)> {
    Some((pair.heat.as_ref()?, pair.powder.radius_m))
}

/// The radius that a shared tau_s belongs to, that of the first; none where all are the same.
pub(super) fn tau_s_radius_m(all: &[Experiment]) -> Option<f64> {
    let first = all.first()?.powder.radius_m;
    all.iter().any(|one| one.powder.radius_m != first).then_some(first)
}

/// Name and title of the run of several experiments.
pub(super) fn name_and_title(all: &[Experiment]) -> (String, String) {
    let words: Vec<String> = all.iter().map(|one| word(&one.name)).collect();
    let joined = words.join("-");
    let name = match &words[..] {
        [first, others @ ..] if joined.len() > 64 => format!("{first}-and-{}-more", others.len()),
        _ => joined,
    };
    let title = match &words[..] {
        [others @ .., last] if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => words.concat(),
    };
    (name, title)
}

/// Who measured them, each once.
pub(super) fn source(all: &[Experiment]) -> Option<String> {
    let mut sources: Vec<&str> = Vec::new();
    for source in all.iter().filter_map(|one| one.source.as_deref()) {
        if !sources.contains(&source) {
            sources.push(source);
        }
    }
    (!sources.is_empty()).then(|| sources.join("; "))
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use smc_calib::Noise;

    use super::super::types::Planned;
    use super::super::{PairOptions, command_line};
    use super::*;

    fn of(names: &[&str]) -> PairOptions {
        let mut all = names.iter().map(PathBuf::from);
        PairOptions { experiment: all.next(), others: all.collect(), ..PairOptions::default() }
    }

    fn reads_back(options: &PairOptions) -> super::super::Plan {
        let planned = options.plan().expect("a plan");
        let read = Planned::parse(Path::new("plan.toml"), planned.text.clone());
        assert_eq!(read.expect(&planned.text).plan, planned.plan);
        planned.plan
    }

    #[test]
    fn pairs_of_one_powder_share_all_parameters_and_tau_s_by_the_radius() {
        let plan = reads_back(&of(&["pa12-r30", "pa12-r32", "pa12-r28-9"]));
        assert_eq!(plan.parameter_names(), ["c1", "tau_s", "delta_c"]);
        assert_eq!(plan.name, "pa12-r30-pa12-r32-pa12-r28-9");
        let first = pairs(&plan.experiments).next().expect("a pair").1.powder.radius_m;
        let of_first = |(_, pair): (_, &PairPlan)| pair.tau_s_radius_m == Some(first);
        assert!(pairs(&plan.experiments).all(of_first));
        let words = "calibrate --experiment pa12-r30 --experiment pa12-r32 --experiment pa12-r28-9 --seed 1";
        assert_eq!(command_line(&plan).as_deref(), Some(words));
    }

    #[test]
    fn the_time_of_first_contact_is_that_of_each_clock() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("priors.toml");
        let priors = include_str!("../../built-in/prior-pa12.toml");
        let t0 = "\n[t0]\ndistribution = \"uniform\"\nlower = -1.0\nupper = 1.0\n";
        std::fs::write(&file, format!("{priors}{t0}")).expect("priors");
        let options = PairOptions { prior: Some(file), ..of(&["pa12-r30", "pa12-r32"]) };
        let plan = reads_back(&options);
        let names = ["c1", "tau_s", "delta_c", "t0_pa12-r30", "t0_pa12-r32"];
        assert_eq!(plan.parameter_names(), names);
        let of_own = |(one, pair): (&ExperimentPlan, &PairPlan)| {
            pair.calibrated(ParameterName::T0) == format!("t0_{}", one.name)
        };
        assert!(pairs(&plan.experiments).all(of_own));
    }

    #[test]
    fn what_cannot_be_calibrated_together_is_refused_with_what_to_do() {
        let heat = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/heat");
        let [pulse, prior] = ["ps-r30-pulse.toml", "../../priors/ps-pulse.toml"]
            .map(|name| heat.join(name).display().to_string());
        let pa12 = of(&["pa12-r30", "pa12-r32"]);
        let heated = |names: &[&str]| PairOptions { prior: Some((&prior).into()), ..of(names) };
        for (options, says) in [
            (of(&["pa12-r30", "pa12-r30"]), ["once more", "leave one of the two out"]),
            (of(&["pa12-r30", "ps-r30"]), ["ps-r30.toml: found E 1.6e9 Pa", "each powder alone"]),
            (
                PairOptions { window_s: Some([0.0, 5.0]), ..pa12.clone() },
                ["--window", "window = ["],
            ),
            (PairOptions { noise: Noise::EssTarget { share: 0.2 }, ..pa12 }, ["--noise", "tuned"]),
            (
                heated(&["ps-r60-e19", "ps-r60-e23"]),
                ["a pulse of energy 23 and one of 19", "a law"],
            ),
            (heated(&["ps-r60-e29", &pulse]), ["energy that is not stated", "write a plan"]),
            (of(&["ps-r60-e29", "ps-r30"]), ["built-in priors/ps.toml", "cooling_time"]),
        ] {
            let error = options.plan().expect_err(says[0]).to_string();
            assert!(says.iter().all(|words| error.contains(words)), "{says:?}\n{error}");
        }
    }

    #[test]
    fn names_of_any_table_become_names_of_a_plan() {
        for (name, expected) in [("a-1_b", "a-1_b"), ("30 um.2", "e30-um-2"), ("", "e")] {
            assert_eq!(word(name), expected);
        }
        assert!(word(&"\u{3b1}".repeat(200)).len() == LONGEST && is_word(&word("\u{3b1}")));
    }
}
