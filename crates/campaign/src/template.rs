//! Placeholders in command lines: `{c1}`, `{parameters}`, `{run}`, `{seed}`, `{{` and `}}`.

/// Placeholders other than the parameters.
pub(crate) const RESERVED: [&str; 3] = ["parameters", "run", "seed"];

/// A piece of a text with placeholders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Piece<'t> {
    /// Plain text.
    Text(&'t str),
    /// A brace, written twice.
    Brace(char),
    /// The name between single braces.
    Name(&'t str),
}

/// A brace without its partner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unbalanced(pub char);

/// Splits a text at its placeholders.
///
/// # Errors
///
/// [`Unbalanced`] for a brace without its partner.
pub fn pieces(text: &str) -> Result<Vec<Piece<'_>>, Unbalanced> {
    let mut pieces = Vec::new();
    let mut rest = text;
    while let Some(place) = rest.find(['{', '}']) {
        let brace = if rest[place..].starts_with('{') { '{' } else { '}' };
        pieces.push(Piece::Text(&rest[..place]));
        let after = &rest[place + 1..];
        if after.starts_with(brace) {
            pieces.push(Piece::Brace(brace));
            rest = &after[1..];
        } else if brace == '{' {
            let end = after.find(['{', '}']).filter(|&end| after[end..].starts_with('}'));
            let end = end.ok_or(Unbalanced('{'))?;
            pieces.push(Piece::Name(&after[..end]));
            rest = &after[end + 1..];
        } else {
            return Err(Unbalanced('}'));
        }
    }
    pieces.push(Piece::Text(rest));
    Ok(pieces)
}

/// Checks that every placeholder of `text` is known.
pub(crate) fn check(text: &str, parameters: &[String]) -> Result<(), String> {
    let pieces = pieces(text).map_err(|Unbalanced(brace)| {
        let partner = if brace == '{' { '}' } else { '{' };
        format!("{text:?} has a {brace} without its {partner}; write {brace}{brace} for a brace")
    })?;
    for piece in pieces {
        if let Piece::Name(name) = piece
            && !RESERVED.contains(&name)
            && !parameters.iter().any(|known| known == name)
        {
            let known: Vec<&str> = parameters.iter().map(String::as_str).chain(RESERVED).collect();
            return Err(format!(
                "{{{name}}} is not a placeholder; there are {{{}}}, and {{{{ }}}} for braces",
                known.join("}, {")
            ));
        }
    }
    Ok(())
}

/// The first placeholder of `text`, if there is one.
pub(crate) fn first_name(text: &str) -> Option<&str> {
    pieces(text).ok()?.into_iter().find_map(|piece| match piece {
        Piece::Name(name) => Some(name),
        Piece::Text(_) | Piece::Brace(_) => None,
    })
}

/// Replaces the placeholders by their values; unknown ones, which [`check`] refuses, stay.
pub(crate) fn fill(text: &str, value: impl Fn(&str) -> Option<String>) -> String {
    let Ok(pieces) = pieces(text) else { return text.to_owned() };
    let mut filled = String::with_capacity(text.len());
    for piece in pieces {
        match piece {
            Piece::Text(text) => filled.push_str(text),
            Piece::Brace(brace) => filled.push(brace),
            Piece::Name(name) => match value(name) {
                Some(value) => filled.push_str(&value),
                None => filled.extend(["{", name, "}"]),
            },
        }
    }
    filled
}

/// The shortest decimal that reads back as the same number, with an exponent where it is short.
pub(crate) fn number(value: f64) -> String {
    let plain = value.to_string();
    let exponent = format!("{value:e}");
    if plain.len() <= exponent.len() + 3 { plain } else { exponent }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(name: &str) -> Option<String> {
        match name {
            "c1" => Some("0.5".into()),
            "run" => Some("7".into()),
            _ => None,
        }
    }

    #[test]
    fn placeholders_are_filled_and_double_braces_are_braces() {
        assert_eq!(fill("x={c1},{run}", value), "x=0.5,7");
        assert_eq!(fill("{{c1}} ${{{c1}}}", value), "{c1} ${0.5}");
        assert_eq!(fill("µ{c1}µ", value), "µ0.5µ");
        assert_eq!(fill("", value), "");
    }

    #[test]
    fn unknown_and_broken_placeholders_are_named() {
        let names = ["c1".to_owned()];
        assert_eq!(check("{c1}{seed}{parameters}{{}}", &names), Ok(()));
        let unknown = check("a {c2}", &names).expect_err("unknown");
        assert!(unknown.contains("{c2}") && unknown.contains("{c1}, {parameters}"), "{unknown}");
        for broken in ["{c1", "c1}", "{{c1}", "{c{1}}", "{", "}"] {
            assert!(check(broken, &names).is_err(), "{broken}");
        }
    }

    #[test]
    fn numbers_read_back_as_the_same_bits() {
        for x in [0.0, -0.0, 0.1, 1e-300, -2.5e17, 1.0, 123_456.789, 5e-324, f64::MAX, 1e6] {
            let text = number(x);
            assert_eq!(text.parse::<f64>().expect("a number").to_bits(), x.to_bits(), "{text}");
            assert!(text.len() < 26, "{text}");
        }
        assert_eq!(number(1e-9), "1e-9");
        assert_eq!(number(0.001), "0.001");
        assert_eq!(number(3.0), "3");
    }
}
