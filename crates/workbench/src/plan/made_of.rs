//! The files that a plan is made of, by their roles.

use std::path::{Path, PathBuf};

use super::types::{Plan, SimulatorPlan};
use crate::input::files_read::FilesRead;
use crate::input::text_file::folder_of;
use crate::output::inputs::Inputs;
use crate::record;

/// The role of a plan file.
pub(crate) const PLAN: &str = "plan";
/// The role of a program, and of a file that is given to its runs.
pub(crate) const PROGRAM: &str = "program or file of runs";

/// The folder of a plan file, whole.
fn whole_folder(file: &Path) -> PathBuf {
    let whole = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    whole.parent().unwrap_or(Path::new("/")).to_owned()
}

/// What was read of the files of a plan. Those of a plan with programs are named from the folder of its file on, others as they
/// were given.
pub(super) fn inputs(file: Option<&Path>, plan: &Plan, read: &FilesRead) -> Inputs {
    match file.filter(|_| plan.commands().next().is_some()) {
        Some(file) => {
            let folder = whole_folder(file);
            let whole = |(role, path)| (role, std::path::absolute(&path).unwrap_or(path));
            Inputs::of(files(Some(file), plan, read).into_iter().map(whole), Some(&folder), read)
        }
        None => Inputs::of(files(file, plan, read), None, read),
    }
}

fn files(file: Option<&Path>, plan: &Plan, read: &FilesRead) -> Vec<(&'static str, PathBuf)> {
    let mut files: Vec<(&'static str, PathBuf)> = Vec::new();
    let beside = |name: &str| match file {
        Some(file) => folder_of(file).join(name),
        None => PathBuf::from(name),
    };
    // Tables of programs are named from the folder of the plan on, those of pairs as the plan's file is.
    let named = |name: &str| {
        let beside = beside(name);
        if read.of(&beside).is_some() { beside } else { name.into() }
    };
    files.extend(file.map(|file| (PLAN, file.to_owned())));
    for experiment in &plan.experiments {
        if let SimulatorPlan::Builtin(pair) = &experiment.simulator {
            files.push(("experiment", named(&pair.experiment)));
        }
        let tables = experiment.observables.iter().map(|observable| &observable.table);
        files.extend(tables.map(|table| ("measurements", named(table))));
    }
    files.extend(plan.prior_source.iter().map(|file| ("priors", named(file))));
    files.extend(plan.design.iter().map(|design| ("parameter sets", beside(&design.file))));
    if let Some(earlier) = &plan.proposal {
        let posterior = record::locate(&beside(&earlier.from));
        let samples = posterior.with_file_name("samples.csv");
        files.extend([
            ("earlier posterior", posterior),
            ("samples of the earlier posterior", samples),
        ]);
    }
    files
}
