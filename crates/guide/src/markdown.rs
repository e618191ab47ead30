//! What of a page is code and what is text.

/// A stretch of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Piece<'a> {
    /// A fenced block or a span between backquotes, with its fences.
    Code(&'a str),
    /// Anything else.
    Text(&'a str),
}

/// Splits a page into code and text; together they are the page again.
pub(crate) fn pieces(page: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let mut text_from = 0;
    let mut at = 0;
    while at < page.len() {
        let rest = &page[at..];
        let end = if starts_line(page, at) && rest.trim_start_matches(' ').starts_with("```") {
            at + fenced(rest)
        } else if rest.starts_with('`') {
            at + span(rest)
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
            continue;
        };
        pieces.push(Piece::Text(&page[text_from..at]));
        pieces.push(Piece::Code(&page[at..end]));
        (at, text_from) = (end, end);
    }
    pieces.push(Piece::Text(&page[text_from..]));
    pieces
}

fn starts_line(page: &str, at: usize) -> bool {
    page[..at].ends_with('\n') || at == 0
}

/// Length of a fenced block that begins here, with its last line end; to the end of the page where it is not closed.
fn fenced(rest: &str) -> usize {
    let mut length = 0;
    for (place, line) in rest.split_inclusive('\n').enumerate() {
        length += line.len();
        if place > 0 && line.trim() == "```" {
            break;
        }
    }
    length
}

/// Length of a code span that begins here: up to as many backquotes as it begins with, or these alone where none follow
/// in the paragraph.
fn span(rest: &str) -> usize {
    let ticks = rest.len() - rest.trim_start_matches('`').len();
    let paragraph = rest.split("\n\n").next().unwrap_or_default();
    let mut from = ticks;
    while let Some(found) = paragraph[from..].find('`') {
        let begin = from + found;
        let run = paragraph[begin..].len() - paragraph[begin..].trim_start_matches('`').len();
        from = begin + run;
        if run == ticks {
            return from;
        }
    }
    ticks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_told_from_text_and_nothing_is_lost() {
        let page = "a `b $c$` d\n```sh\n$ e `f`\n```\ng ``h ` i`` j ` k\n\n`l`";
        let pieces = pieces(page);
        let code: Vec<&str> = (pieces.iter())
            .filter_map(|piece| match piece {
                Piece::Code(code) => Some(*code),
                Piece::Text(_) => None,
            })
            .collect();
        assert_eq!(code, ["`b $c$`", "```sh\n$ e `f`\n```\n", "``h ` i``", "`", "`l`"]);
        let whole: String = (pieces.iter())
            .map(|piece| match piece {
                Piece::Code(text) | Piece::Text(text) => *text,
            })
            .collect();
        assert_eq!(whole, page);
    }
}
