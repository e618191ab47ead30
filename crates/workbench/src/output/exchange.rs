//! Two folders that change places.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Lets two folders change places, in one step where the system can.
pub(super) fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    #[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        match renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE) {
            Ok(()) => return Ok(()),
            // A file system that cannot: in three steps below.
            Err(
                rustix::io::Errno::NOSYS | rustix::io::Errno::INVAL | rustix::io::Errno::NOTSUP,
            ) => {}
            Err(error) => return Err(error.into()),
        }
    }
    exchange_in_steps(a, b)
}

/// As [`exchange`], with a moment in which `b` is not there; undone where a step fails.
fn exchange_in_steps(a: &Path, b: &Path) -> io::Result<()> {
    let mut between = a.as_os_str().to_owned();
    between.push("-old");
    let between = PathBuf::from(between);
    fs::rename(b, &between)?;
    if let Err(error) = fs::rename(a, b) {
        fs::rename(&between, b)?;
        return Err(error);
    }
    fs::rename(&between, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_change_places_with_and_without_the_systems_help() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        fs::create_dir(&a).expect("made");
        fs::create_dir(&b).expect("made");
        fs::write(a.join("in-a"), "").expect("written");
        exchange(&a, &b).expect("exchanged");
        assert!(b.join("in-a").exists());
        exchange_in_steps(&a, &b).expect("exchanged");
        assert!(a.join("in-a").exists());
        assert!(b.is_dir());
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2);
    }
}
