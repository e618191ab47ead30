//! Formulas of a page as MathML.
//!
//! `$..$` within a line and `$$..$$` on lines of their own hold LaTeX, as on a forge. They are converted before Markdown sees the page, which would take
//! `_` and `*` for emphasis and a backslash for an escape; and what stands in the MathML is written so that Markdown leaves it alone.

use std::fmt;

use pulldown_latex::config::DisplayMode;
use pulldown_latex::{Event, Parser, RenderConfig, Storage, push_mathml};

use crate::markdown::{Piece, pieces};

/// A formula that cannot be converted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FormulaError {
    /// Line of the page where the formula begins.
    pub line: usize,
    /// The formula, or the text after a `$` that is not closed.
    pub formula: String,
    /// What is wrong.
    pub reason: String,
}

impl fmt::Display for FormulaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: `{}`: {}", self.line, self.formula, self.reason)
    }
}

impl std::error::Error for FormulaError {}

/// The page with its formulas as MathML; code stays as it is, and so does `\$`.
///
/// # Errors
///
/// Where LaTeX is not understood, or a `$` is not closed in its paragraph.
pub fn to_mathml(page: &str) -> Result<String, FormulaError> {
    let mut out = String::with_capacity(2 * page.len());
    let mut line = 1;
    for piece in pieces(page) {
        match piece {
            Piece::Code(code) => {
                out.push_str(code);
                line += code.matches('\n').count();
            }
            Piece::Text(text) => {
                text_to_mathml(text, line, &mut out)?;
                line += text.matches('\n').count();
            }
        }
    }
    Ok(out)
}

fn text_to_mathml(text: &str, first_line: usize, out: &mut String) -> Result<(), FormulaError> {
    let mut rest = text;
    while let Some(begin) = dollar(rest) {
        let line = first_line + text[..text.len() - rest.len() + begin].matches('\n').count();
        out.push_str(&rest[..begin]);
        rest = &rest[begin..];
        let fence = if rest.starts_with("$$") { "$$" } else { "$" };
        let inner = &rest[fence.len()..];
        let paragraph = inner.split("\n\n").next().unwrap_or_default();
        let Some(end) = paragraph.find(fence) else {
            let formula = paragraph.lines().next().unwrap_or_default().to_owned();
            let reason = format!("no {fence} closes it (write \\$ for the sign)");
            return Err(FormulaError { line, formula, reason });
        };
        let latex = inner[..end].trim();
        let wrong = |reason| FormulaError { line, formula: latex.to_owned(), reason };
        if fence == "$$" {
            let math = mathml(latex, DisplayMode::Block).map_err(wrong)?;
            out.push_str(&format!("<div class=\"formula\">{math}</div>\n"));
        } else {
            out.push_str(&for_markdown(&mathml(latex, DisplayMode::Inline).map_err(wrong)?));
        }
        rest = &inner[end + fence.len()..];
    }
    out.push_str(rest);
    Ok(())
}

/// Place of the next dollar sign that no backslash stands before.
fn dollar(text: &str) -> Option<usize> {
    text.match_indices('$').map(|(at, _)| at).find(|at| !text[..*at].ends_with('\\'))
}

/// MathML of a formula, in one line.
fn mathml(latex: &str, display_mode: DisplayMode) -> Result<String, String> {
    let storage = Storage::new();
    let events: Vec<Event<'_>> = Parser::new(latex, &storage)
        .collect::<Result<_, _>>()
        .map_err(|error| error.to_string().replace('\n', " "))?;
    let config = RenderConfig { display_mode, ..RenderConfig::default() };
    let mut math = String::new();
    let events = events.into_iter().map(Ok::<_, std::io::Error>);
    push_mathml(&mut math, events, config).map_err(|error| error.to_string())?;
    // A space of LaTeX comes as text that has been escaped once too often.
    Ok(math.replace('\n', " ").replace("&amp;nbsp;", "\u{a0}"))
}

/// MathML with the signs that Markdown would read, outside tags, as entities.
fn for_markdown(math: &str) -> String {
    let mut out = String::with_capacity(math.len());
    let mut in_tag = false;
    for c in math.chars() {
        in_tag = (in_tag || c == '<') && c != '>';
        match c {
            '*' | '_' | '\\' | '[' | ']' | '`' | '~' | '|' | '!' if !in_tag => {
                out.push_str(&format!("&#{};", u32::from(c)));
            }
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(page: &str) -> String {
        to_mathml(page).expect("formulas")
    }

    #[test]
    fn indices_roots_and_fractions_become_elements_and_no_latex_is_left() {
        let page = of("with $\\tau_s = \\frac{\\eta R}{\\gamma}$ and $[a_1, a_2]$.");
        assert!(page.starts_with("with <math ") && page.ends_with("</math>."), "{page}");
        for element in ["<msub><mi>τ</mi><mi>s</mi></msub>", "<mfrac>", "&#91;"] {
            assert!(page.contains(element), "{element} is not in {page}");
        }
        assert!(!page.contains(['\\', '$', '[', '_']), "{page}");
    }

    #[test]
    fn a_formula_on_lines_of_its_own_is_a_block_that_markdown_does_not_read() {
        let page = of("Before.\n\n$$\n\\sqrt{x_0}\n= a*b*c\n$$\nAfter.");
        let (_, block) = page.split_once("Before.\n\n").expect("the text before");
        assert!(block.starts_with("<div class=\"formula\"><math display=\"block\">"), "{block}");
        let (block, after) = block.split_once('\n').expect("a line of its own");
        assert!(block.ends_with("</math></div>") && after.trim() == "After.", "{page}");
    }

    #[test]
    fn a_space_of_latex_is_a_space() {
        assert!(of("$a,\\ b$").contains('\u{a0}') && !of("$a,\\ b$").contains("nbsp"));
    }

    #[test]
    fn dollars_in_code_and_escaped_ones_are_no_formulas() {
        let page = "`${k}` costs \\$3\n\n```console\n$ calibrate --help\n```\n";
        assert_eq!(of(page), page);
    }

    #[test]
    fn what_is_not_latex_is_refused_with_its_line() {
        let error = to_mathml("a\n\n`$x`\nb $\\frac{1$ c").expect_err("a brace is open");
        assert_eq!((error.line, error.formula.as_str()), (4, "\\frac{1"));
        let error = to_mathml("a $b\n\nc$").expect_err("not closed in its paragraph");
        assert!(error.to_string().starts_with("line 1: `b`: no $ closes it"), "{error}");
    }
}
