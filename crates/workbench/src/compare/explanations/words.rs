//! Explanations by name: the law of growth, and why it ends where it ends.

use crate::pair::heat::HistoryPlan;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairPlan, Plan, pairs, short};

/// Names of plans, each another; where the plans themselves tell two not apart they are called by their run, `given`.
pub(super) fn names<'p>(plans: impl Iterator<Item = &'p Plan>, given: &[String]) -> Vec<String> {
    let plans: Vec<&Plan> = plans.collect();
    let all: Vec<String> = plans.iter().map(|plan| in_words(plan)).collect();
    let is_twice =
        |list: &[String], one: &String| list.iter().filter(|name| *name == one).count() > 1;
    let named = |(plan, words): (&&Plan, &String)| match words.as_str() {
        "" => plan.name.clone(),
        own if is_twice(&all, words) => format!("{own} ({})", plan.name),
        own => own.to_owned(),
    };
    let names: Vec<String> = plans.iter().zip(&all).map(named).collect();
    let unique = |(k, name): (usize, &String)| match is_twice(&names, name) {
        true => format!("{name}, {}", given.get(k).cloned().unwrap_or_else(|| (k + 1).to_string())),
        false => name.clone(),
    };
    names.iter().enumerate().map(unique).collect()
}

/// The kinetics of the pairs of a plan, and why their growth ends; empty where it has no pairs.
fn in_words(plan: &Plan) -> String {
    let (mut kinetics, mut ends) = (Vec::new(), Vec::new());
    let add = |list: &mut Vec<String>, words: String| {
        if !list.contains(&words) {
            list.push(words);
        }
    };
    for (_, pair) in pairs(&plan.experiments) {
        add(&mut kinetics, pair.kinetics.to_string());
        add(&mut ends, end(plan, pair));
    }
    kinetics.extend((!ends.is_empty()).then(|| ends.join(" and ")));
    kinetics.join(", ")
}

/// Why the growth of a pair ends.
fn end(plan: &Plan, pair: &PairPlan) -> String {
    match &pair.heat {
        Some(heat) => match heat.history {
            HistoryPlan::Pulse { .. } => format!("it cooled ({})", heat.law.name()),
            _ => format!("heated ({}, {})", heat.history.name(), heat.law.name()),
        },
        None => {
            let phi = pair.calibrated(ParameterName::Phi);
            match plan.parameters.iter().any(|parameter| parameter.name == phi) {
                true => "phi calibrated".to_owned(),
                false => {
                    format!("phi = {}", short(pair.final_contact_ratio))
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;

    #[test]
    fn explanations_that_say_the_same_are_told_apart_by_plan_and_run() {
        let of = |material| {
            let options = PairOptions { material: Some(material), ..PairOptions::default() };
            options.plan().expect("a plan").plan
        };
        let (ps, pa12) = (of(Material::Ps), of(Material::Pa12));
        let given = ["a", "b", "c"].map(str::to_owned);
        let named = |plans: &[&Plan]| names(plans.iter().copied(), &given);
        let full = format!(
            "three-stage, phi = {}",
            short(pa12.pair().expect("a pair").0.final_contact_ratio)
        );
        assert_eq!(named(&[&ps, &pa12]), ["three-stage, phi = 1.08".to_owned(), full]);
        let other = Plan { name: "other".to_owned(), ..ps.clone() };
        assert_eq!(
            named(&[&ps, &other]),
            ["three-stage, phi = 1.08 (ps)", "three-stage, phi = 1.08 (other)"]
        );
        assert_eq!(
            named(&[&ps, &ps, &pa12])[..2],
            ["three-stage, phi = 1.08 (ps), a", "three-stage, phi = 1.08 (ps), b"]
        );
    }
}
