//! The posterior of a run in the formats of other programs.

use std::fs;
use std::path::{Path, PathBuf};

use campaign::durable;

use super::groups::Groups;
use super::{csv, inference_data, zarr};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file::folder_of;
use crate::output::{make_room, write_file};
use crate::record;

/// Folder of the exports in that of a run, unless another is given.
pub(super) const FOLDER: &str = "export";

/// A format of other programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A Zarr v3 store: ArviZ from 1.0 on, xarray.
    Zarr,
    /// `InferenceData` as JSON: ArviZ 0.x.
    IdataJson,
    /// CmdStan's CSV: cmdstanpy, rstan.
    StanCsv,
    /// A table of draws: R's package posterior.
    DrawsCsv,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Zarr, Self::IdataJson, Self::StanCsv, Self::DrawsCsv];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Zarr => "zarr",
            Self::IdataJson => "idata-json",
            Self::StanCsv => "stan-csv",
            Self::DrawsCsv => "draws-csv",
        }
    }

    /// Name of its file, or of the folder of a store.
    pub fn file(self) -> &'static str {
        match self {
            Self::Zarr => "posterior.zarr",
            Self::IdataJson => "posterior-idata.json",
            Self::StanCsv => "posterior-stan.csv",
            Self::DrawsCsv => "posterior-draws.csv",
        }
    }
}

/// A posterior that was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// What was written, in the order of the formats.
    pub files: Vec<PathBuf>,
    /// The groups.
    pub groups: Groups,
}

/// Writes the posterior of a run in some formats, to `out` or to `export` in the folder of the run. Each appears whole or not
/// at all.
///
/// # Errors
///
/// As [`Groups::read`]; [`Failure::Input`] too for a file that is there already, [`Failure::Run`] for one that cannot be
/// written.
pub fn export_posterior(
    run: &Path,
    formats: &[Format],
    out: Option<&Path>,
) -> Result<Written, Failure> {
    let of_run = || folder_of(&record::locate(run)).join(FOLDER);
    let out = out.map_or_else(of_run, Path::to_owned);
    let files: Vec<PathBuf> = formats.iter().map(|format| out.join(format.file())).collect();
    if let Some(there) = files.iter().find(|file| file.symlink_metadata().is_ok()) {
        return Err(InputError::new(there.display().to_string(), Mistake::NotOurs)
            .found("something that is there already")
            .help("remove it, or choose another folder with --out")
            .into());
    }
    let groups = Groups::read(run)?;
    fs::create_dir_all(&out).map_err(|error| {
        InputError::new("--out", Mistake::Unwritable)
            .found(format_args!("{} ({error})", out.display()))
            .expected("a folder for the exports")
    })?;
    for (format, file) in formats.iter().zip(&files) {
        match format {
            Format::Zarr => write_store(file, &zarr::files(&groups)?)?,
            Format::IdataJson => write_file(file, inference_data::text(&groups)?.as_bytes())?,
            Format::StanCsv => write_file(file, csv::stan(&groups).as_bytes())?,
            Format::DrawsCsv => write_file(file, csv::draws(&groups).as_bytes())?,
        }
    }
    Ok(Written { files, groups })
}

/// Writes a folder of files beside its place, and renames it there.
fn write_store(target: &Path, files: &[(String, Vec<u8>)]) -> Result<(), RunError> {
    let write = || {
        let hidden = tempfile::Builder::new().prefix(".export-").tempdir_in(folder_of(target))?;
        let store = hidden.path().join("store");
        for (name, bytes) in files {
            let path = store.join(name);
            fs::create_dir_all(folder_of(&path))?;
            fs::write(&path, bytes)?;
        }
        durable::flush_tree(&store)?;
        fs::rename(&store, target)?;
        // What the folder names is in place already.
        let _ = durable::flush_folder(folder_of(target));
        Ok(())
    };
    write().map_err(|error: std::io::Error| {
        make_room(RunError::new(format_args!("{}: cannot be written: {error}", target.display())))
    })
}
