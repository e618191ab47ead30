//! Captured streams of a run: bounded while they are written, shortened for keeps, quoted in messages.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use crate::error::CampaignError;

/// Length of the start and the end of a captured stream that are kept of a failed run \[bytes\].
const KEPT_START: u64 = 64 << 10;
const KEPT_END: u64 = 256 << 10;

/// Length above which the middle of a stream is cut out while it is written \[bytes\].
const LONGEST: u64 = 16 << 20;

/// Length of the end of stderr that goes into the outcome \[bytes\].
const DETAIL_BYTES: u64 = 1000;

/// Room for a stream that is taken before its run begins, so that a run can say that the disk is full \[bytes\].
#[cfg(any(target_os = "linux", target_os = "android"))]
const RESERVE_BYTES: u64 = 4 << 10;

/// Makes the file of a stream. It is written at its end, so that it can be cut while it is written.
pub(crate) fn create(path: &Path) -> Result<File, CampaignError> {
    let failed = |error| CampaignError::io("written", path, error);
    let file = OpenOptions::new().append(true).create_new(true).open(path).map_err(failed)?;
    reserve(&file);
    Ok(file)
}

/// Takes room for a stream.
pub(crate) fn reserve(file: &File) {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    {
        use rustix::fs::{FallocateFlags, fallocate};
        let _ = fallocate(file, FallocateFlags::KEEP_SIZE, 0, RESERVE_BYTES);
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    let _ = file;
}

/// Cuts the middle out of a stream that grew too long while its run goes on. What is written at that very moment may be
/// lost too.
pub(crate) fn bound(path: &Path) {
    let cut = || -> io::Result<()> {
        let length = fs::metadata(path)?.len();
        if length <= LONGEST {
            return Ok(());
        }
        let mut file = OpenOptions::new().read(true).append(true).open(path)?;
        file.seek(SeekFrom::Start(length - KEPT_END))?;
        let mut end = Vec::new();
        (&mut file).take(KEPT_END).read_to_end(&mut end)?;
        file.set_len(KEPT_START)?;
        let left_out = length - KEPT_START - KEPT_END;
        let mut text =
            format!("\n[... {left_out} bytes left out while the run went on ...]\n").into_bytes();
        text.extend_from_slice(&end);
        file.write_all(&text)
    };
    // The run itself will meet what is wrong with the disk.
    let _ = cut();
}

/// The last lines of a captured stream, without control characters.
pub(crate) fn end_of(path: &Path) -> String {
    let read = || -> io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(DETAIL_BYTES)))?;
        let mut bytes = Vec::new();
        file.take(DETAIL_BYTES).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = read().unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == char::REPLACEMENT_CHARACTER);
    text.chars().map(|c| if c.is_control() && c != '\n' { ' ' } else { c }).collect()
}

/// Cuts the middle out of a long captured stream.
pub(crate) fn shorten(path: &Path) -> io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    if length <= KEPT_START + KEPT_END {
        return Ok(());
    }
    let mut text = Vec::new();
    (&mut file).take(KEPT_START).read_to_end(&mut text)?;
    let left_out = length - KEPT_START - KEPT_END;
    writeln!(text, "\n[... {left_out} bytes left out ...]")?;
    file.seek(SeekFrom::Start(length - KEPT_END))?;
    file.take(KEPT_END).read_to_end(&mut text)?;
    let aside = path.with_extension("short");
    fs::write(&aside, text)?;
    fs::rename(aside, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_stream_keeps_its_start_and_its_end() {
        let folder = tempfile::tempdir().expect("a directory");
        let path = folder.path().join("stdout");
        let middle = vec![b'.'; 3 << 20];
        let text = [b"first\n", &middle[..], b"\nlast\n"].concat();
        fs::write(&path, &text).expect("written");
        shorten(&path).expect("shortened");
        let short = fs::read(&path).expect("there");
        assert!(short.starts_with(b"first\n.") && short.ends_with(b".\nlast\n"));
        let left_out = text.len() as u64 - KEPT_START - KEPT_END;
        let note = format!("\n[... {left_out} bytes left out ...]\n");
        assert_eq!(short.len() as u64, KEPT_START + KEPT_END + note.len() as u64);
        assert!(String::from_utf8(short).expect("text").contains(&note));
    }

    #[test]
    fn a_stream_that_grows_without_end_stays_short_while_it_is_written() {
        let folder = tempfile::tempdir().expect("a directory");
        let path = folder.path().join("stdout");
        let mut writer = create(&path).expect("made");
        let block = vec![b'y'; 1 << 20];
        writer.write_all(b"first line\n").expect("written");
        let mut longest = 0;
        for _ in 0..200 {
            writer.write_all(&block).expect("written");
            bound(&path);
            longest = longest.max(fs::metadata(&path).expect("there").len());
        }
        writer.write_all(b"\nlast line\n").expect("written");
        bound(&path);
        assert!(longest <= LONGEST + (1 << 20), "{longest}");
        let text = fs::read(&path).expect("there");
        assert!(text.starts_with(b"first line\n") && text.ends_with(b"\nlast line\n"));
        let text = String::from_utf8(text).expect("text");
        assert!(text.contains("bytes left out while the run went on ...]"));
    }
}
