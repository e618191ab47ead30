//! A posterior and what goes with it in no format: groups of named variables with dimensions, coordinates, attributes.

use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

/// Attributes by name.
pub type Attributes = Map<String, Value>;

/// The groups of a run, as ArviZ names them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Groups {
    /// Attributes of the whole: what was run, how far to trust it, evidence.
    pub attributes: Attributes,
    /// The groups.
    pub groups: Vec<Group>,
    /// What is missing, a sentence each.
    pub notes: Vec<String>,
}

/// A group of variables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// Its name: `posterior`, `prior`, `log_likelihood`, `posterior_predictive`, `observed_data`, `sample_stats`,
    /// `constant_data`.
    pub name: &'static str,
    /// What it holds, in words.
    pub description: &'static str,
    /// One coordinate for each dimension of its variables, of the same name.
    pub coordinates: Vec<Variable>,
    /// Its variables.
    pub variables: Vec<Variable>,
}

/// A named array.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Variable {
    /// Its name, which no other variable or coordinate of the group has.
    pub name: String,
    /// Names of its dimensions.
    pub dims: Vec<String>,
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Its values, the last dimension running fastest.
    pub values: Values,
    /// Unit (`units`), meaning (`long_name`, `description`), prior.
    pub attributes: Attributes,
}

/// Values of a variable, the last dimension running fastest.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Values {
    /// Numbers.
    Real(Vec<f64>),
    /// Whole numbers: numbers of draws, samples and rows.
    Whole(Vec<i64>),
}

impl Values {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of the values as a number.
    pub fn at(&self, place: usize) -> f64 {
        match self {
            Self::Real(values) => values[place],
            Self::Whole(values) => values[place] as f64,
        }
    }

    /// One of the values as text that reads back to the same bits.
    pub fn text(&self, place: usize) -> String {
        match self {
            Self::Real(values) => format!("{:e}", values[place]),
            Self::Whole(values) => values[place].to_string(),
        }
    }
}

impl Groups {
    /// The group of a name.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.groups.iter().find(|group| group.name == name)
    }
}

impl Group {
    /// The variable of a name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }

    /// Number of draws; none where the group has none.
    pub fn draws(&self) -> Option<usize> {
        self.coordinates.iter().find(|one| one.name == "draw").map(|one| one.values.len())
    }

    /// Every observation of a group whose variables are by chain, draw and observation: its variable, and the places of its
    /// values in all draws.
    pub(super) fn by_observation(&self) -> impl Iterator<Item = (&Variable, Vec<usize>)> {
        self.variables.iter().flat_map(|of| {
            let width = of.shape.last().copied().unwrap_or(1);
            (0..width).map(move |k| (of, (k..of.values.len()).step_by(width).collect()))
        })
    }
}

impl Variable {
    /// One number per draw.
    pub(super) fn of_draws(name: String, values: Values, attributes: Attributes) -> Self {
        let shape = vec![1, values.len()];
        Self { name, dims: vec!["chain".to_owned(), "draw".to_owned()], shape, values, attributes }
    }

    /// A coordinate: one value for each place of the dimension of its name.
    pub(super) fn coordinate(name: &str, values: Values, attributes: Attributes) -> Self {
        let (dims, shape) = (vec![name.to_owned()], vec![values.len()]);
        Self { name: name.to_owned(), dims, shape, values, attributes }
    }
}

/// A JSON object whose fields keep their order: that of the plan, in which readers then show them.
pub(super) struct Ordered<T>(pub(super) Vec<(String, T)>);

impl<T: Serialize> Serialize for Ordered<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

/// Attributes from names and values; what is no number is left out.
pub(super) fn attributes<const N: usize>(all: [(&str, Value); N]) -> Attributes {
    let kept = all.into_iter().filter(|(_, value)| !value.is_null());
    kept.map(|(name, value)| (name.to_owned(), value)).collect()
}

/// A unit as an attribute: 1 for pure numbers, and short where the long word would make readers turn numbers into times of day.
pub(super) fn units(unit: &str) -> Value {
    let short = match unit.trim().to_lowercase().as_str() {
        "" => "1",
        "nanoseconds" => "ns",
        "microseconds" => "us",
        "milliseconds" => "ms",
        "seconds" => "s",
        "minutes" => "min",
        "hours" => "h",
        "days" => "d",
        // "days since .." is a calendar to them.
        words if words.contains(" since ") => return unit.replace(' ', "_").into(),
        _ => unit,
    };
    short.into()
}

/// A name that none of `taken` has, and takes it: `draw_` for a parameter that is called draw.
pub(super) fn free_name(name: &str, taken: &mut Vec<String>) -> String {
    let mut free = name.to_owned();
    while taken.contains(&free) {
        free.push('_');
    }
    taken.push(free.clone());
    free
}
