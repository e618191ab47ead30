//! A single file of results.

use std::io;
use std::path::Path;

use campaign::durable;

use crate::error::{InputError, Mistake, RunError};

/// Checks that a file can be written, without touching it.
pub fn check_file(path: &Path) -> Result<(), InputError> {
    if path.is_dir() {
        return Err(InputError::new(path.display().to_string(), Mistake::Unwritable)
            .found("a folder")
            .expected("a file")
            .help("choose another name with --out"));
    }
    durable::check_writable(path).map_err(|error| unwritable(path, &error))
}

/// Writes a file whole, as [`durable::write`] does; a device or pipe is written directly.
///
/// # Errors
///
/// [`RunError`] that names it; what was there before is then untouched.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), RunError> {
    durable::write(path, contents).map_err(|error| {
        RunError::new(format_args!("{}: cannot be written: {}", path.display(), plain(&error)))
    })
}

/// The system's words without its number.
pub(super) fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    let end = text.find(" (os error").unwrap_or(text.len());
    let mut text = text[..end].to_owned();
    text[..1].make_ascii_lowercase();
    // The part that names a temporary file is noise.
    match text.find(" at path ") {
        Some(place) => text[..place].to_owned(),
        None => text,
    }
}

pub(super) fn unwritable(path: &Path, error: &io::Error) -> InputError {
    InputError::new(path.display().to_string(), Mistake::Unwritable)
        .found(format_args!("cannot be written: {}", plain(error)))
        .help("choose another place with --out, or make this one writable")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_is_written_whole_and_over_an_old_one() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("x.csv");
        check_file(&file).expect("can be written");
        let files = || fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(files(), 0, "checking writes nothing");
        write_file(&file, b"old").expect("written");
        write_file(&file, b"new").expect("written");
        assert_eq!(fs::read(&file).expect("read"), b"new");
        assert_eq!(files(), 1, "nothing is left beside it");
    }
}
