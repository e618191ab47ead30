//! Files of sealed lines that only grow.

use std::fs::{self, File, OpenOptions};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{CampaignError, Damage};
use crate::{files, seal};

/// A file of sealed lines, open for appending by the process with the directory's lock.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    /// Length of the whole lines \[bytes\].
    length: u64,
    /// Length for which the disk has set room aside \[bytes\].
    reserved: u64,
    /// Room that is set aside ahead of the lines \[bytes\].
    reserve: u64,
}

/// The lines of a journal.
#[derive(Debug)]
pub(crate) struct Lines<T> {
    /// The records of the whole lines, in order.
    pub(crate) records: Vec<T>,
    /// The damaged lines.
    pub(crate) damage: Vec<Damage>,
    /// Text of the whole lines.
    good: Vec<u8>,
    /// Whether the file must be written anew: a line in its middle is damaged.
    broken: bool,
    /// Whether no line is damaged or torn.
    clean: bool,
}

/// Reads the lines of a journal without touching it; none where there is no file.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<Lines<T>>, CampaignError> {
    Ok(files::read(path)?.map(|text| parse(path, &text)))
}

fn parse<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Lines<T> {
    let mut lines = Lines {
        records: Vec::new(),
        damage: Vec::new(),
        good: Vec::with_capacity(text.len()),
        broken: false,
        clean: true,
    };
    for (i, line) in text.split_inclusive(|&byte| byte == b'\n').enumerate() {
        let ended = line.ends_with(b"\n");
        match seal::unseal(line) {
            Ok(record) => {
                lines.records.push(record);
                lines.good.extend_from_slice(line);
                if !ended {
                    lines.good.push(b'\n');
                    lines.clean = false;
                }
            }
            Err(what) => {
                let torn = !ended && !seal::reaches_its_end(line);
                let what = if torn { "it was not written to its end".into() } else { what };
                lines.broken |= !torn;
                lines.clean = false;
                lines.damage.push(Damage { line: Some(i + 1), torn, ..Damage::of(path, what) });
            }
        }
    }
    lines
}

impl Journal {
    /// Opens a journal, makes it where it is not there, and mends it: damaged lines are dropped, and
    /// the damaged file is kept beside it. A torn last line is dropped too.
    pub(crate) fn open<T: DeserializeOwned>(
        path: &Path,
    ) -> Result<(Self, Vec<T>, Vec<Damage>), CampaignError> {
        let failed = |error| CampaignError::io("opened", path, error);
        let mut damage = Vec::new();
        let mut records = Vec::new();
        if path.is_dir() {
            damage.push(files::set_aside(path, "it is a directory")?);
        }
        match read(path)? {
            None => {
                damage.push(Damage::of(path, "it is not there"));
                files::write(path, b"")?;
            }
            Some(mut lines) => {
                if lines.broken {
                    let kept = files::damaged_name(path);
                    keep(path, &kept).map_err(|error| CampaignError::io("kept", &kept, error))?;
                    for damage in lines.damage.iter_mut().filter(|damage| !damage.torn) {
                        damage.set_aside = Some(kept.clone());
                    }
                }
                if !lines.clean {
                    files::write(path, &lines.good)?;
                }
                damage.append(&mut lines.damage);
                records = lines.records;
            }
        }
        let mut file = OpenOptions::new().write(true).open(path).map_err(failed)?;
        let length = file.seek(SeekFrom::End(0)).map_err(failed)?;
        let path = path.to_path_buf();
        Ok((Self { path, file, length, reserved: 0, reserve: 0 }, records, damage))
    }

    /// Sets room aside on the disk, now and always ahead of what is written, so that a disk that
    /// somebody fills does not cost the records of what was finished meanwhile. Best effort.
    pub(crate) fn reserve(&mut self, bytes: u64) {
        self.reserve = bytes;
        self.make_room();
    }

    fn make_room(&mut self) {
        #[cfg(any(target_os = "linux", target_os = "android"))]
        if self.reserve > 0 && self.length + self.reserve / 2 >= self.reserved {
            use rustix::fs::{FallocateFlags, fallocate};
            let flags = FallocateFlags::KEEP_SIZE;
            if fallocate(&self.file, flags, self.length, self.reserve).is_ok() {
                self.reserved = self.length + self.reserve;
            }
        }
    }

    /// Appends records and flushes them once. Where that fails, the file is as it was.
    pub(crate) fn append<T: Serialize>(&mut self, records: &[T]) -> Result<(), CampaignError> {
        if records.is_empty() {
            return Ok(());
        }
        let before = self.length;
        self.write(records)?;
        self.flush().inspect_err(|_| self.cut(before))
    }

    /// Replaces all records at once: on the disk they are all there or the former ones. After a failure nothing more is to be
    /// written by this journal.
    pub(crate) fn replace<T: Serialize>(&mut self, records: &[T]) -> Result<(), CampaignError> {
        let text = self.lines(records)?;
        files::write(&self.path, &text)?;
        let failed = |error| CampaignError::io("opened", &self.path, error);
        self.file = OpenOptions::new().write(true).open(&self.path).map_err(failed)?;
        self.length = text.len() as u64;
        self.reserved = 0;
        self.make_room();
        Ok(())
    }

    /// Copies the file as it is to the first of `NAME.END-1`, `NAME.END-2`, ... that is free: what is appended from now on
    /// does not appear there.
    pub(crate) fn keep_as(&self, end: &str) -> Result<PathBuf, CampaignError> {
        let kept = files::free_name(&self.path, end);
        fs::copy(&self.path, &kept).map_err(|error| CampaignError::io("kept", &kept, error))?;
        Ok(kept)
    }

    /// Its file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Flushes what was written.
    pub(crate) fn flush(&self) -> Result<(), CampaignError> {
        self.file.sync_data().map_err(|error| CampaignError::io("written", &self.path, error))
    }

    /// Half a line would be taken for a torn one: no harm if this fails.
    fn cut(&mut self, length: u64) {
        self.length = length;
        self.reserved = 0;
        let _ = self.file.set_len(length);
        self.make_room();
    }

    fn lines<T: Serialize>(&self, records: &[T]) -> Result<Vec<u8>, CampaignError> {
        let mut text = Vec::new();
        for record in records {
            let line = seal::seal(record)
                .map_err(|error| CampaignError::io("written", &self.path, error.into()))?;
            text.extend_from_slice(&line);
            text.push(b'\n');
        }
        Ok(text)
    }

    /// Appends records without flushing them. Where that fails, the file is as it was.
    pub(crate) fn write<T: Serialize>(&mut self, records: &[T]) -> Result<(), CampaignError> {
        let text = self.lines(records)?;
        let place = self.file.seek(SeekFrom::Start(self.length));
        match place.and_then(|_| self.file.write_all(&text)) {
            Ok(()) => {
                self.length += text.len() as u64;
                self.make_room();
                Ok(())
            }
            Err(error) => {
                self.cut(self.length);
                Err(CampaignError::io("written", &self.path, error))
            }
        }
    }
}

/// A second name for the file, or a copy where the file system has no second names.
fn keep(path: &Path, kept: &Path) -> std::io::Result<()> {
    fs::hard_link(path, kept).or_else(|_| fs::copy(path, kept).map(drop))
}
