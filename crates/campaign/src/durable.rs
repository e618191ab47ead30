//! Files written whole: a reader sees the old contents or the new ones, also after a crash of the machine.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::time::Duration;

/// Beginning of the name of a file that is being written.
pub(crate) const TEMPORARY: &str = ".campaign-";

/// Age at which a file that is being written counts as left by a process that died.
const STALE: Duration = Duration::from_secs(600);

/// Writes a file whole: beside its place, flushed to disk, renamed, and its folder flushed. What is at `path` and is not
/// a file (a device, a pipe) is written directly.
///
/// # Errors
///
/// The system's error. What was at `path` before is then untouched, except where only the last flush failed.
pub fn write(path: &Path, contents: &[u8]) -> io::Result<()> {
    if is_device(path) {
        return OpenOptions::new().write(true).open(path)?.write_all(contents);
    }
    written_aside(path, contents)?.persist(path).map_err(|error| error.error)?;
    flush_folder(folder_of(path))
}

/// Whether [`write()`] can write to `path`, as far as can be seen without touching what is there.
///
/// # Errors
///
/// The system's error where it cannot.
pub fn check_writable(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if is_device(path) { Ok(()) } else { aside(path).map(drop) }
}

/// Flushes a folder's list of names to disk, so that a file made or renamed in it is found after a crash. Where a system
/// says that it cannot, nothing more can be done, and that is no error.
///
/// # Errors
///
/// The system's error.
pub fn flush_folder(folder: &Path) -> io::Result<()> {
    #[cfg(unix)]
    match File::open(folder)?.sync_all() {
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        other => other,
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        Ok(())
    }
}

/// Flushes every file in a folder and in the folders below it, and the lists of names. With this a folder that was filled
/// by ordinary writes can be renamed into place.
///
/// # Errors
///
/// The system's error.
pub fn flush_tree(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            flush_tree(&entry.path())?;
        } else {
            File::open(entry.path())?.sync_all()?;
        }
    }
    flush_folder(folder)
}

/// Same as [`write()`], but a file that is already there stays: the first to publish wins. Returns whether it was this one.
pub(crate) fn publish(path: &Path, contents: &[u8]) -> io::Result<bool> {
    let file = written_aside(path, contents)?;
    // A hard link never replaces a file, on network file systems too.
    let first = match fs::hard_link(file.path(), path) {
        Ok(()) => true,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => false,
        Err(_) => match file.persist_noclobber(path) {
            Ok(_) => true,
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => false,
            Err(error) => return Err(error.error),
        },
    };
    flush_folder(folder_of(path))?;
    Ok(first)
}

/// Removes files that processes were writing when they died. Best effort: they are hidden and harmless.
pub(crate) fn remove_stale(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let old = entry
            .metadata()
            .and_then(|metadata| metadata.modified())
            .is_ok_and(|modified| modified.elapsed().is_ok_and(|age| age > STALE));
        if old && entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Tells ext4 that the folders in this one have nothing to do with each other. It then keeps their files apart, and does
/// not search for room among those of a thousand folders that were just removed, which takes milliseconds. Best effort.
pub(crate) fn spread(folder: &Path) {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    {
        use rustix::fs::{IFlags, ioctl_getflags, ioctl_setflags};
        if let Ok(file) = File::open(folder)
            && let Ok(flags) = ioctl_getflags(&file)
        {
            let _ = ioctl_setflags(&file, flags | IFlags::TOPDIR);
        }
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    let _ = folder;
}

fn written_aside(path: &Path, contents: &[u8]) -> io::Result<tempfile::NamedTempFile> {
    let mut file = aside(path)?;
    file.write_all(contents)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// An empty hidden file beside the place of another.
fn aside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Like any other file, as the umask says, not private as temporary files are.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// The folder that a file is in.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("table.csv");
        for contents in [&b"old"[..], b"new and longer"] {
            check_writable(&path).expect("writable");
            write(&path, contents).expect("written");
            assert_eq!(fs::read(&path).expect("there"), contents);
        }
        assert!(!publish(&path, b"late").expect("tried"), "the first to publish wins");
        flush_tree(dir.path()).expect("flushed");
        assert_eq!(fs::read(&path).expect("there"), b"new and longer");
        assert_eq!(fs::read_dir(dir.path()).expect("a directory").count(), 1);
    }

    #[test]
    fn a_device_is_written_directly_and_a_folder_is_not_written() {
        let dir = tempfile::tempdir().expect("a directory");
        assert!(check_writable(dir.path()).is_err() && write(dir.path(), b"x").is_err());
        assert!(write(&dir.path().join("no/such/folder"), b"x").is_err());
        let null = Path::new("/dev/null");
        if null.exists() {
            check_writable(null).expect("writable");
            write(null, b"x").expect("written");
            assert!(is_device(null));
        }
    }
}
