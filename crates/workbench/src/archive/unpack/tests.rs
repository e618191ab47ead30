use std::io::{Cursor, Write as _};
use std::path::PathBuf;

use proptest::prelude::*;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;

/// A folder with an archive in it, beside the folder that it is unpacked to.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("run.zip"), bytes).expect("written");
        fs::create_dir(folder.path().join("out")).expect("a folder");
        Self { folder }
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn unpack(&self, limits: &Limits) -> Result<Unpacked, Failure> {
        let unpacked = unpack(&self.folder.path().join("run.zip"), &self.out(), limits);
        // Whatever it was, nothing is outside.
        let mut names: Vec<_> = fs::read_dir(self.folder.path())
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["out", "run.zip"]);
        unpacked
    }
}

fn options() -> SimpleFileOptions {
    SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)
}

/// An archive of these files, with a description that lists `listed`.
fn archive(files: &[(&str, &[u8])], listed: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let part = |(name, _): &(&str, &[u8])| serde_json::json!({ "@id": name });
    let file = |(name, bytes): &(&str, &[u8])| {
        let sum = hex(&Sha256::digest(bytes));
        serde_json::json!({ "@id": name, "name": name, "sha256": sum })
    };
    let parts: Vec<_> = listed.iter().map(part).collect();
    let mut graph = vec![serde_json::json!({ "@id": "./", "hasPart": parts })];
    graph.extend(listed.iter().map(file));
    zip.start_file(DESCRIPTION, options()).expect("begun");
    let description = serde_json::json!({ "@graph": graph }).to_string();
    zip.write_all(description.as_bytes()).expect("written");
    for (name, bytes) in files {
        zip.start_file(*name, options()).expect("begun");
        zip.write_all(bytes).expect("written");
    }
    zip.finish().expect("finished").into_inner()
}

const GOOD: [(&str, &[u8]); 2] =
    [("results/posterior.json", b"{\"a\": 1}"), ("inputs/sub/table.csv", b"1,2\n3,4\n")];

fn refused(bytes: &[u8], words: &str) {
    let place = Place::new(bytes);
    let error = place.unpack(&Limits::default()).expect_err(words);
    assert!(matches!(error, Failure::Input(_)), "{error:?}");
    assert!(error.to_string().contains(words), "{words} is not in {error}");
    assert!(error.to_string().contains("help: "), "{error}");
}

#[test]
fn an_archive_is_unpacked_to_what_was_packed() {
    let place = Place::new(&archive(&GOOD, &GOOD));
    let unpacked = place.unpack(&Limits::default()).expect("unpacked");
    assert_eq!(unpacked.sums.len(), 3);
    for (name, bytes) in GOOD {
        assert_eq!(fs::read(place.out().join(name)).expect(name), bytes);
    }
}

#[test]
fn names_that_lead_elsewhere_are_refused() {
    for (name, words) in [
        ("../evil", "leads out of its folder"),
        ("results/../../evil", "leads out of its folder"),
        ("/etc/evil", "begins at the root"),
        ("results\\..\\evil", "a backslash"),
        ("C:/evil", "a colon, as of a drive"),
        ("results//evil", "an empty, dotted or overlong part"),
        ("results/./evil", "an empty, dotted or overlong part"),
        ("results/evil.", "a dot or a blank at its end"),
        ("results/a\nb", "control characters"),
        ("elsewhere/evil", "neither a result nor an input"),
    ] {
        let files = [GOOD[0], (name, b"x".as_slice())];
        refused(&archive(&files, &files), words);
    }
}

#[test]
fn links_and_devices_are_refused() {
    for mode in [0o120_777, 0o010_644, 0o060_644] {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let name = "results/posterior.json";
        match mode {
            0o120_777 => zip.add_symlink(name, "/etc/passwd", options()).expect("a link"),
            _ => {
                zip.start_file(name, options().external_attributes(mode << 16)).expect("begun");
                zip.write_all(b"x").expect("written");
            }
        }
        refused(&zip.finish().expect("finished").into_inner(), "a link or a device");
    }
}

/// An entry is written under another name of the same length, and renamed in the bytes.
#[test]
fn two_files_of_one_name_are_refused() {
    for other in ["results/B", "results/a"] {
        let files = [("results/A", b"1".as_slice()), ("results/B", b"2".as_slice())];
        let mut bytes = archive(&files, &files);
        let (from, to) =
            (b"results/B", if other == "results/B" { b"results/A" } else { b"results/a" });
        for at in 0..bytes.len() - from.len() {
            if bytes[at..].starts_with(from) {
                bytes[at..at + from.len()].copy_from_slice(to);
            }
        }
        refused(&bytes, "two files of the same name");
    }
}

#[test]
fn a_name_that_is_both_a_file_and_a_folder_is_refused() {
    for (one, other) in [("results/a", "results/a/b"), ("results/a/b", "results/A")] {
        let files = [(one, b"1".as_slice()), (other, b"2".as_slice())];
        refused(&archive(&files, &files), "a name that is both a file and a folder");
    }
}

#[test]
fn bombs_are_refused_while_they_unfold() {
    let zeros = vec![0; 8 << 20];
    let bomb = [("results/zeros", zeros.as_slice())];
    refused(&archive(&bomb, &bomb), "unpacks to more than");
    let small = Limits { unpacked: 15, ..Limits::default() };
    let place = Place::new(&archive(&GOOD, &GOOD));
    let error = place.unpack(&small).expect_err("too much").to_string();
    assert!(error.contains("unpacks to more than 15 bytes"), "{error}");
    // Each file alone may be as large as it is; all together are too much for so small an archive.
    let one = vec![0; 1 << 20];
    let names: Vec<String> = (0..6).map(|number| format!("results/{number}")).collect();
    let many: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &one[..])).collect();
    let bytes = archive(&many, &many);
    let limits = Limits { small: 4 << 20, ..Limits::default() };
    assert!((bytes.len() as u64) < (4 << 20) / limits.total_ratio);
    let error = Place::new(&bytes).unpack(&limits).expect_err("too much").to_string();
    assert!(error.contains("\"results/3\", which unpacks to more than 1047"), "{error}");
    assert!(Place::new(&bytes).unpack(&Limits::default()).is_ok(), "six MiB are little");
    for (limits, words) in [
        (Limits { files: 2, ..Limits::default() }, "too many files (the limit is 2)"),
        (Limits { packed: 100, ..Limits::default() }, "too large (the limit is 100)"),
    ] {
        let error = place.unpack(&limits).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn what_is_listed_and_what_is_there_must_be_the_same() {
    let other = [("results/posterior.json", b"{}".as_slice()), GOOD[1]];
    refused(&archive(&GOOD, &other), "is not what its SHA-256 says");
    refused(&archive(&GOOD[..1], &GOOD), "is listed and not there");
    refused(&archive(&GOOD, &GOOD[..1]), "does not list");
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("results/a", options()).expect("begun");
    refused(&zip.finish().expect("finished").into_inner(), "that lists its files");
    refused(b"", "no archive");
    refused(b"not a zip at all", "no archive");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Bytes that change and ends that are cut: an error, or the same contents; never a panic, and nothing outside.
    #[test]
    fn damage_is_an_error_or_changes_nothing(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 1..=255u8), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = archive(&GOOD, &GOOD);
        for (at, mask) in &flips {
            let at = at.index(bytes.len());
            bytes[at] ^= mask;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let place = Place::new(&bytes);
        match place.unpack(&Limits::default()) {
            Err(error) => prop_assert!(matches!(error, Failure::Input(_)), "{error:?}"),
            Ok(_) => {
                for (name, bytes) in GOOD {
                    prop_assert_eq!(fs::read(place.out().join(name)).expect(name), bytes);
                }
            }
        }
    }
}
