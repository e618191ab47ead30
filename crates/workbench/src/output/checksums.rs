//! `SHA256SUMS` beside the files of a run: a file that is read again is compared with what was written.
//!
//! The format is that of `sha256sum`, so that `sha256sum -c SHA256SUMS` checks a folder without this program.

use std::fmt::Write as _;
use std::path::Path;

use sha2::{Digest as _, Sha256};

use crate::error::{InputError, Mistake, RunError};
use crate::input::text_file;
use crate::output::WriteFile;

/// Name of the file.
pub(crate) const FILE_NAME: &str = "SHA256SUMS";

/// Largest file of a run that is read again \[bytes\]: some millions of samples.
const LARGEST_BYTES: u64 = 2 << 30;

/// Writes files that are read again, and their sums, which it gives.
pub(crate) fn write_all(
    files: &[(&str, String)],
    write: &WriteFile<'_>,
) -> Result<String, RunError> {
    let mut sums = String::new();
    for (name, text) in files {
        write(name, text.as_bytes())?;
        let _ = writeln!(sums, "{}  {name}", sum(text));
    }
    write(FILE_NAME, sums.as_bytes())?;
    Ok(sums)
}

/// Reads a file of a run by `parse` (given its name and text), and compares it with the `SHA256SUMS` beside it, where
/// that lists it.
pub(crate) fn read_as<T>(
    path: &Path,
    parse: impl FnOnce(&str, &str) -> Result<T, InputError>,
) -> Result<T, InputError> {
    let text = text_file::read_up_to(path, LARGEST_BYTES)?;
    let name = path.display().to_string();
    let parsed = parse(&name, &text)?;
    let sums = path.with_file_name(FILE_NAME);
    if !sums.exists() {
        return Ok(parsed);
    }
    let listed = text_file::read(&sums)?;
    let own = path.file_name().and_then(|name| name.to_str());
    let wanted =
        listed.lines().filter_map(|line| line.split_once("  ")).find(|line| Some(line.1) == own);
    match wanted {
        Some((wanted, _)) if wanted != sum(&text) => Err(InputError::new(name, Mistake::Damaged)
            .found(format_args!("contents that are not those listed in {}", sums.display()))
            .help(
                "the file was damaged or edited: run the calibration again or copy the folder again; \
                 to read it as it is, remove its line from SHA256SUMS",
            )),
        _ => Ok(parsed),
    }
}

/// Sum of a file of a run.
pub(crate) fn of_file(path: &Path) -> Result<String, InputError> {
    Ok(sum(&text_file::read_up_to(path, LARGEST_BYTES)?))
}

fn sum(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let mut hex = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        let _ = write!(hex, "{byte:02x}");
    }
    hex
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NIST FIPS 180-4, example "abc".
    #[test]
    fn the_sum_is_sha_256() {
        assert_eq!(sum("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}
