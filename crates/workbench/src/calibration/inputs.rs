//! The files that a calibration was made of.

use std::path::{Path, PathBuf};

use campaign::CampaignSpec;

use super::fingerprints;
use super::store::Stored;
use crate::input::text_file::folder_of;
use crate::output::inputs::Inputs;
use crate::output::page::PLAN;
use crate::plan::{Plan, Planned, SimulatorPlan};
use crate::record;

/// Of plans that come from options.
pub(crate) fn of_plans<'p>(plans: impl Iterator<Item = &'p Plan>) -> Inputs {
    Inputs::of(plans.flat_map(|plan| files(None, plan, Vec::new(), None)), None)
}

/// Of a plan that is computed in this process.
pub(super) fn of_planned(planned: &Planned) -> Inputs {
    let folder = planned.path.as_deref().map(folder_of);
    Inputs::of(files(planned.path.as_deref(), &planned.plan, Vec::new(), folder), None)
}

/// Of a plan whose programs are run; files below the plan's folder are named from there on.
pub(super) fn of_stored(stored: &Stored, spec: &CampaignSpec) -> Inputs {
    let folder = whole_folder(&stored.file);
    let programs = fingerprints::files(spec, &folder).into_iter();
    let programs = programs.map(|file| ("program or file of runs", file)).collect();
    let whole = |(role, path)| (role, std::path::absolute(&path).unwrap_or(path));
    let files = files(Some(&stored.file), &stored.plan, programs, Some(&folder)).into_iter();
    Inputs::of(files.map(whole), Some(&folder))
}

fn whole_folder(plan: &Path) -> PathBuf {
    let whole = std::path::absolute(plan).unwrap_or_else(|_| plan.to_owned());
    whole.parent().unwrap_or(Path::new("/")).to_owned()
}

/// The files by their roles; names in a plan file begin at its folder.
fn files(
    file: Option<&Path>,
    plan: &Plan,
    programs: Vec<(&'static str, PathBuf)>,
    folder: Option<&Path>,
) -> Vec<(&'static str, PathBuf)> {
    let mut files: Vec<(&'static str, PathBuf)> = Vec::new();
    let beside =
        |file: &str| folder.map_or_else(|| PathBuf::from(file), |folder| folder.join(file));
    // Tables of programs are named from the folder of the plan on, those of pairs as the plan's file is.
    let named =
        |file: &str| Some(beside(file)).filter(|file| file.is_file()).unwrap_or(file.into());
    files.extend(file.map(|file| (PLAN, file.to_owned())));
    for experiment in &plan.experiments {
        if let SimulatorPlan::Builtin(pair) = &experiment.simulator {
            files.push(("experiment", named(&pair.experiment)));
        }
        let tables = experiment.observables.iter().map(|observable| &observable.table);
        files.extend(tables.map(|table| ("measurements", named(table))));
    }
    files.extend(plan.prior_source.iter().map(|file| ("priors", PathBuf::from(file))));
    files.extend(plan.design.iter().map(|design| ("parameter sets", beside(&design.file))));
    let earlier = plan.proposal.iter().map(|earlier| record::locate(&beside(&earlier.from)));
    files.extend(earlier.map(|file| ("earlier posterior", file)));
    files.extend(programs);
    files
}
