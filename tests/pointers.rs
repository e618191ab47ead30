//! Links and paths that documents and sources name, against the tree.

use std::fs;
use std::path::{Path, PathBuf};

use crate::sandbox::root;

/// Files under a folder of the project, without hidden folders and build results.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|own| own == extension) {
            found.push(path);
        }
    }
    found
}

/// The documents: at the top, of the crates, of the experiments, of the committed results.
fn documents() -> Vec<PathBuf> {
    let root = root();
    let top = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root.join(name));
    let mut documents: Vec<PathBuf> = top.into_iter().filter(|path| path.exists()).collect();
    for folder in ["crates", "experiments"] {
        documents.extend(files(&root.join(folder), "md"));
    }
    documents.push(root.join("results/README.md"));
    for folder in COMMITTED_RESULTS {
        documents.extend(files(&root.join("results").join(folder), "md"));
    }
    documents
}

/// Folders of `results/` that are committed; all others are results of runs.
const COMMITTED_RESULTS: [&str; 4] = ["benchmarks", "densify", "table3", "validation"];

/// Targets of the links of a document, without web addresses and anchors.
fn links(text: &str) -> Vec<&str> {
    text.split("](")
        .skip(1)
        .filter_map(|rest| rest.split([')', '#']).next())
        .filter(|link| !link.is_empty() && !link.contains("://"))
        .collect()
}

/// Paths of the project that a text names, from the top of the project or of a crate.
fn paths(text: &str) -> Vec<&str> {
    let of_path = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let tops = ["crates/", "experiments/", "priors/", "results/", "tests/"];
    text.split(|c| !of_path(c))
        .map(|word| word.trim_end_matches(['.', '/', '-']))
        .filter(|word| tops.iter().any(|top| word.starts_with(top)))
        .collect()
}

/// Whether a path is to exist: no placeholder such as `results/NAME`, and no folder of a run.
fn is_to_exist(path: &str) -> bool {
    let placeholder = |part: &str| {
        part.chars().any(|c| c.is_ascii_uppercase())
            && !part.chars().any(|c| c.is_ascii_lowercase())
    };
    let of_a_run = path
        .strip_prefix("results/")
        .and_then(|rest| rest.split('/').next())
        .is_some_and(|folder| folder != "README.md" && !COMMITTED_RESULTS.contains(&folder));
    !of_a_run && !path.split('/').any(placeholder)
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn every_link_of_the_documents_leads_somewhere() {
    let mut broken = Vec::new();
    for document in documents() {
        let text = read(&document);
        let folder = document.parent().expect("a folder");
        let missing = links(&text).into_iter().filter(|link| !folder.join(link).exists());
        broken.extend(missing.map(|link| format!("{}: {link}", document.display())));
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_path_that_documents_and_sources_name_exists() {
    let root = root();
    let mut named = documents();
    for member in fs::read_dir(root.join("crates")).expect("crates") {
        named.extend(files(&member.expect("a crate").path().join("src"), "rs"));
    }
    let mut broken = Vec::new();
    for file in named {
        let own_crate =
            file.strip_prefix(root.join("crates")).ok().and_then(|path| path.iter().next());
        let bases = [Some(root.clone()), own_crate.map(|name| root.join("crates").join(name))];
        let text = read(&file);
        for path in paths(&text).into_iter().filter(|path| is_to_exist(path)) {
            if !bases.iter().flatten().any(|base| base.join(path).exists()) {
                broken.push(format!("{}: {path}", file.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn a_broken_pointer_would_be_found() {
    assert_eq!(links("[a](b.md#c) [w](https://x.org/y) ![p](q/r.svg)"), ["b.md", "q/r.svg"]);
    let text = "see experiments/external/spring.toml, `results/NAME` or results/ps/fit.png.";
    let named: Vec<&str> = paths(text).into_iter().filter(|path| is_to_exist(path)).collect();
    assert_eq!(named, ["experiments/external/spring.toml"]);
    assert!(!root().join(named[0]).exists());
    assert!(is_to_exist("results/benchmarks/growth/report.md"));
}
