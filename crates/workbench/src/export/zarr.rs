//! A Zarr v3 store: a folder that ArviZ and xarray open.
//!
//! Every array is one chunk of plain little-endian numbers: draws of a continuous quantity hardly get smaller by packing. The
//! metadata of all groups stands in that of the root too ("consolidated"), as xarray expects it.
//!
//! Zarr core specification, version 3.1: <https://zarr-specs.readthedocs.io/en/latest/v3/core/index.html>.

use serde::Serialize;
use serde_json::{Value, json};

use super::groups::{Attributes, Group, Groups, Ordered, Values, Variable};
use crate::error::RunError;
use crate::output::pretty;

/// Name of the metadata of a group or an array.
const METADATA: &str = "zarr.json";

/// Metadata of a group.
#[derive(Serialize)]
struct Node {
    zarr_format: u32,
    node_type: &'static str,
    attributes: Attributes,
    consolidated_metadata: Consolidated,
}

/// Metadata of everything in a group.
#[derive(Serialize)]
struct Consolidated {
    kind: &'static str,
    must_understand: bool,
    metadata: Ordered<Within>,
}

/// Metadata of a group or an array in another group.
#[derive(Serialize)]
#[serde(untagged)]
enum Within {
    Group(Node),
    Array(Value),
}

/// The files of a store: their paths in it, and their bytes.
pub(super) fn files(groups: &Groups) -> Result<Vec<(String, Vec<u8>)>, RunError> {
    let mut files = Vec::new();
    let mut all = Vec::new();
    for group in &groups.groups {
        let mut own = Vec::new();
        for variable in group.coordinates.iter().chain(&group.variables) {
            let path = format!("{}/{}", group.name, variable.name);
            let metadata = array(variable);
            files.push((format!("{path}/{METADATA}"), pretty(&metadata)?.into_bytes()));
            files.push((chunk_of(&path, variable), bytes(&variable.values)));
            own.push((variable.name.clone(), metadata));
        }
        let arrays = |start: &str| -> Vec<(String, Within)> {
            let one = |(name, array): &(String, Value)| {
                (format!("{start}{name}"), Within::Array(array.clone()))
            };
            own.iter().map(one).collect()
        };
        let metadata = node(about(group), arrays(""));
        files.push((format!("{}/{METADATA}", group.name), pretty(&metadata)?.into_bytes()));
        all.push((group.name.to_owned(), Within::Group(metadata)));
        all.extend(arrays(&format!("{}/", group.name)));
    }
    let root = node(groups.attributes.clone(), all);
    files.push((METADATA.to_owned(), pretty(&root)?.into_bytes()));
    Ok(files)
}

fn about(group: &Group) -> Attributes {
    Attributes::from_iter([("description".to_owned(), group.description.into())])
}

/// A group with the metadata of everything in it.
fn node(attributes: Attributes, within: Vec<(String, Within)>) -> Node {
    let metadata = Ordered(within);
    let consolidated_metadata = Consolidated { kind: "inline", must_understand: false, metadata };
    Node { zarr_format: 3, node_type: "group", attributes, consolidated_metadata }
}

/// Metadata of an array.
fn array(variable: &Variable) -> Value {
    let (data_type, fill_value) = match variable.values {
        Values::Real(_) => ("float64", json!("NaN")),
        Values::Whole(_) => ("int64", json!(0)),
    };
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": variable.shape,
        "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": variable.shape } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": fill_value,
        "codecs": [{ "name": "bytes", "configuration": { "endian": "little" } }],
        "attributes": variable.attributes,
        "dimension_names": variable.dims,
        "storage_transformers": [],
    })
}

/// The one chunk of an array.
fn chunk_of(path: &str, variable: &Variable) -> String {
    format!("{path}/c{}", "/0".repeat(variable.shape.len()))
}

fn bytes(values: &Values) -> Vec<u8> {
    match values {
        Values::Real(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        Values::Whole(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    }
}
