//! Text files of users: bounded in size, UTF-8, with or without a byte order mark.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{InputError, Mistake};

/// Largest file that is read \[bytes\]; a table of a million rows is a third of it.
pub const LARGEST_FILE_BYTES: u64 = 64 << 20;

/// Reads a file.
///
/// # Errors
///
/// [`InputError`] for a file that is missing, unreadable, a directory, too large or not UTF-8.
pub fn read(path: &Path) -> Result<String, InputError> {
    read_up_to(path, LARGEST_FILE_BYTES)
}

/// As [`read`], with another limit \[bytes\].
pub fn read_up_to(path: &Path, largest: u64) -> Result<String, InputError> {
    let name = path.display().to_string();
    let unreadable = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => InputError::new(&name, Mistake::MissingFile)
            .found("no such file")
            .help_if(similar_file(path)),
        std::io::ErrorKind::IsADirectory => {
            InputError::new(&name, Mistake::Unreadable).found("a directory").expected("a file")
        }
        _ => InputError::new(&name, Mistake::Unreadable)
            .found(format_args!("cannot be read: {error}"))
            .help("check its permissions"),
    };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(largest + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() as u64 > largest {
        return Err(InputError::new(&name, Mistake::TooLarge)
            .found(format_args!("more than {} MiB", largest >> 20))
            .expected("an observation table or a description")
            .help("keep every n-th row: neck growth needs hundreds of points, not millions"));
    }
    decode(&name, bytes)
}

/// Bytes to text, without the byte order mark that spreadsheets put in front.
///
/// # Errors
///
/// [`InputError`] with the line of the first byte that is not UTF-8.
pub fn decode(name: &str, bytes: Vec<u8>) -> Result<String, InputError> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(InputError::new(name, Mistake::NotUtf8)
            .found("text in UTF-16")
            .expected("UTF-8")
            .help("save it again as \"CSV UTF-8\" or plain text in UTF-8"));
    }
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let line = 1 + bytes[..valid].iter().filter(|&&byte| byte == b'\n').count();
        InputError::new(name, Mistake::NotUtf8)
            .at_line(line)
            .found(format_args!("the byte 0x{:02x}", bytes[valid]))
            .expected("text in UTF-8")
            .help("save it again as UTF-8 (a micro sign or degree sign in another encoding?)")
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// The name of a file like the missing one, in words for its help.
fn similar_file(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Some(format!("the folder {} does not exist either", folder.display()));
    };
    let names: Vec<String> = entries
        .take(10_000)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    let near = crate::error::nearest(wanted, names.iter().map(String::as_str))?;
    Some(format!("did you mean {}?", path.with_file_name(near).display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_order_mark_is_dropped_and_utf16_and_latin1_are_named() {
        assert_eq!(decode("f", b"\xef\xbb\xbfa".to_vec()), Ok("a".to_owned()));
        let utf16 = decode("f", b"\xff\xfea\0".to_vec()).expect_err("UTF-16");
        assert_eq!(utf16.mistake, Mistake::NotUtf8);
        let latin1 = decode("f", b"# 30\n# \xb5m\n".to_vec()).expect_err("Latin-1");
        assert_eq!((latin1.mistake, latin1.line), (Mistake::NotUtf8, Some(2)));
    }

    #[test]
    fn a_missing_file_offers_its_neighbour() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("powder.csv"), "").expect("written");
        let error = read(&folder.path().join("powdr.csv")).expect_err("missing");
        assert_eq!(error.mistake, Mistake::MissingFile);
        assert!(error.to_string().contains("powder.csv?"), "{error}");
        let directory = read(folder.path()).expect_err("directory");
        assert_eq!(directory.mistake, Mistake::Unreadable);
    }

    #[test]
    fn a_file_without_end_is_refused_not_read() {
        let error = read(Path::new("/dev/zero"));
        if Path::new("/dev/zero").exists() {
            assert_eq!(error.expect_err("endless").mistake, Mistake::TooLarge);
        }
    }
}
