//! Whether a plan is that of a run that is there.

use serde_json::Value;
use smc_calib::Settings;

use crate::plan::Plan;

/// The field that an extension changes.
pub(super) const SAMPLES: &str = "sampler.samples";

/// A plan with the limits on its runs of another one: what decides on whether they get made.
pub(super) fn with_limits(plan: &Plan, limits: &Plan) -> Plan {
    let mut plan = plan.clone();
    for (call, (.., of)) in plan.calls_mut().zip(limits.commands()) {
        call.set_limits(of);
    }
    plan
}

/// Whether the limits on runs of two plans that are the same otherwise differ.
pub(super) fn limits_differ(was: &Plan, is: &Plan) -> bool {
    with_limits(was, is) != *was
}

/// Whether two plans give the same result; the version of the program and limits on runs are no part of this.
pub(super) fn same(was: &Plan, is: &Plan) -> bool {
    let was = with_samples(was, is);
    Plan { version: was.version.clone(), ..with_limits(is, &was) } == was
}

/// The plan of a run with the number of samples of a plan file, where it is one that the run has had: a run that was extended
/// is still that of its file.
fn with_samples(was: &Plan, is: &Plan) -> Plan {
    let mut plan = was.clone();
    let samples = is.sampler.samples;
    if is.sampler.earlier.is_empty()
        && (was.sampler.earlier.contains(&samples) || was.sampler.samples == samples)
    {
        let kept = Settings { samples, ..was.sampler.as_begun() };
        // What a file leaves open has the default of its own number.
        plan.sampler = if kept == is.sampler { kept } else { was.sampler.begun_with(samples) };
    }
    plan
}

/// Where two plans differ first: the field, and both values. The version of the program and limits on runs are no part of
/// this.
pub(super) fn difference(was: &Plan, is: &Plan) -> Option<(String, String, String)> {
    let was = with_samples(&with_limits(was, is), is);
    let was = Plan { version: is.version.clone(), ..was };
    let (before, now) = (was.sampler.samples, is.sampler.samples);
    if before != now {
        // Other settings of the sampler follow from it.
        return Some((SAMPLES.to_owned(), before.to_string(), now.to_string()));
    }
    let tree = |plan: &Plan| serde_json::to_value(plan).unwrap_or(Value::Null);
    first_difference("", &tree(&was), &tree(is))
}

fn first_difference(path: &str, was: &Value, is: &Value) -> Option<(String, String, String)> {
    let inner = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (was, is) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            let value =
                |map: &serde_json::Map<_, _>, key| map.get(key).cloned().unwrap_or_default();
            keys.into_iter()
                .find_map(|key| first_difference(&inner(key), &value(a, key), &value(b, key)))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (0..a.len()).find_map(|k| {
            let name = a[k].get("name").and_then(Value::as_str);
            let key = name.map_or_else(|| k.to_string(), str::to_owned);
            first_difference(&inner(&key), &a[k], &b[k])
        }),
        (Value::Array(a), Value::Array(b)) => {
            Some((path.to_owned(), format!("{} entries", a.len()), format!("{} entries", b.len())))
        }
        (a, b) if a == b => None,
        (a, b) => Some((path.to_owned(), a.to_string(), b.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named_with_its_place() {
        let was =
            serde_json::json!({"a": 1, "list": [{"name": "k", "x": 1.5}, {"name": "c", "x": 2}]});
        let mut is = was.clone();
        assert_eq!(first_difference("", &was, &is), None);
        is["list"][1]["x"] = 3.into();
        let (field, from, to) = first_difference("", &was, &is).expect("differs");
        assert_eq!((field.as_str(), from.as_str(), to.as_str()), ("list.c.x", "2", "3"));
        is["list"] = serde_json::json!([]);
        assert_eq!(first_difference("", &was, &is).expect("shorter").0, "list");
    }
}
