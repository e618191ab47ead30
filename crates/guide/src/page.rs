//! A page of the guide as mdBook gets it.

use std::path::{Component, Path, PathBuf};

use crate::formula::{self, FormulaError};
use crate::markdown::{Piece, pieces};

/// A page for the book, and the pictures that it takes along.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Page {
    /// Its text.
    pub text: String,
    /// Pictures from outside the pages, by their paths from the top of the project; the text has them in `pictures/`.
    pub pictures: Vec<PathBuf>,
}

/// Writes formulas as MathML, pictures from outside `pages` as files of the book, and links to other files of the project as their paths: the
/// book may lie anywhere.
///
/// # Errors
///
/// Where a formula is not understood.
pub fn for_the_book(text: &str, pages: &Path) -> Result<Page, FormulaError> {
    let mut pictures = Vec::new();
    let text = formula::to_mathml(text)?;
    let text = pieces(&text)
        .into_iter()
        .map(|piece| match piece {
            Piece::Code(code) => code.to_owned(),
            Piece::Text(text) => links(text, pages, &mut pictures),
        })
        .collect();
    Ok(Page { text, pictures })
}

/// A link or picture of Markdown, `[name](target)`, in a text.
struct Link<'a> {
    before: &'a str,
    name: &'a str,
    target: &'a str,
    after: &'a str,
}

fn next_link(text: &str) -> Option<Link<'_>> {
    let middle = text.find("](")?;
    let begin = text[..middle].rfind('[')?;
    let end = middle + text[middle..].find(')')?;
    Some(Link {
        before: &text[..begin],
        name: &text[begin + 1..middle],
        target: &text[middle + 2..end],
        after: &text[end + 1..],
    })
}

fn links(text: &str, pages: &Path, pictures: &mut Vec<PathBuf>) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(Link { before, name, target, after }) = next_link(rest) {
        let path = target.split('#').next().unwrap_or_default();
        let outside = path.starts_with("../").then(|| normal(&pages.join(path)));
        match (outside, before.strip_suffix('!')) {
            (None, _) => out.push_str(&rest[..rest.len() - after.len()]),
            (Some(picture), Some(before)) => {
                let own = picture_name(&picture);
                out.push_str(&format!("{before}![{name}](pictures/{own})"));
                pictures.push(picture);
            }
            (Some(file), None) => {
                let file = file.display().to_string();
                // Its path is said once.
                let named = file.ends_with(name) || file.starts_with(name);
                let link = if named { format!("`{file}`") } else { format!("{name} (`{file}`)") };
                out.push_str(before);
                out.push_str(&link);
            }
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

/// Name of a picture from elsewhere in the book: its path, in one word.
#[must_use]
pub fn picture_name(picture: &Path) -> String {
    let parts: Vec<_> = picture.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("-")
}

/// A path without `..` after a folder.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if out.file_name().is_some() => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_out_of_the_book_become_paths_and_pictures_go_along() {
        let text = "see [a page](model.md#knee), [a file](../../../priors/ps.toml#x), [ps.toml](../../../priors/ps.toml), `[c](../d)`,\n\
                    ![fit](../../../results/table3/figure4.svg) and [web](https://x.org/y).";
        let page = for_the_book(text, Path::new("crates/guide/pages")).expect("a page");
        assert_eq!(
            page.text,
            "see [a page](model.md#knee), a file (`priors/ps.toml`), `priors/ps.toml`, `[c](../d)`,\n\
             ![fit](pictures/results-table3-figure4.svg) and [web](https://x.org/y)."
        );
        assert_eq!(page.pictures, [Path::new("results/table3/figure4.svg")]);
    }
}
