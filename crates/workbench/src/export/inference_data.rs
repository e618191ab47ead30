//! `InferenceData` as JSON, which `arviz.from_json` of ArviZ 0.x reads: groups of nested lists, with the coordinates and
//! dimensions of all of them. It has no attributes of variables; units stand in those of the group.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::groups::{Attributes, Group, Groups, Ordered, Values, Variable};
use crate::error::RunError;

/// Dimensions that ArviZ knows of itself.
const OWN: [&str; 2] = ["chain", "draw"];

/// The text of the file.
pub(super) fn text(groups: &Groups) -> Result<String, RunError> {
    let mut all: Vec<(String, Field)> = Vec::new();
    let (mut coords, mut dims) = (Map::new(), Map::new());
    for group in &groups.groups {
        for one in group.coordinates.iter().filter(|one| !OWN.contains(&one.name.as_str())) {
            coords.insert(one.name.clone(), nested(one));
        }
        for one in &group.variables {
            let further: Vec<&String> =
                one.dims.iter().filter(|dim| !OWN.contains(&dim.as_str())).collect();
            if !further.is_empty() {
                dims.insert(one.name.clone(), json!(further));
            }
        }
        let variables = group.variables.iter().map(|one| (one.name.clone(), nested(one)));
        all.push((group.name.to_owned(), Field::Variables(Ordered(variables.collect()))));
        all.push((format!("{}_attrs", group.name), Field::Object(about(group))));
    }
    all.push(("coords".to_owned(), Field::Object(coords)));
    all.push(("dims".to_owned(), Field::Object(dims)));
    all.push(("attrs".to_owned(), Field::Object(groups.attributes.clone())));
    let text = serde_json::to_string(&Ordered(all));
    text.map_err(|error| {
        RunError::new(format_args!("the posterior cannot be written as JSON: {error}"))
    })
}

/// A field of the file.
#[derive(Serialize)]
#[serde(untagged)]
enum Field {
    Variables(Ordered<Value>),
    Object(Map<String, Value>),
}

/// Attributes of a group: what it is, and the unit of each variable that has one.
fn about(group: &Group) -> Attributes {
    let unit = |one: &Variable| {
        let unit = one.attributes.get("units")?.as_str()?;
        Some(format!("{} [{unit}]", one.name))
    };
    let all = group.variables.iter().chain(&group.coordinates);
    let units: Vec<String> = all.filter_map(unit).collect();
    Attributes::from_iter([
        ("description".to_owned(), group.description.into()),
        ("units".to_owned(), units.join(", ").into()),
    ])
}

/// The values as lists of lists, one level for each dimension.
fn nested(variable: &Variable) -> Value {
    let mut level: Vec<Value> = match &variable.values {
        Values::Real(values) => values.iter().map(|value| json!(value)).collect(),
        Values::Whole(values) => values.iter().map(|value| json!(value)).collect(),
    };
    for length in variable.shape.iter().skip(1).rev() {
        level = level.chunks(*length).map(|row| Value::from(row.to_vec())).collect();
    }
    level.into()
}
