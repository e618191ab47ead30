//! An experiment and priors held against each other, where each is right by itself.

use std::path::{Path, PathBuf};

use dem_core::Kinetics;

use super::{TomlKind, toml_kind};
use crate::careful::Careful;
use crate::error::InputError;
use crate::input::columns::Columns;
use crate::input::experiment::{Experiment, is_toml};
use crate::input::prior_file::PriorFile;
use crate::input::text_file;
use crate::pair::frenkel_fit;
use crate::pair::model::NeckGrowth;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairOptions, prior_in_words};

/// Share of a prior on either side that is not held against it: its outermost hundredth.
const OUTERMOST: f64 = 0.01;

/// How many times the range of tau_s may be missed by the best Frenkel curve: the other kinetics can differ from it by a
/// few times, a unit by 60 or more.
const TAU_S_FACTOR: f64 = 10.0;

/// What a heat leaves open and the one file of priors among some files has no prior of, for every experiment among them.
pub fn missing(files: &[PathBuf], said: &Columns) -> Vec<InputError> {
    let [priors] = of_kind(files, TomlKind::Prior)[..] else { return Vec::new() };
    if PriorFile::read(priors).is_err() {
        return Vec::new();
    }
    let mut found = Vec::new();
    for path in of_kind(files, TomlKind::Experiment) {
        if !Experiment::read(path, said).is_ok_and(|one| one.heat.is_some()) {
            continue;
        }
        if let Err(error) = calibrated(path, priors, said).plan()
            && !found.contains(&error)
        {
            found.push(error);
        }
    }
    found
}

/// An experiment with priors.
fn calibrated(experiment: &Path, priors: &Path, said: &Columns) -> PairOptions {
    PairOptions {
        experiment: Some(experiment.to_owned()),
        prior: Some(priors.to_owned()),
        columns: said.clone(),
        ..PairOptions::default()
    }
}

/// Warnings on every experiment with every file of priors among some files. Files of other kinds, and files with
/// mistakes, which are told by themselves, are passed over.
pub fn together(files: &[PathBuf], said: &Columns) -> Vec<String> {
    let priors: Vec<_> = of_kind(files, TomlKind::Prior)
        .into_iter()
        .filter_map(|file| Some((file, PriorFile::read(file).ok()?)))
        .collect();
    let mut warnings = Vec::new();
    for path in of_kind(files, TomlKind::Experiment) {
        let Ok(experiment) = Experiment::read(path, said) else { continue };
        for (file, priors) in &priors {
            warnings.extend(cut_off(&experiment, priors));
            warnings.extend(sintering_time((path, &experiment), (file, priors), said));
        }
    }
    warnings
}

fn of_kind(files: &[PathBuf], kind: TomlKind) -> Vec<&PathBuf> {
    files.iter().filter(|file| kind_of(file) == Some(kind)).collect()
}

fn kind_of(file: &Path) -> Option<TomlKind> {
    if !is_toml(file) {
        return None;
    }
    toml_kind(&file.display().to_string(), &text_file::read(file).ok()?).ok()
}

/// A cut-off distance of the adhesive traction that is larger than the particle.
fn cut_off(experiment: &Experiment, priors: &PriorFile) -> Option<String> {
    let prior = priors.get(ParameterName::DeltaC)?;
    let radius = experiment.powder.radius_m;
    let [low, high] = [OUTERMOST, 1.0 - OUTERMOST].map(|p| prior.quantile(p));
    let how = if low > radius {
        "lies above"
    } else if high > radius {
        "reaches above"
    } else {
        return None;
    };
    let warning = Careful::DeltaCAboveRadius {
        priors: priors.file_name.clone(),
        prior: prior_in_words(prior.spec()),
        how: how.to_owned(),
        radius_m: radius,
        experiment: experiment.description_name.clone(),
    };
    Some(warning.to_string())
}

/// A sintering time that is far from the times at which growth was observed.
fn sintering_time(
    (path, experiment): (&Path, &Experiment),
    (file, priors): (&Path, &PriorFile),
    said: &Columns,
) -> Option<String> {
    let prior = priors.get(ParameterName::TauS)?;
    // With a free clock, or a heat, the times themselves are open.
    if priors.get(ParameterName::T0).is_some() || experiment.heat.is_some() {
        return None;
    }
    let options = PairOptions { kinetics: Kinetics::Frenkel, ..calibrated(path, file, said) };
    let plan = options.plan().ok()?.plan;
    let observed = &plan.pair().ok()?.1.values;
    let best = frenkel_fit::best_tau_s(&NeckGrowth::of(&plan).ok()?, observed).ok()??;
    let [low, high] = [OUTERMOST, 1.0 - OUTERMOST].map(|p| prior.quantile(p));
    let far = best > TAU_S_FACTOR * high || best < low / TAU_S_FACTOR;
    far.then(|| {
        let warning = Careful::TauSFarFromTimes {
            priors: priors.file_name.clone(),
            prior: prior_in_words(prior.spec()),
            table: experiment.table_name.clone(),
            best_s: best,
        };
        warning.to_string()
    })
}
