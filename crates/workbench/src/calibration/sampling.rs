//! The sampler on a plan: from its simulator to the posterior and the record.

use std::ops::ControlFlow;
use std::time::Instant;

use campaign::{Campaign, CampaignError};
use smc_calib::{CalibrateError, Group, JointProblem, Observer, Posterior, Simulator, StageRecord};

use super::record::record;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::plan::{Plan, Planned};
use crate::record::Record;
use crate::simulator::Experiments;
use crate::watch::Watch;

/// A finished calibration: the record, and the samples behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Contents of `posterior.json`.
    pub record: Record,
    /// The sampler's own account, with all samples.
    pub posterior: Posterior,
}

impl Calibration {
    /// Calibrates in this process, on the current thread pool; nothing is written. What [`run`](super::run()) puts beside a result
    /// (that under correlated errors, that of other kinetics) is not computed.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for a plan with programs, which need a folder ([`run`](super::run())), and for settings that the sampler
    /// refuses; [`Failure::Run`] for a run that cannot succeed; [`Failure::Interrupted`] where `watch` ended it.
    pub fn run(planned: &Planned, watch: &dyn Watch) -> Result<Self, Failure> {
        Self::in_process(planned, &mut Stages::new(watch, None))
    }

    pub(super) fn in_process(planned: &Planned, stages: &mut Stages<'_>) -> Result<Self, Failure> {
        let (plan, watch) = (&planned.plan, stages.watch);
        if let Some((_, experiment, _)) = plan.commands().next() {
            return Err(InputError::new(&plan.name, Mistake::Conflict)
                .found(format_args!("{}, which a program simulates", experiment.name))
                .expected("built-in simulators alone, where no folder is given for the runs")
                .into());
        }
        let experiments = Experiments::new(plan, None, watch)?;
        Self::by(planned, &experiments, stages)
    }

    /// Calibrates by a simulator that needs no folder.
    pub(super) fn by(
        planned: &Planned,
        simulator: &dyn Simulator,
        stages: &mut Stages<'_>,
    ) -> Result<Self, Failure> {
        let (plan, watch) = (&planned.plan, stages.watch);
        watch.begin(plan.budget() as u64, 0, "simulations");
        let sampled = sample(plan, plan.groups()?, simulator, stages);
        watch.end();
        // What a break between stages leaves is no answer to the plan.
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        let posterior = sampled.map_err(|error| failure(planned, error))?;
        let record = record(plan, &planned.warnings, &posterior)?;
        Ok(Self { record, posterior })
    }
}

/// Samples the posterior of a plan; the groups are its observables, the simulator that of all its experiments.
pub(crate) fn sample(
    plan: &Plan,
    groups: Vec<Group>,
    simulator: &dyn Simulator,
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    let problem = JointProblem { simulator, parameters: plan.parameters.clone(), groups };
    match &plan.design {
        None => {
            let settings = plan.begun(plan.sampler.clone());
            smc_calib::calibrate_joint(&problem, &settings, observer)
        }
        Some(design) => {
            smc_calib::calibrate_design(&problem, &plan.sampler, &design.sets, observer)
        }
    }
}

/// A calibration that cannot give a posterior, as the user meets it: options are named as options, fields of a plan
/// file as fields.
pub(super) fn failure(planned: &Planned, error: CalibrateError) -> Failure {
    let place = |field: &str, option: &str, mistake| match &planned.path {
        Some(path) => InputError::new(path.display().to_string(), mistake).in_field(field),
        None => InputError::new(option, mistake),
    };
    match error {
        CalibrateError::Interrupted { .. } => Failure::Interrupted,
        CalibrateError::Setting { setting, value, range } => place(
            &format!("sampler.{setting}"),
            &format!("--{}", setting.replace('_', "-")),
            Mistake::OutOfRange,
        )
        .found(value)
        .expected(range)
        .into(),
        CalibrateError::Noise(error) => {
            place("noise", "--noise", Mistake::OutOfRange).found(error).into()
        }
        other => RunError::new(other).into(),
    }
}

/// Passes the sampler's stages on, with the time that each took, and keeps them beside the runs of programs.
pub(crate) struct Stages<'a> {
    watch: &'a dyn Watch,
    campaign: Option<&'a Campaign>,
    last: Instant,
    /// Steps after the last stage that are done, once they have begun.
    finished: Option<usize>,
    /// Time of each stage [s].
    pub(super) seconds: Vec<f64>,
    pub(super) failed: Option<CampaignError>,
}

impl<'a> Stages<'a> {
    pub(crate) fn new(watch: &'a dyn Watch, campaign: Option<&'a Campaign>) -> Self {
        Self {
            watch,
            campaign,
            last: Instant::now(),
            finished: None,
            seconds: Vec::new(),
            failed: None,
        }
    }
}

impl Observer for Stages<'_> {
    fn stage(&mut self, record: &StageRecord) -> ControlFlow<()> {
        let now = Instant::now();
        self.seconds.push(now.duration_since(self.last).as_secs_f64());
        self.last = now;
        self.watch.stage(record);
        if let Some(campaign) = self.campaign {
            let value = serde_json::to_value(record).unwrap_or_default();
            if let Err(error) = campaign.record_iteration(record.stage as u32, &value) {
                self.failed = Some(error);
                return ControlFlow::Break(());
            }
        }
        if self.watch.stop().asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn finishing(&mut self, done: usize, of: usize, what: &'static str) {
        let before = self.finished.unwrap_or_else(|| {
            self.watch.begin(of as u64, 0, "steps to the posterior");
            0
        });
        (before..done).for_each(|_| self.watch.advance());
        self.finished = Some(done);
        self.watch.now(what);
    }
}
