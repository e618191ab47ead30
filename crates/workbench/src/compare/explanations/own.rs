//! A plan of pairs of several radii beside itself, with what the radii share by a law of R as one's own for each radius.

use smc_calib::Parameter;

use super::super::strength::{Strength, bayes_factor};
use crate::error::{InputError, Mistake};
use crate::pair::heat::HistoryPlan;
use crate::pair::parameter::ParameterName;
use crate::plan::{ExperimentPlan, Plan, SimulatorPlan, pairs};

/// Parameters that go with the radius by a law, each with its words.
const LAWS: [(ParameterName, &str); 2] = [
    (ParameterName::TauS, "tau_s in proportion to R"),
    (ParameterName::CoolingTime, "cooling time by its power of R"),
];

/// A plan as it stands and its variants.
pub(super) struct Variants {
    pub(super) laws: Vec<Law>,
    /// By name; the plan itself is the first.
    pub(super) plans: Vec<(String, Plan)>,
}

/// A law of the radius, and which of the variants take it and which do not.
pub(super) struct Law {
    words: &'static str,
    /// Whether each variant leaves it.
    own: Vec<bool>,
}

impl Law {
    /// Whether the data contradict it, by the log evidences of the variants, which are to be `trusted` or not.
    pub(super) fn in_words(&self, log_evidences: &[f64], trusted: bool) -> String {
        let top = log_evidences.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let average = |own: bool| {
            let kept = self.own.iter().zip(log_evidences).filter(|(left, _)| **left == own);
            let values: Vec<f64> = kept.map(|(_, log)| (log - top).exp()).collect();
            (values.iter().sum::<f64>() / values.len().max(1) as f64).ln()
        };
        let gain = average(true) - average(false);
        let strength = Strength::of(gain.abs());
        let factor = bayes_factor(gain.abs());
        let but = if trusted { "" } else { ", by evidences that are not all to be trusted" };
        let (verb, what) = match (gain > 0.0, strength) {
            (_, Strength::None | Strength::BareMention) => {
                return format!(
                    "Of \"{}\" the data do not decide (Bayes factor below 3){but}.",
                    self.words
                );
            }
            (true, Strength::Positive) => ("speak against", "for"),
            (true, _) => ("contradict", "for"),
            (false, Strength::Positive) => ("speak for", "against"),
            (false, _) => ("support", "against"),
        };
        format!(
            "The data {verb} \"{}\": {strength} evidence {what} one of its own for each radius (Bayes factor {factor}){but}.",
            self.words
        )
    }
}

/// The plan and its variants.
///
/// # Errors
///
/// [`InputError`] for a plan with an experiment that is not computed here, and for one in which two radii share none of the
/// parameters that go with R.
pub(super) fn variants(plan: &Plan) -> Result<Variants, InputError> {
    plan.experiments.iter().try_for_each(|experiment| is_built_in(plan, experiment))?;
    let freed: Vec<_> = LAWS
        .into_iter()
        .filter_map(|(name, words)| Some((name, words, with_own(plan, name)?)))
        .collect();
    if freed.is_empty() {
        return Err(InputError::new(&plan.name, Mistake::Conflict)
            .found("no tau_s and no cooling_time that pairs of two radii share")
            .expected("built-in pairs of two radii or more, with one tau_s (tau_s_radius_m) or one cooling_time (cooling_radius_m)")
            .help("experiments/heat/ps-radii.toml is such a plan; calibrate compare RUN RUN ranks finished runs of any"));
    }
    let mut plans = vec![("shared".to_owned(), plan.clone())];
    plans
        .extend(freed.iter().map(|(name, _, plan)| (format!("own {}", name.name()), plan.clone())));
    let mut own: Vec<Vec<bool>> =
        (0..freed.len()).map(|law| (0..plans.len()).map(|k| k == law + 1).collect()).collect();
    if let [(first, _, one), (second, ..)] = &freed[..]
        && let Some(both) = with_own(one, *second)
    {
        plans.push((format!("own {} and {}", first.name(), second.name()), both));
        own.iter_mut().for_each(|own| own.push(true));
    }
    let laws = freed.iter().zip(own).map(|((_, words, _), own)| Law { words, own }).collect();
    Ok(Variants { laws, plans })
}

/// Refuses an experiment whose runs need a folder, or the program that has its function.
fn is_built_in(plan: &Plan, experiment: &ExperimentPlan) -> Result<(), InputError> {
    let (simulator, finish) = match &experiment.simulator {
        SimulatorPlan::Builtin(_) => return Ok(()),
        SimulatorPlan::Command(call) => {
            (format!("a program ({})", call.argv.join(" ")), "calibrate --plan FILE --out DIR")
        }
        SimulatorPlan::Function { name } => {
            (format!("the function {name}"), "by the program that has the function")
        }
    };
    Err(InputError::new(&plan.name, Mistake::Conflict)
        .found(format_args!("experiment {}, whose simulator is {simulator}", experiment.name))
        .expected("built-in pairs alone, which are calibrated here with what they share and without")
        .help(format_args!(
            "write a plan for each explanation, finish a run of each ({finish}), and rank them by folder: calibrate compare RUN RUN"
        )))
}

/// The plan with a parameter of one's own for each radius but the first that shares it, with the same prior; none where no two
/// radii share it.
fn with_own(plan: &Plan, name: ParameterName) -> Option<Plan> {
    let mut changed = plan.clone();
    // Calibrated name, radius and own name of each radius that is met.
    let mut met: Vec<(String, f64, String)> = Vec::new();
    let mut added = false;
    for experiment in &mut changed.experiments {
        let SimulatorPlan::Builtin(pair) = &mut experiment.simulator else { continue };
        let shared = pair.calibrated(name).to_owned();
        if !pair.takes(name) || plan.parameters.iter().all(|one| one.name != shared) {
            continue;
        }
        let radius_m = pair.powder.radius_m;
        let of_radius = met.iter().find(|(own, radius, _)| *own == shared && *radius == radius_m);
        let own = match (of_radius, met.iter().any(|(own, ..)| *own == shared)) {
            (Some((.., own)), _) => own.clone(),
            (None, false) => shared.clone(),
            (None, true) => unused(&changed.parameters, &format!("{shared}_{}", experiment.name)),
        };
        if own != shared && changed.parameters.iter().all(|one| one.name != own) {
            let at = changed.parameters.iter().position(|one| one.name == shared)?;
            let prior = changed.parameters[at].clone();
            changed.parameters.insert(at + 1, Parameter { name: own.clone(), ..prior });
            added = true;
        }
        if own != shared {
            pair.parameters.insert(name, own.clone());
        }
        met.push((shared, radius_m, own));
    }
    if name == ParameterName::CoolingTime {
        cooled_at_their_own_radius(&mut changed);
    }
    added.then_some(changed)
}

/// Makes each calibrated cooling time that of its own radius: no power of R is left.
fn cooled_at_their_own_radius(plan: &mut Plan) {
    let power = ParameterName::CoolingPower;
    let names = |plan: &Plan| -> Vec<String> {
        let own = pairs(&plan.experiments).filter(|(_, pair)| pair.takes(power));
        own.map(|(_, pair)| pair.calibrated(power).to_owned()).collect()
    };
    let before = names(plan);
    for experiment in &mut plan.experiments {
        let SimulatorPlan::Builtin(pair) = &mut experiment.simulator else { continue };
        let open = pair.takes(ParameterName::CoolingTime);
        if let Some(heat) = pair.heat.as_mut().filter(|_| open)
            && let HistoryPlan::Pulse { cooling_radius_m, .. } = &mut heat.history
        {
            *cooling_radius_m = None;
        }
    }
    let after = names(plan);
    plan.parameters.retain(|one| !before.contains(&one.name) || after.contains(&one.name));
}

/// A name that no parameter has.
fn unused(parameters: &[Parameter], wished: &str) -> String {
    let mut name = wished.to_owned();
    while parameters.iter().any(|one| one.name == name) {
        name.push('_');
    }
    name
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::plan::Planned;

    fn read(name: &str) -> Plan {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/heat");
        Planned::read(&folder.join(format!("{name}.toml"))).expect("a plan").plan
    }

    fn names(plan: &Plan) -> Vec<&str> {
        plan.parameters.iter().map(|one| one.name.as_str()).collect()
    }

    #[test]
    fn each_law_is_left_alone_and_together_and_a_power_of_r_goes_with_the_shared_time() {
        let plan = read("ps-radii");
        let Variants { laws, plans } = variants(&plan).expect("variants");
        let [(shared, as_is), (tau_s, own_tau_s), (time, own_time), (both, own_both)] = &plans[..]
        else {
            panic!("{} variants", plans.len())
        };
        let words = [shared, tau_s, time, both].map(String::as_str);
        assert_eq!(
            words,
            ["shared", "own tau_s", "own cooling_time", "own tau_s and cooling_time"]
        );
        assert_eq!(as_is, &plan);
        assert_eq!(
            names(own_tau_s),
            [
                "c1",
                "tau_s",
                "tau_s_r30",
                "delta_c",
                "cooling_time",
                "cooling_power",
                "amplitude_r30"
            ]
        );
        assert_eq!(
            names(own_time),
            ["c1", "tau_s", "delta_c", "cooling_time", "cooling_time_r30", "amplitude_r30"]
        );
        assert_eq!(own_both.parameters.len(), 7);
        let of = |plan: &Plan, name: ParameterName| -> Vec<String> {
            pairs(&plan.experiments).map(|(_, pair)| pair.calibrated(name).to_owned()).collect()
        };
        assert_eq!(of(own_tau_s, ParameterName::TauS), ["tau_s", "tau_s_r30"]);
        assert_eq!(own_tau_s.parameters[1].prior, own_tau_s.parameters[2].prior);
        let powers = pairs(&own_time.experiments)
            .filter(|(_, pair)| pair.takes(ParameterName::CoolingPower));
        assert_eq!(powers.count(), 0);
        assert_eq!(laws[0].own, [false, true, false, true]);
        assert_eq!(laws[1].own, [false, false, true, true]);
    }

    #[test]
    fn pairs_of_one_radius_share_on_and_a_plan_of_one_radius_has_no_variants() {
        let three = read("ps-power");
        assert!(variants(&three).err().expect("no radii").to_string().contains("two radii"));
        // A second pair of 30.5 um has the tau_s of the first.
        let mut plan = read("ps-radii-phi");
        let mut again = plan.experiments[1].clone();
        again.name = "again".to_owned();
        plan.experiments.push(again);
        let freed = with_own(&plan, ParameterName::TauS).expect("two radii");
        let own: Vec<&str> = pairs(&freed.experiments)
            .map(|(_, pair)| pair.calibrated(ParameterName::TauS))
            .collect();
        assert_eq!(own, ["tau_s", "tau_s_r30", "tau_s_r30"]);
        assert_eq!(freed.parameters.len(), plan.parameters.len() + 1);
    }

    #[test]
    fn a_law_is_contradicted_or_supported_by_the_average_evidence_of_what_leaves_it() {
        let law = Law { words: "tau_s in proportion to R", own: vec![false, true, false, true] };
        let said = |logs: [f64; 4]| law.in_words(&logs, true);
        // (e^5 + e^3)/(e^0 + e^1) = 45: strong.
        let against = said([0.0, 5.0, 1.0, 3.0]);
        assert!(
            against.starts_with("The data contradict") && against.contains("strong"),
            "{against}"
        );
        assert!(against.contains("(Bayes factor 45)"), "{against}");
        let support = said([5.0, 0.0, 3.0, 1.0]);
        assert!(support.starts_with("The data support") && support.contains("45"), "{support}");
        assert!(said([0.0, 0.5, 0.5, 0.0]).contains("do not decide"));
        // Little is not called a contradiction, and doubt in the evidences is said.
        assert!(said([0.0, 2.0, 0.0, 2.0]).starts_with("The data speak against"));
        assert!(law.in_words(&[0.0, 5.0, 1.0, 3.0], false).contains("not all to be trusted"));
    }
}
