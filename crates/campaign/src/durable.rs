//! Writing so that it survives: aside, flushed, put in place, and the directory flushed.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use crate::error::{CampaignError, Damage};

/// Largest file that is read \[bytes\].
const LARGEST_BYTES: u64 = 1 << 30;

/// Writes a file whole: aside, flushed, renamed, and the directory flushed.
pub(crate) fn write(path: &Path, contents: &[u8]) -> Result<(), CampaignError> {
    let failed = |error| CampaignError::io("written", path, error);
    let file = aside(path, contents).map_err(failed)?;
    file.persist(path).map_err(|error| failed(error.error))?;
    flush_folder(folder_of(path)).map_err(failed)
}

/// As [`write`], but what is there already stays: the first to publish wins. Says whether it was
/// this one.
pub(crate) fn publish(path: &Path, contents: &[u8]) -> Result<bool, CampaignError> {
    let failed = |error| CampaignError::io("written", path, error);
    let file = aside(path, contents).map_err(failed)?;
    // A hard link never replaces a file, on network file systems too.
    let first = match fs::hard_link(file.path(), path) {
        Ok(()) => true,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => false,
        Err(_) => match file.persist_noclobber(path) {
            Ok(_) => true,
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => false,
            Err(error) => return Err(failed(error.error)),
        },
    };
    flush_folder(folder_of(path)).map_err(failed)?;
    Ok(first)
}

fn aside(path: &Path, contents: &[u8]) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".campaign-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Like any other file, as the umask says, not private as temporary files are.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder_of(path))?;
    file.write_all(contents)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// The folder that a file is in.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Flushes a folder's list of names. Where a system cannot (it says so), the files are as safe as
/// it gets.
pub(crate) fn flush_folder(folder: &Path) -> io::Result<()> {
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

/// Tells ext4 that the folders in this one have nothing to do with each other. It then keeps their files apart, and
/// does not search among those that were just removed for a place for new ones, which takes
/// milliseconds after a thousand of them. Best effort.
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

/// Reads a file, if it is there.
pub(crate) fn read(path: &Path) -> Result<Option<Vec<u8>>, CampaignError> {
    let mut bytes = Vec::new();
    let read =
        File::open(path).and_then(|file| file.take(LARGEST_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 > LARGEST_BYTES => {
            let error = io::Error::other("it is larger than 1 GiB");
            Err(CampaignError::io("read", path, error))
        }
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(CampaignError::io("read", path, error)),
    }
}

/// The first of `NAME.damaged-1`, `NAME.damaged-2`, ... that is free.
pub(crate) fn damaged_name(path: &Path) -> PathBuf {
    let mut number = 1u64;
    loop {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".damaged-{number}"));
        let name = PathBuf::from(name);
        if name.symlink_metadata().is_err() {
            return name;
        }
        number += 1;
    }
}

/// Puts a damaged file (or what stands in its place) aside and says so.
pub(crate) fn set_aside(path: &Path, what: impl Into<String>) -> Result<Damage, CampaignError> {
    let place = damaged_name(path);
    fs::rename(path, &place).map_err(|error| CampaignError::io("set aside", path, error))?;
    let file = path.to_path_buf();
    Ok(Damage { file, line: None, what: what.into(), set_aside: Some(place), torn: false })
}
