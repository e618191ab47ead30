//! Input files that a plan puts into the folder of each run: `copy`, `link`, `templates`.

use std::path::Path;

use campaign::CommandSpec;
use campaign::inputs::{InputFile, Put, files_below, placeholders};

use super::template;
use crate::error::{InputError, Mistake, nearest};
use crate::input::text_file;
use crate::input::toml_fields::Fields;

/// Reads the lists of input files of a command; `folder` is that of the plan.
pub(super) fn input_files(
    folder: &Path,
    fields: &Fields<'_>,
    parameters: &[String],
) -> Result<Vec<InputFile>, InputError> {
    let mut files = Vec::new();
    for (key, by) in [("copy", Put::Copy), ("link", Put::Link), ("templates", Put::Fill)] {
        let Some(list) = fields.texts(key)? else { continue };
        for from in list.value {
            let refused = |mistake| fields.error(key, list.line, mistake);
            let path = folder.join(from);
            let name = Path::new(from).file_name().and_then(|name| name.to_str());
            let Some(to) = name.filter(|_| !from.contains('\0')) else {
                return Err(refused(Mistake::OutOfRange)
                    .found(format_args!("\"{from}\""))
                    .expected("the name of a file or folder, from the folder of the plan on"));
            };
            files_below(&path).map_err(|(path, error)| {
                refused(Mistake::MissingFile)
                    .found(format_args!("{}: {error}", path.display()))
                    .expected("a file or folder that can be read")
                    .help("names begin at the folder of the plan")
            })?;
            if by == Put::Fill {
                check_template(&path, parameters).map_err(|error| {
                    error.help(format_args!("it is filled in for each run, as {key} says"))
                })?;
            }
            files.push(InputFile { from: from.to_owned(), to: to.to_owned(), by });
        }
    }
    Ok(files)
}

/// Each input file must have a place of its own in the folder of a run.
pub(super) fn check_places(fields: &Fields<'_>, command: &CommandSpec) -> Result<(), InputError> {
    command.check_files().map_err(|error| {
        fields
            .table_error(Mistake::Conflict)
            .found(format_args!("in copy, link or templates: {}", error.problem))
            .help("each goes into the folder of a run under its own name, without the folders before it")
    })
}

/// A template must have placeholders, and only known ones.
fn check_template(path: &Path, parameters: &[String]) -> Result<(), InputError> {
    let text = text_file::read(path)?;
    let found = placeholders(&text);
    let of_file = |mistake| InputError::new(path.display().to_string(), mistake);
    let known = || parameters.iter().map(String::as_str).chain(template::IN_FILES);
    if found.is_empty() {
        return Err(of_file(Mistake::Empty)
            .found("a template without a placeholder")
            .expected(format_args!("{{{{NAME}}}} of {}", known().collect::<Vec<_>>().join(", ")))
            .help("a file that is the same for all runs stands in copy or link"));
    }
    match found.iter().find(|found| !known().any(|known| known == found.name)) {
        None => Ok(()),
        Some(unknown) => Err(of_file(Mistake::UnknownName)
            .at_line(unknown.line)
            .found(format_args!("the placeholder {{{{{}}}}}", unknown.name))
            .expected(format_args!("one of {}", known().collect::<Vec<_>>().join(", ")))
            .help_if(
                nearest(unknown.name, known()).map(|near| format!("did you mean {{{{{near}}}}}?")),
            )),
    }
}

/// Whether a template of a plan in `folder` has a placeholder for a parameter, or for the file with all of them.
pub(super) fn templates_name(folder: &Path, files: &[InputFile], parameter: &str) -> bool {
    files.iter().filter(|file| file.by == Put::Fill).any(|file| {
        let text = text_file::read(&folder.join(&file.from)).unwrap_or_default();
        placeholders(&text).iter().any(|found| [parameter, "parameters"].contains(&found.name))
    })
}
