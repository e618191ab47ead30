//! An explanation before it is ranked.

use super::super::noises;
use crate::plan::Plan;
use crate::record::Record;

/// An explanation that was calibrated.
pub(super) struct Explained {
    pub(super) name: String,
    pub(super) record: Record,
}

/// The noise models of a plan, each once.
pub(super) fn noise_kinds(plan: &Plan) -> String {
    let mut names: Vec<String> = Vec::new();
    for (_, observable) in plan.observables() {
        let name = noises::name(&observable.noise);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(" and ")
}
