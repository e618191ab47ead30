//! Placeholders in a command: `{name}`; `{{` and `}}` stand for braces.

use campaign::template::{Piece, Unbalanced, pieces};

/// Placeholders that every command has, beside the parameters.
pub(crate) const RESERVED: [&str; 4] = ["parameters", "run", "seed", "plan_dir"];

/// Placeholders that every template of an input file has.
pub(crate) const IN_FILES: [&str; 3] = ["parameters", "run", "seed"];

/// Mistake in a template.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum TemplateError {
    /// A brace without its partner.
    Unbalanced,
    /// An unknown placeholder.
    Unknown(String),
}

impl From<Unbalanced> for TemplateError {
    fn from(_: Unbalanced) -> Self {
        Self::Unbalanced
    }
}

/// Checks a template against the names of the parameters.
pub(crate) fn check(template: &str, parameters: &[String]) -> Result<(), TemplateError> {
    for piece in pieces(template)? {
        if let Piece::Name(name) = piece
            && !RESERVED.contains(&name)
            && !parameters.iter().any(|parameter| parameter == name)
        {
            return Err(TemplateError::Unknown(name.to_owned()));
        }
    }
    Ok(())
}

/// The names of all placeholders.
pub(crate) fn names(template: &str) -> Vec<&str> {
    let name = |piece| if let Piece::Name(name) = piece { Some(name) } else { None };
    pieces(template).into_iter().flatten().filter_map(name).collect()
}

/// Replaces `{plan_dir}` and leaves everything else a template.
pub(crate) fn with_folder(template: &str, folder: &str) -> Result<String, TemplateError> {
    let folder = folder.replace('{', "{{").replace('}', "}}");
    let mut text = String::new();
    for piece in pieces(template)? {
        match piece {
            Piece::Text(piece) => text.push_str(piece),
            Piece::Brace(brace) => text.extend([brace, brace]),
            Piece::Name("plan_dir") => text.push_str(&folder),
            Piece::Name(name) => text.extend(["{", name, "}"]),
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_are_checked_and_braces_escaped() {
        let names = ["c1".to_owned(), "tau_s".to_owned()];
        assert_eq!(check("awk 'BEGIN {{ print {c1} }}' {run}", &names), Ok(()));
        assert_eq!(check("{c2}", &names), Err(TemplateError::Unknown("c2".to_owned())));
        assert_eq!(check("{c1", &names), Err(TemplateError::Unbalanced));
        assert_eq!(check("c1}", &names), Err(TemplateError::Unbalanced));
        assert_eq!(check("", &names), Ok(()));
        let text = with_folder("{plan_dir}/run.sh {{x}} {c1}", "/home/a{b}");
        assert_eq!(text.as_deref(), Ok("/home/a{{b}}/run.sh {{x}} {c1}"));
    }
}
