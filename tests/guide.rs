//! The guide against the tree and the command: every command runs, and prints what the pages show.

use std::collections::BTreeSet;
use std::env;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::sandbox::{Ran, Sandbox, root};

/// The paper whose model it is.
const DOI: &str = "10.1051/epjconf/202124905001";

fn folder() -> PathBuf {
    root().join("crates/guide/pages")
}

/// A page of the guide.
struct Page {
    name: String,
    text: String,
}

/// The pages in the order of the table of contents.
fn pages() -> Vec<Page> {
    let summary = fs::read_to_string(folder().join("SUMMARY.md")).expect("SUMMARY.md");
    let names = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    names
        .map(|name| {
            let text = fs::read_to_string(folder().join(name)).expect(name);
            let included = text
                .trim()
                .strip_prefix("{{#include ")
                .and_then(|rest| rest.strip_suffix("}}"))
                .map(|path| fs::read_to_string(folder().join(path)).expect(path));
            Page { name: name.to_owned(), text: included.unwrap_or(text) }
        })
        .collect()
}

/// A block of code with what stands behind its fence.
struct Block {
    /// Page and line.
    place: String,
    language: String,
    /// Behind the language: how its commands are run, or the file that it is.
    mark: Option<String>,
    lines: Vec<String>,
}

fn blocks(page: &Page) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in page.text.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(info), None) => {
                let (language, mark) =
                    info.split_once(',').map_or((info, None), |(a, b)| (a, Some(b)));
                open = Some(Block {
                    place: format!("{}:{}", page.name, number + 1),
                    language: language.to_owned(),
                    mark: mark.map(str::to_owned),
                    lines: Vec::new(),
                });
            }
            (None, Some(block)) => block.lines.push(line.to_owned()),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{}: a block of code is not closed", page.name);
    blocks
}

/// A command of a `console` block and the lines that are shown of its output.
fn shown(block: &Block) -> Vec<(String, Vec<String>)> {
    let mut commands: Vec<(String, Vec<String>)> = Vec::new();
    for line in &block.lines {
        match (line.strip_prefix("$ "), commands.last_mut()) {
            (Some(command), _) => commands.push((command.to_owned(), Vec::new())),
            (None, Some((_, output))) => output.push(line.clone()),
            (None, None) => panic!("{}: output before a command", block.place),
        }
    }
    commands
}

/// The first line that is shown and not printed. `...` stands for any lines, or for the end of its line.
fn not_printed<'a>(shown: &'a [String], printed: &str) -> Option<&'a str> {
    let mut lines = printed.lines().map(str::trim_end);
    shown.iter().map(|line| line.trim_end()).filter(|line| *line != "...").find(|line| {
        let is_it = |printed: &str| match line.strip_suffix("...") {
            Some(begin) if *line != printed => printed.starts_with(begin),
            _ => *line == printed,
        };
        !lines.any(is_it)
    })
}

/// Where the commands of all pages run, one after the other.
struct Walk {
    sandbox: Sandbox,
    path: String,
}

impl Walk {
    fn new() -> Self {
        let sandbox = Sandbox::new();
        for name in ["experiments", "priors", "tests"] {
            symlink(root().join(name), sandbox.path().join(name)).expect("a link");
        }
        let program = Path::new(env!("CARGO_BIN_EXE_calibrate"));
        let program = program.parent().expect("a folder").display();
        Self { sandbox, path: format!("{program}:{}", env::var("PATH").expect("PATH")) }
    }

    fn bash(&self, script: &str) -> Ran {
        let output = Command::new("bash")
            .args(["-euo", "pipefail", "-c", script])
            .current_dir(self.sandbox.path())
            .env("PATH", &self.path)
            .output();
        Ran::of(output.expect("bash"))
    }

    /// Runs what a block holds; of one with a mark that is not among `marks`, commands are only held to be commands of the program.
    fn take(&self, block: &Block, marks: &[&str]) {
        let mark = block.mark.as_deref();
        let to_run = mark.is_none_or(|mark| marks.contains(&mark));
        match block.language.as_str() {
            "sh" | "console" if !to_run => self.take_unrun(block),
            "sh" => {
                let ran = self.bash(&block.lines.join("\n"));
                assert_eq!(ran.code, 0, "{}: {ran:#?}", block.place);
            }
            "console" => {
                for (command, output) in shown(block) {
                    let ran = self.bash(&command);
                    assert_eq!(ran.code, 0, "{}: {command}: {ran:#?}", block.place);
                    let printed = format!("{}{}", ran.stdout, ran.stderr);
                    if let Some(line) = not_printed(&output, &printed) {
                        panic!("{}: {command} does not print\n{line}\nbut\n{printed}", block.place);
                    }
                }
            }
            _ => {
                if let Some(file) = mark {
                    self.sandbox.write(file, block.lines.join("\n") + "\n");
                }
            }
        }
    }

    fn take_unrun(&self, block: &Block) {
        let known = ["build", "slow", "lammps", "slurm"];
        let mark = block.mark.as_deref();
        assert!(mark.is_some_and(|mark| known.contains(&mark)), "{}: {mark:?}", block.place);
        let lines = block.lines.iter().map(|line| line.trim_start_matches("$ "));
        for line in lines.filter(|line| line.starts_with("calibrate ")) {
            let command = line.split(" #").next().unwrap_or_default();
            let ran = self.bash(&format!("{command} --help"));
            assert_eq!(ran.code, 0, "{}: {command}: {ran:#?}", block.place);
        }
    }
}

fn walk(marks: &[&str]) {
    let walk = Walk::new();
    let pages = pages();
    let blocks: Vec<Block> = pages.iter().flat_map(blocks).collect();
    let commands = blocks.iter().filter(|block| ["sh", "console"].contains(&&*block.language));
    assert!(commands.count() >= 15, "the guide has lost its commands");
    blocks.iter().for_each(|block| walk.take(block, marks));
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_guides_commands_run_as_they_stand_and_print_what_it_shows() {
    walk(&[]);
}

/// `cargo test -p calibrate --test e2e the_guides_long_commands -- --ignored`: those of LAMMPS and Slurm where these are installed.
#[test]
#[ignore = "longer: run by .ci/long"]
fn the_guides_long_commands_run_as_they_stand() {
    let is_there = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let mut marks = vec!["slow"];
    let cluster = root().join("tests/slurm/cluster.sh").display().to_string();
    for (mark, there) in
        [("lammps", is_there("lmp", &["-help"])), ("slurm", is_there(&cluster, &["missing"]))]
    {
        if there {
            marks.push(mark);
        } else {
            eprintln!("skipped: {mark} is not installed");
        }
    }
    walk(&marks);
}

#[test]
fn output_that_is_not_printed_would_be_found() {
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let printed = "one\n  two 2.0 s\nthree ...\nfour\n";
    for shown in ["one\n...\nfour", "one\n  two ...", "three ...", ""] {
        assert_eq!(not_printed(&lines(shown), printed), None, "{shown}");
    }
    for (shown, missing) in
        [("two 2.0 s", "two 2.0 s"), ("four\none", "one"), ("five ...", "five ...")]
    {
        assert_eq!(not_printed(&lines(shown), printed), Some(missing), "{shown}");
    }
}

#[test]
fn every_page_and_picture_of_the_guide_is_in_it() {
    let listed: BTreeSet<String> = pages().into_iter().map(|page| page.name).collect();
    let files = fs::read_dir(folder()).expect("the pages");
    let names =
        files.map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"));
    let there: BTreeSet<String> =
        names.filter(|name| name.ends_with(".md") && name != "SUMMARY.md").collect();
    assert_eq!(there, listed);
    let text: String = pages().into_iter().map(|page| page.text).collect();
    for entry in fs::read_dir(folder().join("pictures")).expect("the pictures") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        assert!(text.contains(&format!("](pictures/{name})")), "no page shows {name}");
    }
}

/// What a heading is called in a link.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || "-_ ".contains(*c);
    heading
        .trim()
        .to_lowercase()
        .chars()
        .filter(kept)
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[test]
fn every_link_to_a_heading_of_the_guide_leads_to_one() {
    let pages = pages();
    let anchors = |name: &str| -> Option<BTreeSet<String>> {
        let page = pages.iter().find(|page| page.name == name)?;
        let headings =
            page.text.lines().filter_map(|line| line.trim_start_matches('#').strip_prefix(' '));
        Some(headings.map(anchor).collect())
    };
    let readme = fs::read_to_string(root().join("README.md")).expect("README.md");
    let readme = Page { name: String::new(), text: readme.replace("](crates/guide/pages/", "](") };
    let mut links = 0;
    for page in pages.iter().chain([&readme]) {
        for link in page.text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let Some((file, heading)) = link.split_once('#') else { continue };
            let file = if file.is_empty() { &page.name } else { file };
            if let Some(anchors) = anchors(file) {
                assert!(anchors.contains(heading), "{}: {link}", page.name);
                links += 1;
            }
        }
    }
    assert!(links > 20, "{links} links to headings");
}

#[test]
fn every_formula_on_a_line_of_its_own_is_followed_by_its_source() {
    let mut formulas = 0;
    for page in pages() {
        for (place, after) in page.text.split("$$\n").enumerate().skip(1) {
            // Between an opening and a closing fence, or after a closing one.
            if place % 2 == 0 {
                let next = after.trim_start().lines().next().unwrap_or_default();
                assert!(next.starts_with("Source: "), "{}: a formula before {next:?}", page.name);
                formulas += 1;
            }
        }
    }
    assert!(formulas >= 40, "{formulas} formulas");
}

/// Numbers of a table of GrainLearning's: a column of every row.
fn column(file: &str, place: usize) -> Vec<f64> {
    let text = fs::read_to_string(root().join("experiments/external/grainlearning").join(file));
    let rows = text.expect(file);
    let cells = rows.lines().skip(1).map(|row| row.split_whitespace().nth(place).expect("a cell"));
    cells.map(|cell| cell.parse().expect("a number")).collect()
}

#[test]
fn grainlearnings_answer_in_the_guide_is_that_of_its_files() {
    let weights = column("hyperbola-weights.txt", 0);
    let page = pages().into_iter().find(|page| page.name == "grainlearning.md").expect("the page");
    for (name, place, digits) in [("a", 3, 5), ("b", 4, 4)] {
        let values = column("hyperbola-samples.txt", place);
        let mean = |of: &dyn Fn(f64) -> f64| -> f64 {
            weights.iter().zip(&values).map(|(weight, value)| weight * of(*value)).sum()
        };
        let middle = mean(&|value| value);
        let sd = mean(&|value| (value - middle).powi(2)).sqrt();
        let answer = format!("{middle:.digits$} \u{b1} {sd:.digits$}");
        let row = format!("| {name}, mean \u{b1} sd | {answer} | {answer} |");
        assert!(page.text.contains(&row), "{row}");
    }
}

#[test]
fn the_paper_is_named_by_its_doi_and_the_version_is_that_of_the_program() {
    let citation = fs::read_to_string(root().join("CITATION.cff")).expect("CITATION.cff");
    let field = |name: &str| citation.lines().find_map(|line| line.strip_prefix(name));
    assert_eq!(field("version: "), Some(env!("CARGO_PKG_VERSION")));
    let readme = fs::read_to_string(root().join("README.md")).expect("README.md");
    let named =
        |name: &str| pages().into_iter().any(|page| page.name == name && page.text.contains(DOI));
    assert!(citation.contains(DOI) && readme.contains(DOI));
    assert!(named("introduction.md") && named("theory.md"));
}
