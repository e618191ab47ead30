//! `ro-crate-metadata.json`: what an archive holds, as RO-Crate 1.1 describes it.

use std::time::SystemTime;

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::output::checksums::hex;
use crate::output::date::iso_day;
use crate::record::Record;

/// Folder of the results in an archive.
pub(super) const RESULTS: &str = "results";
/// Name of the description.
pub(super) const DESCRIPTION: &str = "ro-crate-metadata.json";

/// A file of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    /// Its name in the archive.
    pub(super) id: String,
    bytes: usize,
    sha256: String,
    role: String,
}

impl Entry {
    pub(super) fn of(id: String, bytes: &[u8], role: &str) -> Self {
        let sha256 = hex(&Sha256::digest(bytes));
        Self { id, bytes: bytes.len(), sha256, role: role.to_owned() }
    }

    pub(super) fn has_sum(&self, sha256: &str) -> bool {
        self.sha256 == sha256
    }

    fn is_input(&self) -> bool {
        self.id.starts_with("inputs/")
    }
}

/// A name as an address within the crate: what an address cannot hold by its number.
pub(super) fn address(id: &str) -> String {
    let mut address = String::new();
    for byte in id.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                address.push(char::from(byte));
            }
            _ => address.push_str(&format!("%{byte:02X}")),
        }
    }
    address
}

/// The format of a file by its name.
fn format_of(id: &str) -> &'static str {
    match id.rsplit_once('.').map_or("", |(_, end)| end) {
        "csv" => "text/csv",
        "json" => "application/json",
        "html" => "text/html",
        "md" => "text/markdown",
        "png" => "image/png",
        "svg" => "image/svg+xml",
        "toml" => "application/toml",
        _ => "text/plain",
    }
}

/// The description of a calibration and its files.
pub(super) fn describe(record: &Record, entries: &[&Entry], written: Option<SystemTime>) -> Value {
    let plan = &record.plan;
    let links = |wanted: &dyn Fn(&Entry) -> bool| -> Vec<Value> {
        let chosen = entries.iter().filter(|entry| wanted(entry));
        chosen.map(|entry| json!({ "@id": address(&entry.id) })).collect()
    };
    let day = iso_day(written.unwrap_or(SystemTime::UNIX_EPOCH));
    let mut graph = vec![
        json!({
            "@id": DESCRIPTION,
            "@type": "CreativeWork",
            "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
            "about": { "@id": "./" },
        }),
        json!({
            "@id": "./",
            "@type": "Dataset",
            "name": format!("Calibration: {}", plan.title),
            "description": format!(
                "Posterior of {} from {} measured values, with inputs, plan and report. calibrate reproduce runs it again.",
                plan.parameter_names().join(", "),
                plan.observations()
            ),
            "datePublished": day,
            "license": { "@id": "#license" },
            "hasPart": links(&|_| true),
            "mainEntity": { "@id": "results/posterior.json" },
            "mentions": { "@id": "#run" },
        }),
        json!({
            "@id": "#license",
            "@type": "CreativeWork",
            "name": "Not stated",
            "description": "Whoever made this archive has the say on its results; the measurements are those of their source.",
        }),
        json!({
            "@id": "#calibrate",
            "@type": "SoftwareApplication",
            "name": "calibrate",
            "version": plan.version,
            "softwareVersion": plan.version,
            "description": "Bayesian calibration workbench for sintering DEM",
        }),
        json!({
            "@id": "#run",
            "@type": "CreateAction",
            "name": format!("Calibration of {}, seed {}", plan.name, plan.sampler.seed),
            "instrument": { "@id": "#calibrate" },
            "object": links(&Entry::is_input),
            "result": links(&|entry| !entry.is_input()),
            "endTime": day,
        }),
    ];
    graph.extend(entries.iter().map(|entry| {
        json!({
            "@id": address(&entry.id),
            "@type": "File",
            "name": entry.id,
            "description": entry.role,
            "contentSize": entry.bytes.to_string(),
            "encodingFormat": format_of(&entry.id),
            "sha256": entry.sha256,
        })
    }));
    json!({ "@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph })
}

/// Names and sums of the files that a description lists; none where it is no such description.
pub(super) fn sums(text: &str) -> Option<Vec<(String, String)>> {
    let value: Value = serde_json::from_str(text).ok()?;
    let graph = value.get("@graph")?.as_array()?;
    let root = graph.iter().find(|one| one["@id"] == "./")?;
    let parts = root.get("hasPart")?.as_array()?;
    let listed = |id: &Value| graph.iter().find(|one| one["@id"] == *id);
    parts
        .iter()
        .map(|part| {
            let file = listed(part.get("@id")?)?;
            Some((file.get("name")?.as_str()?.to_owned(), file.get("sha256")?.as_str()?.to_owned()))
        })
        .collect()
}
