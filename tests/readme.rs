//! The README against the tree and the command.

use std::fs;
use std::os::unix::fs::symlink;

use crate::sandbox::{Sandbox, root};

fn readme() -> String {
    fs::read_to_string(root().join("README.md")).expect("README.md")
}

/// Cells in backquotes of a table column that look like paths.
fn paths(text: &str) -> Vec<String> {
    text.lines()
        .filter(|line| line.starts_with('|'))
        .flat_map(|line| line.split('`').skip(1).step_by(2))
        .filter(|cell| {
            ["crates/", "experiments/", "priors/", "results/", "tests/", ".ci/", "Cargo.toml"]
                .iter()
                .any(|top| cell.starts_with(top))
        })
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_path_in_the_readmes_tables_exists_and_no_folder_or_crate_is_left_out() {
    let root = root();
    let listed = paths(&readme());
    for path in &listed {
        assert!(root.join(path).exists(), "the README names {path}, which is not there");
    }
    let folders = |folder: &str| -> Vec<String> {
        fs::read_dir(root.join(folder))
            .expect("a folder")
            .map(|entry| entry.expect("an entry"))
            .filter(|entry| entry.path().is_dir())
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .filter(|name| !name.starts_with('.') && name != "target")
            .collect()
    };
    for name in folders("") {
        assert!(listed.contains(&format!("{name}/")), "the README does not name {name}/");
    }
    for name in folders("crates") {
        assert!(
            listed.contains(&format!("crates/{name}")),
            "the README does not name crates/{name}"
        );
    }
}

#[test]
fn every_link_of_the_readme_to_the_tree_leads_somewhere() {
    let readme = readme();
    for link in readme.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        if !link.starts_with("http") {
            assert!(root().join(link).exists(), "the README links to {link}, which is not there");
        }
    }
}

/// The commands in the README's code blocks, in order.
fn commands(readme: &str) -> Vec<String> {
    let blocks = readme.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next());
    blocks
        .flat_map(str::lines)
        .map(|line| line.split('#').next().unwrap_or_default().trim().to_owned())
        .filter_map(|line| {
            let arguments = line
                .strip_prefix("cargo run --release -- ")
                .or_else(|| line.strip_prefix("calibrate "))?;
            Some(arguments.to_owned())
        })
        .collect()
}

#[test]
fn the_readmes_commands_run_as_they_stand() {
    let sandbox = Sandbox::new();
    for folder in ["experiments", "priors"] {
        symlink(root().join(folder), sandbox.path().join(folder)).expect("a link");
    }
    // The table of a spreadsheet is the guide's.
    let page = root().join("crates/guide/pages/getting-started.md");
    let page = fs::read_to_string(page).expect("the page");
    let table = page.split("```csv,neck.csv\n").nth(1).and_then(|rest| rest.split("```").next());
    sandbox.write("neck.csv", table.expect("the table of a spreadsheet"));
    let commands = commands(&readme());
    assert!(commands.len() >= 6, "{commands:?}");
    for arguments in commands {
        // Commands that take minutes, or what these write, are only held to exist, with these arguments.
        let long = ["table3", "compare", "densify", "predict --average"];
        let slow = long.iter().any(|name| arguments.starts_with(name));
        let arguments = if slow { format!("{arguments} --help") } else { arguments };
        sandbox.run(&arguments).succeeded();
    }
}
