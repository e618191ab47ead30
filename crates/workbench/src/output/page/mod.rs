//! `report.html`: one file for a reader who was not there. All kinds of run fill the same sections ([`Page`]); the page is
//! made of them by one template, `report.html` beside this file, and holds all that it shows.

mod picture;

use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;

use super::inputs::{InputFile, Inputs};
use crate::error::RunError;

pub use picture::{Drawn, Picture};

/// Name of the file.
pub const FILE_NAME: &str = "report.html";

/// Most rows of a table that are shown; a longer one is in a file of its own.
pub(crate) const MOST_ROWS: usize = 60;

/// What a run was asked, found and checked, in words: the sections of its report in their order. Those that are empty are left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Page {
    /// Heading.
    pub title: String,
    /// Kind of the run: a calibration, a comparison.
    pub kind: String,
    /// Version of the program that made the results.
    pub version: String,
    /// How far the result is to be trusted; none where there is no such judgement.
    pub verdict: Option<Verdict>,
    /// The summary that the terminal shows.
    pub summary: String,
    /// Reasons to be careful, with what helps.
    pub advice: Vec<String>,
    /// What was asked.
    pub asked: Part,
    /// The data.
    pub data: Part,
    /// The answer.
    pub answer: Part,
    /// The figures.
    pub figures: Vec<Picture>,
    /// Names of the figures for which there was no room.
    pub left_out: Vec<String>,
    /// Data and answer row by row.
    pub rows: Part,
    /// Noise and priors, or the model otherwise.
    pub model: Part,
    /// What was checked.
    pub checked: Part,
    /// How to repeat it.
    pub repeat: Part,
    /// How to cite it.
    pub cite: Part,
}

/// A judgement in a word, and its grounds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Whether it is good.
    pub good: bool,
    /// In a word or two.
    pub word: String,
    /// Its grounds.
    pub why: String,
}

/// Contents of a section.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Part {
    /// Sentences.
    pub paragraphs: Vec<String>,
    /// Names and what is to be said of each.
    pub facts: Vec<Fact>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Commands and files, as they are typed.
    pub listings: Vec<String>,
}

/// A name, and what is to be said of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Fact {
    /// The name.
    pub name: String,
    /// What is said of it.
    pub words: String,
}

/// A table of texts.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Table {
    /// Its caption.
    pub caption: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
}

impl Part {
    /// Adds a sentence.
    pub fn say(&mut self, text: impl Into<String>) {
        self.paragraphs.push(text.into());
    }

    /// Adds a fact.
    pub fn fact(&mut self, name: impl Into<String>, words: impl Into<String>) {
        self.facts.push(Fact { name: name.into(), words: words.into() });
    }

    /// Adds a table, unless it has no rows.
    pub fn table(&mut self, caption: impl Into<String>, columns: &[&str], rows: Vec<Vec<String>>) {
        if !rows.is_empty() {
            let columns = columns.iter().map(|&column| column.to_owned()).collect();
            self.tables.push(Table { caption: caption.into(), columns, rows });
        }
    }
}

impl Page {
    /// Puts figures in, each with its caption, as far as there is room.
    pub fn show(&mut self, drawn: &[Drawn], caption: impl Fn(&str) -> String) {
        (self.figures, self.left_out) = picture::fitted(drawn, caption);
    }

    /// The page as HTML.
    ///
    /// # Errors
    ///
    /// [`RunError`] for a template that does not go with the sections.
    pub fn html(&self) -> Result<String, RunError> {
        const NAME: &str = "report.html";
        let refused = |error: minijinja::Error| {
            RunError::new(format_args!("the report cannot be written: {error:#}"))
        };
        let mut environment = Environment::new();
        environment.set_auto_escape_callback(|_| AutoEscape::Html);
        environment.add_template(NAME, include_str!("report.html")).map_err(refused)?;
        let fixed = |text: &str| Value::from_safe_string(text.trim_end().to_owned());
        let own = context! {
            style => fixed(include_str!("report.css")),
            script => fixed(include_str!("report.js")),
        };
        let template = environment.get_template(NAME).map_err(refused)?;
        let mut html =
            template.render(context! { ..Value::from(Serde(self)), ..own }).map_err(refused)?;
        html.push('\n');
        Ok(html)
    }
}

/// What a repetition must have alike, and how to see that the files are those: version, seed, SHA-256 of inputs and results.
pub(crate) fn provenance(
    part: &mut Part,
    (version, seed): (&str, Option<u64>),
    inputs: Option<&Inputs>,
    sums: &str,
) {
    part.fact("Version", format!("calibrate {version}"));
    if let Some(seed) = seed {
        part.fact(
            "Seed",
            format!("{seed}: the same seed gives the same bits, for any number of threads"),
        );
    }
    let files = inputs.map_or(&[][..], |inputs| &inputs.files);
    let rows = files.iter().map(|file| {
        let InputFile { role, name, bytes, sha256 } = file;
        vec![name.clone(), role.clone(), bytes.to_string(), sha256.clone()]
    });
    part.table("Input files", &["file", "role", "bytes", "SHA-256"], rows.collect());
    if files.is_empty() {
        let none = match inputs {
            Some(_) => "none: all that was read is built into this version",
            None => "not noted: an earlier version began this run",
        };
        part.fact("Input files", none);
    }
    let rows = sums.lines().filter_map(|line| line.split_once("  "));
    let rows = rows.map(|(sum, name)| vec![name.to_owned(), sum.to_owned()]);
    part.table("Results, as in SHA256SUMS", &["file", "SHA-256"], rows.collect());
}

/// How to cite a result of this version.
pub fn citation(version: &str) -> Part {
    let mut part = Part::default();
    part.say(format!(
        "calibrate: a Bayesian calibration workbench for sintering DEM, version {version}."
    ));
    part.say(
        "The model: J.E. Alvarez, H. Snijder, T. Vaneker, H. Cheng, S. Luding, T. Weinhart, Neck growth kinetics during polymer sintering \
         for powder-based processes, EPJ Web of Conferences 249 (2021) 05001, doi:10.1051/epjconf/202124905001.",
    );
    part
}

#[cfg(test)]
mod tests;
