//! Priors of one parameter in several explanations: whether they state the same.
//!
//! A prior of tau_s, or of a cooling time, is stated for a radius; the same numbers for another radius are another prior.

use smc_calib::{Parameter, Prior};

use super::explained::Explained;
use crate::careful::Careful;
use crate::number::significant;
use crate::pair::parameter::ParameterName;
use crate::plan::{Plan, pairs, prior_in_words};

/// A prior as it is stated.
struct Stated<'p> {
    prior: &'p Prior,
    /// The radii that it is stated for \[m\], where the parameter goes with R by a law.
    radii_m: Vec<f64>,
    /// Whether the law is that of proportion.
    proportional: bool,
}

impl<'p> Stated<'p> {
    fn of(plan: &'p Plan, parameter: &'p Parameter) -> Self {
        let is = |calibrated: &str| calibrated == parameter.name;
        let mut proportional = false;
        let mut radii_m = Vec::new();
        for (_, pair) in pairs(&plan.experiments) {
            if is(pair.calibrated(ParameterName::TauS)) {
                proportional = true;
                radii_m.push(pair.tau_s_radius_m.unwrap_or(pair.powder.radius_m));
            } else if is(pair.calibrated(ParameterName::CoolingTime)) {
                radii_m.extend(pair.cooling_radius_m());
            }
        }
        radii_m.sort_by(f64::total_cmp);
        radii_m.dedup();
        Self { prior: &parameter.prior, radii_m, proportional }
    }

    fn is_that_of(&self, other: &Self) -> bool {
        if self.radii_m == other.radii_m {
            return self.prior == other.prior;
        }
        let ([here], [there], true) =
            (&self.radii_m[..], &other.radii_m[..], self.proportional && other.proportional)
        else {
            return false;
        };
        // What is stated here is a time at that radius, in proportion to it.
        [1e-3, 0.1, 0.5, 0.9, 0.999].into_iter().all(|p| {
            let [a, b] = [self, other].map(|stated| stated.prior.quantile(p));
            (a / here * there / b - 1.0).abs() < 1e-9
        })
    }

    /// In words, with the radii where these are what differs.
    fn in_words(&self, other: &Self) -> String {
        let prior = prior_in_words(self.prior.spec());
        if self.radii_m == other.radii_m {
            return prior;
        }
        let radii: Vec<String> =
            self.radii_m.iter().map(|radius_m| significant(*radius_m, 3)).collect();
        match radii.is_empty() {
            true => prior,
            false => format!("{prior} at R = {} m", radii.join(" and ")),
        }
    }
}

/// Parameters of one name whose priors are not those of the first explanation that has it.
pub(super) fn that_differ(explained: &[Explained]) -> Vec<Careful> {
    let mut found = Vec::new();
    for (k, one) in explained.iter().enumerate() {
        for parameter in &one.record.plan.parameters {
            let before = explained[..k].iter().find_map(|earlier| {
                let plan = &earlier.record.plan;
                let own = plan.parameters.iter().find(|own| own.name == parameter.name)?;
                Some((&earlier.name, Stated::of(plan, own)))
            });
            let Some((earlier, own)) = before else { continue };
            let stated = Stated::of(&one.record.plan, parameter);
            if !own.is_that_of(&stated) {
                found.push(Careful::PriorsDiffer {
                    parameter: parameter.name.clone(),
                    one: earlier.clone(),
                    prior: own.in_words(&stated),
                    other: one.name.clone(),
                    other_prior: stated.in_words(&own),
                });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use smc_calib::PriorSpec;

    use super::*;
    use crate::plan::{Planned, SimulatorPlan};

    /// The plan of two radii, with tau_s (of its first pair's 60 um) stated for another radius.
    fn stated_at(radius_m: f64, scale: f64) -> Plan {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/heat");
        let mut plan = Planned::read(&folder.join("ps-radii.toml")).expect("a plan").plan;
        for experiment in &mut plan.experiments {
            if let SimulatorPlan::Builtin(pair) = &mut experiment.simulator {
                pair.tau_s_radius_m = Some(radius_m);
            }
        }
        let tau_s = plan.parameters.iter_mut().find(|one| one.name == "tau_s").expect("tau_s");
        let spec = PriorSpec::LogUniform { lower: 0.01 * scale, upper: scale };
        tau_s.prior = Prior::new(spec).expect("a prior");
        plan
    }

    #[test]
    fn a_prior_of_tau_s_for_another_radius_is_another_one_unless_it_goes_with_the_radius() {
        let tau_s = |plan: &Plan| plan.parameters.iter().position(|one| one.name == "tau_s");
        let compared = |plan: &Plan, other: &Plan| {
            let [one, two] = [plan, other]
                .map(|plan| Stated::of(plan, &plan.parameters[tau_s(plan).expect("tau_s")]));
            (one.is_that_of(&two), two.in_words(&one))
        };
        let plan = stated_at(60e-6, 1.0);
        assert!(compared(&plan, &plan).0);
        assert!(compared(&plan, &stated_at(30e-6, 0.5)).0, "the same time at the same radius");
        let (same, words) = compared(&plan, &stated_at(30e-6, 1.0));
        assert!(!same && words.ends_with(" at R = 3.00e-5 m"), "{words}");
        let (same, words) = compared(&plan, &stated_at(60e-6, 0.5));
        assert!(!same && !words.contains("at R"), "{words}");
    }

    #[test]
    fn a_prior_of_a_cooling_time_belongs_to_its_radius() {
        let plan = stated_at(60e-6, 1.0);
        let mut other = plan.clone();
        for experiment in &mut other.experiments {
            if let SimulatorPlan::Builtin(pair) = &mut experiment.simulator
                && let Some(heat) = &mut pair.heat
                && let crate::pair::heat::HistoryPlan::Pulse { cooling_radius_m, .. } =
                    &mut heat.history
            {
                *cooling_radius_m = Some(30e-6);
            }
        }
        let of = |plan| {
            let plan: &Plan = plan;
            let time = plan.parameters.iter().find(|one| one.name == "cooling_time");
            Stated::of(plan, time.expect("a cooling time"))
        };
        let (here, there) = (of(&plan), of(&other));
        assert_eq!((here.radii_m.clone(), there.radii_m.clone()), (vec![60e-6], vec![30e-6]));
        assert!(here.is_that_of(&of(&plan)) && !here.is_that_of(&there));
    }
}
