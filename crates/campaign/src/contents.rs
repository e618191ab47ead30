//! Contents of a campaign, for any process that may read its directory.

use std::collections::HashMap;
use std::path::Path;

use crate::error::CampaignError;
use crate::outcome::Outcome;
use crate::record::Record;
use crate::spec::CampaignSpec;
use crate::state::snapshot;
use crate::status::published;
use crate::task::Task;

/// Contents of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// Commands, parameters and results of the runs.
    pub spec: CampaignSpec,
    /// Every task that was submitted, by number.
    pub tasks: Vec<Task>,
    /// The outcomes so far, by number.
    pub outcomes: HashMap<u64, Outcome>,
}

/// Reads the campaign in `dir`, also while it runs, without its lock and without changing anything. Damaged lines are left
/// out.
///
/// # Errors
///
/// [`CampaignError`] where there is no campaign, or its record is damaged.
pub fn contents(dir: &Path) -> Result<Contents, CampaignError> {
    let record = Record::read_present(dir)?;
    // First those that wait to be collected: they may be in the journal a moment later.
    let published = published(dir);
    let (tasks, results) = snapshot(dir, &record.spec)?;
    let mut outcomes = HashMap::new();
    for result in results.into_iter().chain(published) {
        if tasks.get(&result.number).is_some_and(|(_, task)| *task == result.task) {
            outcomes.entry(result.number).or_insert(result.outcome);
        }
    }
    let tasks = tasks.into_values().map(|(task, _)| task).collect();
    Ok(Contents { spec: record.spec, tasks, outcomes })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::{Campaign, Executor, InProcess, Stop};

    #[test]
    fn what_is_stored_is_read_while_the_campaign_is_open() {
        let spec = CampaignSpec::of_squares();
        let folder = tempfile::tempdir().expect("a temporary folder");
        let dir = folder.path().join("run");
        assert!(contents(&dir).is_err());
        let campaign = Campaign::create(&dir, &spec, &BTreeMap::new()).expect("made");
        let task = |number: u64| Task { number, command: 0, parameters: vec![number as f64] };
        let tasks: Vec<Task> = (1..=3).map(task).collect();
        campaign.record_submitted(&tasks).expect("stored");
        let read = contents(&dir).expect("contents");
        assert_eq!((read.spec, read.tasks, read.outcomes.len()), (spec, tasks.clone(), 0));
        let mut threads =
            InProcess::new(1, |task: &Task| Ok(vec![task.parameters[0].powi(2)])).expect("a pool");
        threads.run(&campaign, &tasks[..2], &mut |_| (), &Stop::new()).expect("runs");
        let read = contents(&dir).expect("contents");
        assert_eq!(read.outcomes.len(), 2);
        assert_eq!(read.outcomes[&2].values(), Some(&[4.0][..]));
    }
}
