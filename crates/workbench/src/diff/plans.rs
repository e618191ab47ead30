//! What differs between two plans, field by field.

use serde::Serialize;
use serde_json::Value;

use crate::plan::Plan;

/// Longest text of a value that is shown whole, in characters.
const LONGEST: usize = 60;

/// A field that is not the same in two plans.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The field, as in `sampler.seed` or `parameters.tau_s.prior.upper`.
    pub field: String,
    /// Its value in the first plan; none where it has none.
    pub one: Option<String>,
    /// Its value in the other.
    pub other: Option<String>,
}

/// The fields in which two plans differ, in the order of the first.
pub(super) fn differences(one: &Plan, other: &Plan) -> Vec<Difference> {
    let value = |plan: &Plan| serde_json::to_value(plan).unwrap_or_default();
    let mut found = Vec::new();
    walk(String::new(), &value(one), &value(other), &mut found);
    found
}

fn walk(field: String, one: &Value, other: &Value, found: &mut Vec<Difference>) {
    if one == other {
        return;
    }
    let below = |name: &str| {
        if field.is_empty() { name.to_owned() } else { format!("{field}.{name}") }
    };
    match (members(one), members(other)) {
        (Some(ones), Some(others)) => {
            for (name, value) in &ones {
                let twin = others.iter().find(|(other, _)| other == name);
                walk(below(name), value, twin.map_or(&Value::Null, |(_, twin)| twin), found);
            }
            for (name, value) in
                others.iter().filter(|(name, _)| !ones.iter().any(|(n, _)| n == name))
            {
                walk(below(name), &Value::Null, value, found);
            }
        }
        _ => found.push(Difference { one: shown(one, other), other: shown(other, one), field }),
    }
}

/// The named members of an object, or of a list of objects that have names; none for other values.
fn members(value: &Value) -> Option<Vec<(String, &Value)>> {
    match value {
        Value::Object(fields) => {
            Some(fields.iter().map(|(name, value)| (name.clone(), value)).collect())
        }
        Value::Array(list) if !list.is_empty() => {
            list.iter().map(|one| Some((one.get("name")?.as_str()?.to_owned(), one))).collect()
        }
        _ => None,
    }
}

/// A value in words, beside that of the other plan; long ones by their size and what is not the same.
fn shown(value: &Value, other: &Value) -> Option<String> {
    let short = |text: String| {
        let longer = text.chars().count() > LONGEST;
        let start: String = text.chars().take(LONGEST).collect();
        if longer { format!("{start}…") } else { start }
    };
    match (value, other) {
        (Value::Null, _) => None,
        (Value::String(text), _) => Some(short(text.clone())),
        (Value::Array(list), Value::Array(others))
            if list.len() > 3 && list.len() == others.len() =>
        {
            let same = list.iter().zip(others).filter(|(one, other)| one == other).count();
            Some(format!("{} values, {} of them others", list.len(), list.len() - same))
        }
        (Value::Array(list), _) if list.len() > 3 => Some(format!("{} values", list.len())),
        // Fields of it are compared where both have it.
        (Value::Object(fields), _) => {
            Some(short(fields.get("kind").and_then(Value::as_str).unwrap_or("there").to_owned()))
        }
        _ => Some(short(value.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use smc_calib::Noise;

    fn plan(options: &PairOptions) -> Plan {
        options.plan().expect("a plan").plan
    }

    #[test]
    fn fields_that_differ_are_named_with_both_values_and_no_others() {
        let ps = PairOptions { material: Some(Material::Ps), ..PairOptions::default() };
        let one = plan(&ps);
        assert_eq!(differences(&one, &one), []);
        let other = PairOptions { seed: 7, noise: Noise::robust(), ..ps.clone() };
        let found = differences(&one, &plan(&other));
        let of = |field: &str| found.iter().find(|one| one.field == field).expect(field);
        let seed = of("sampler.seed");
        assert_eq!((seed.one.as_deref(), seed.other.as_deref()), (Some("1"), Some("7")));
        let noise = of("experiments.ps-r30.observables.contact_ratio.noise.kind");
        assert_eq!(noise.other.as_deref(), Some("robust"));
        assert_eq!(found.len(), 2, "{found:#?}");
        let windowed = PairOptions { window_s: Some([0.1, 1.0]), ..ps };
        let found = differences(&one, &plan(&windowed));
        let values = found.iter().find(|one| one.field.ends_with("contact_ratio.values"));
        let values = values.expect("other data");
        assert_eq!(values.one.as_deref(), Some("44 values"));
        let mut moved = one.clone();
        moved.experiments[0].observables[0].values[3] += 0.1;
        let found = differences(&one, &moved);
        assert_eq!(found[0].one.as_deref(), Some("44 values, 1 of them others"));
    }

    #[test]
    fn a_parameter_that_one_plan_has_not_is_named_with_its_own_value_alone() {
        let one = plan(&PairOptions { material: Some(Material::Ps), ..PairOptions::default() });
        let mut other = one.clone();
        other.parameters.remove(0);
        let found = differences(&one, &other);
        assert_eq!(found.len(), 1, "{found:#?}");
        assert_eq!((found[0].field.as_str(), found[0].other.as_ref()), ("parameters.c1", None));
        assert_eq!(found[0].one.as_deref(), Some("there"), "no JSON is shown");
    }
}
