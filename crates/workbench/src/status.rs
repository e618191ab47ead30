//! How far a run is, while it runs or after.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use crate::calibration::{Stored, read_stored, refused};
use crate::error::Failure;
use crate::number::significant;
use crate::output::CAMPAIGN;
use crate::record::{self, FILE_NAME};

/// Whether a run goes on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum State {
    /// A driver has it.
    Running,
    /// It can be taken up again.
    #[default]
    Stopped,
    /// Its results are written.
    Done,
}

/// How far a run is.
#[derive(Debug, Default, Serialize)]
pub struct Status {
    name: String,
    state: State,
    /// Who runs it, if anybody does.
    driver: Option<String>,
    /// Runs that the plan asks for.
    total: u64,
    finished: u64,
    failed: u64,
    failed_by_cause: BTreeMap<String, u64>,
    running: u64,
    queued: u64,
    stages: u64,
    seconds_per_run: Option<f64>,
    seconds_left: Option<f64>,
    /// Whether the report has been written.
    reported: bool,
}

/// How far the run in a folder is.
///
/// # Errors
///
/// [`Failure::Input`] for a folder without a run.
pub fn read(dir: &Path) -> Result<Status, Failure> {
    if dir.join(FILE_NAME).is_file() && !dir.join(CAMPAIGN).is_dir() {
        return Ok(computed_here(&record::read(dir)?));
    }
    let stored = read_stored_or_refuse(dir)?;
    let campaign = campaign::status(&dir.join(CAMPAIGN)).map_err(|error| refused(dir, error))?;
    Ok(status(dir, &stored, &campaign))
}

/// The plan of a run; a folder without one is refused as the campaign refuses it.
fn read_stored_or_refuse(dir: &Path) -> Result<Stored, Failure> {
    match dir.join(CAMPAIGN).is_dir() || dir.join("campaign.json").is_file() {
        true => read_stored(dir),
        false => {
            let dir_of_runs = dir.join(CAMPAIGN);
            Err(refused(dir, campaign::CampaignError::NotACampaign { dir: dir_of_runs }))
        }
    }
}

/// A finished run of built-in simulators, which has no runs of programs.
fn computed_here(record: &record::Record) -> Status {
    Status {
        name: record.plan.name.clone(),
        state: State::Done,
        stages: record.stages.len() as u64,
        reported: true,
        ..Status::default()
    }
}

fn status(dir: &Path, stored: &Stored, campaign: &campaign::Status) -> Status {
    let plan = &stored.plan;
    let total = (plan.budget() * plan.commands().count()) as u64;
    let failed: u64 = campaign.failed.values().sum();
    let ended = campaign.finished + failed;
    let reported = record::is_reported(dir, plan);
    let driver = campaign.driver.as_ref().map(|holder| {
        holder.as_ref().map_or_else(|| "another process".to_owned(), ToString::to_string)
    });
    let left = total.saturating_sub(ended);
    // Runs that were submitted are estimated by the campaign; the stages to come are as long as those were.
    let to_come = total.saturating_sub(campaign.submitted) as f64;
    let seconds_left = match (campaign.time_left_s, campaign.seconds_per_run) {
        _ if reported || left == 0 => None,
        (Some(submitted), Some(each)) => {
            Some(submitted + to_come * each / campaign.parallel.max(1) as f64)
        }
        _ => None,
    };
    let stages = std::fs::read_dir(dir.join(CAMPAIGN).join("iterations")).map_or(0, |entries| {
        let json = |entry: &std::fs::DirEntry| {
            entry.path().extension().is_some_and(|extension| extension == "json")
        };
        entries.flatten().filter(json).count() as u64
    });
    Status {
        name: plan.name.clone(),
        state: match (&driver, reported) {
            (Some(_), _) => State::Running,
            (None, true) => State::Done,
            (None, false) => State::Stopped,
        },
        driver,
        total,
        finished: campaign.finished,
        failed,
        failed_by_cause: campaign.failed.clone(),
        running: campaign.running,
        queued: campaign.queued,
        stages,
        seconds_per_run: campaign.seconds_per_run,
        seconds_left,
        reported,
    }
}

/// A duration as a person says it.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// A status in words.
pub fn text(dir: &Path, status: &Status) -> String {
    let mut text = String::new();
    let name = dir.display();
    let _ = match (status.state, &status.driver) {
        (State::Running, Some(driver)) => writeln!(text, "{}: running, by {driver}", status.name),
        (State::Done, _) => writeln!(text, "{}: done, results in {name}/", status.name),
        _ => writeln!(text, "{}: stopped; go on with: calibrate --resume {name}", status.name),
    };
    if status.total > 0 {
        let _ = writeln!(
            text,
            "  runs      {} of {} finished, {} failed, {} running, {} waiting",
            status.finished, status.total, status.failed, status.running, status.queued
        );
    }
    for (cause, count) in &status.failed_by_cause {
        let _ = writeln!(text, "  failed    {count} times: {cause}");
    }
    if !status.failed_by_cause.is_empty() && status.state != State::Running {
        let _ = writeln!(
            text,
            "            to make them once more: calibrate --resume {name} --retry-failed"
        );
    }
    let _ = writeln!(text, "  stages    {} complete", status.stages);
    if let Some(seconds) = status.seconds_per_run {
        let _ = writeln!(text, "  per run   {} s on average", significant(seconds, 2));
    }
    if let Some(seconds) = status.seconds_left {
        let _ = writeln!(text, "  time left about {}", duration(seconds));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_as_a_person_says_them() {
        let said = [3.2, 89.0, 120.0, 7200.0, 200_000.0].map(duration);
        assert_eq!(said, ["3 s", "89 s", "2 min", "2.0 h", "2.3 days"]);
    }
}
