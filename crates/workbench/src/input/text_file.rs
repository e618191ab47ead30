//! Text files of users: bounded in size, UTF-8, with or without a byte order mark. Tables may be in the encodings of
//! spreadsheets too: UTF-16 and Windows-1252.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::files_read;
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
    decode(&path.display().to_string(), bytes_of(path, largest)?)
}

/// Reads a table, in any of the encodings that [`decode_table`] knows, and names the encoding where it is not UTF-8.
///
/// # Errors
///
/// As [`read`], and for what is no text.
pub fn read_table(path: &Path) -> Result<(String, Option<&'static str>), InputError> {
    decode_table(&path.display().to_string(), bytes_of(path, LARGEST_FILE_BYTES)?)
}

fn bytes_of(path: &Path, largest: u64) -> Result<Vec<u8>, InputError> {
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
    files_read::note(path, &bytes);
    Ok(bytes)
}

/// Bytes of a table to text: UTF-8, UTF-16 with a byte order mark (the "Unicode text" of Excel), or else Windows-1252, of
/// which Latin-1 is a part. The encoding is named where it is not UTF-8.
///
/// # Errors
///
/// [`InputError`] for a workbook, or what is no text in these encodings.
pub fn decode_table(
    name: &str,
    bytes: Vec<u8>,
) -> Result<(String, Option<&'static str>), InputError> {
    let no_text = || InputError::new(name, Mistake::NotUtf8).expected("a table as text");
    // A ZIP archive (.xlsx, .ods) and a compound file (.xls).
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(&[0xd0, 0xcf, 0x11, 0xe0]) {
        return Err(no_text()
            .found("a workbook")
            .help("save the sheet as \"CSV UTF-8\" in the spreadsheet, and name that file"));
    }
    let wide = match bytes[..] {
        [0xff, 0xfe, ..] => Some(u16::from_le_bytes as fn([u8; 2]) -> u16),
        [0xfe, 0xff, ..] => Some(u16::from_be_bytes as fn([u8; 2]) -> u16),
        _ => None,
    };
    let (text, encoding) = if let Some(unit) = wide {
        let units = bytes[2..].chunks(2).map(|pair| match pair {
            [a, b] => unit([*a, *b]),
            // Half a unit at the end stands for no character.
            _ => 0xd800,
        });
        let text: Result<String, _> = char::decode_utf16(units).collect();
        let text = text.map_err(|_| no_text().found("broken text in UTF-16"))?;
        (text, Some("UTF-16"))
    } else {
        match String::from_utf8(bytes) {
            Ok(text) => (without_mark(text), None),
            Err(error) => {
                let first = error.utf8_error().valid_up_to();
                let bytes = error.into_bytes();
                let text = bytes.iter().map(|&byte| windows_1252(byte)).collect::<Option<String>>();
                let text = text.ok_or_else(|| not_utf8(name, &bytes, first))?;
                (text, Some("Windows-1252"))
            }
        }
    };
    match text.find('\0') {
        Some(place) => Err(no_text()
            .at_line(1 + text[..place].matches('\n').count())
            .found("a byte 0")
            .help("save it again as \"CSV UTF-8\"")),
        None => Ok((text, encoding)),
    }
}

/// The character of a byte in Windows-1252; none for the five bytes without one.
fn windows_1252(byte: u8) -> Option<char> {
    const FROM_0X80: [char; 32] = [
        '\u{20ac}', '\0', '\u{201a}', '\u{192}', '\u{201e}', '\u{2026}', '\u{2020}', '\u{2021}',
        '\u{2c6}', '\u{2030}', '\u{160}', '\u{2039}', '\u{152}', '\0', '\u{17d}', '\0', '\0',
        '\u{2018}', '\u{2019}', '\u{201c}', '\u{201d}', '\u{2022}', '\u{2013}', '\u{2014}',
        '\u{2dc}', '\u{2122}', '\u{161}', '\u{203a}', '\u{153}', '\0', '\u{17e}', '\u{178}',
    ];
    match byte {
        0x80..=0x9f => Some(FROM_0X80[usize::from(byte - 0x80)]).filter(|c| *c != '\0'),
        // The others are those of Unicode.
        _ => Some(char::from(byte)),
    }
}

/// The mistake of a byte that is not UTF-8.
fn not_utf8(name: &str, bytes: &[u8], valid: usize) -> InputError {
    let line = 1 + bytes[..valid].iter().filter(|&&byte| byte == b'\n').count();
    InputError::new(name, Mistake::NotUtf8)
        .at_line(line)
        .found(format_args!("the byte 0x{:02x}", bytes[valid]))
        .expected("text in UTF-8")
        .help("save it again as UTF-8 (a micro sign or degree sign in another encoding?)")
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
    String::from_utf8(bytes)
        .map(without_mark)
        .map_err(|error| not_utf8(name, error.as_bytes(), error.utf8_error().valid_up_to()))
}

/// A text without its byte order mark.
fn without_mark(mut text: String) -> String {
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    text
}

/// The folder that a file is in.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The name of a file like the missing one, in words for its help.
fn similar_file(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = folder_of(path);
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
    fn tables_are_read_in_the_encodings_of_spreadsheets() {
        let table = "t [min];a (\u{b5}m)\n0,5;1\u{a0}000\n";
        let utf16 = |unit: fn(u16) -> [u8; 2]| -> Vec<u8> {
            std::iter::once(0xfeff).chain(table.encode_utf16()).flat_map(unit).collect()
        };
        let latin1 = table.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin-1")).collect();
        let marked = [b"\xef\xbb\xbf", table.as_bytes()].concat();
        for (bytes, encoding) in [
            (table.as_bytes().to_vec(), None),
            (marked, None),
            (utf16(u16::to_le_bytes), Some("UTF-16")),
            (utf16(u16::to_be_bytes), Some("UTF-16")),
            (latin1, Some("Windows-1252")),
        ] {
            assert_eq!(decode_table("t", bytes), Ok((table.to_owned(), encoding)));
        }
        let euro = decode_table("t", b"\x80 \x96 \xfc".to_vec()).expect("Windows-1252");
        assert_eq!(euro.0, "\u{20ac} \u{2013} \u{fc}");
        for (bytes, says) in [
            (&b"PK\x03\x04..."[..], "save the sheet as \"CSV UTF-8\""),
            (b"\xd0\xcf\x11\xe0....", "a workbook"),
            (b"t\n\x81\n", "line 2: found the byte 0x81"),
            (b"\xff\xfet\0\0", "broken text in UTF-16"),
            (b"t\n0\0\n", "line 2: found a byte 0"),
        ] {
            let error = decode_table("t", bytes.to_vec()).expect_err(says);
            assert_eq!(error.mistake, Mistake::NotUtf8);
            assert!(error.to_string().contains(says), "{error}");
        }
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
