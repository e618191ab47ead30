//! How a calibration is run.

use crate::sobol::MAX_DIMENSIONS;
use crate::{CalibrateError, MixtureRecord};
use serde::{Deserialize, Serialize};

/// Settings of the sampler. The defaults were measured; see each field.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Total number of simulations of the sampler (the local search for the MAP comes on top).
    pub samples: usize,
    /// Of a run that extends others: their budgets, in rising order, all below `samples`. The first samples are those of a run
    /// of `earlier[0]` with these settings, to the bit; those up to the next budget are placed from all before them. The
    /// targets `ess_target` and `mean_se_target` do not end such a run.
    #[serde(skip_serializing_if = "is_default")]
    pub earlier: Vec<usize>,
    /// Stages that adapt the proposal, before the final one; where a Gaussian process places fewer than 400 samples in batches, those
    /// after the first, and no more than there are batches.
    pub iterations: usize,
    /// Seed of all random streams.
    pub seed: u64,
    /// Independently scrambled sub-nets per stage, from which error bars are computed.
    pub replicates: usize,
    /// Share of the budget drawn from the last, frozen proposal.
    /// Where a Gaussian process places the samples it is what the adaptive stages, of whole batches, leave: a fifth or less, and of
    /// fewer than 400 no more than each of them has.
    pub final_share: f64,
    /// Effective sample size that tempering aims at, as a share of a stage.
    pub tempering_share: f64,
    /// Most mixture components.
    pub max_components: usize,
    /// Components added to each proposal where it is thinnest beside the target.
    pub patches: usize,
    /// How much wider than the posterior proposals are, as a factor on covariances: fitted to a flattened
    /// likelihood down to the power 0.7, and the rest a factor on the fitted covariances.
    pub widening: f64,
    /// Degrees of freedom of the proposal's Student-t components.
    pub degrees_of_freedom: f64,
    /// Share of the prior kept in every proposal.
    pub defensive_share: f64,
    /// Share of failed simulations above which the run stops with an error.
    pub max_failed_share: f64,
    /// Stop early once the effective sample size reaches this.
    pub ess_target: Option<f64>,
    /// Stop early once every posterior mean is known to this many posterior standard deviations.
    pub mean_se_target: Option<f64>,
    /// Number of equally weighted posterior draws.
    pub draws: usize,
    /// Most simulations of the local search for the MAP; with 0 the MAP is the sample of highest density, and the
    /// simulator is called for nothing but the samples.
    pub map_simulations: usize,
    /// Sizes of stages are multiples of this where the budget allows: the number of runs that go on at a time. With
    /// 0 they are multiples of the number of sub-nets.
    #[serde(skip_serializing_if = "is_default")]
    pub batch: usize,
    /// A stage is placed from all stages that end so many samples or more before its first one, and from no other. With 0 it
    /// waits for all before it. With more, the longest simulations of a stage go on beside the next stages, where they are
    /// unequally long and many go on at a time. The answer stays right whatever the order in which they end; proposals know
    /// less. At most a quarter of the samples.
    #[serde(skip_serializing_if = "is_default")]
    pub overlap: usize,
    /// Place samples by a Gaussian process through the outputs so far (the log likelihoods, where there are no outputs); weights
    /// stay those of the true likelihood. Of [`PLAIN`](Self::PLAIN) samples and more it places the first 400, by the settings
    /// of [`for_budget`](Self::for_budget)`(400)` where these here are the defaults, and the rest are placed without it.
    #[serde(skip_serializing_if = "is_default")]
    pub surrogate: bool,
    /// The density that the first stage is drawn from, where it is not the prior: an earlier posterior
    /// ([`FirstProposal`](crate::FirstProposal)), in normal scores of the priors, with the degrees of freedom of these settings.
    /// It belongs to the priors and is not stored with the settings.
    #[serde(skip)]
    pub first_proposal: Option<MixtureRecord>,
    /// Whether the path over the observations is computed: what was known after each of them. With many nodes of
    /// correlated noise it takes most of the time.
    #[serde(skip_serializing_if = "Clone::clone")]
    pub path: bool,
}

/// Most samples that are placed one at a time, or as near to it as [`STAGES`] allow.
pub(crate) const FEW_RUNS: usize = 200;
/// Stages after the first by default where a Gaussian process places samples: 38 up to [`FEW_RUNS`], of 50 runs that is one by one, then
/// in proportion to 1/n below [`ALIKE`], where 19 are left. Of runs placed four, two and one at a time the RMS error of PS at 50 is 2.9, 1.9
/// and 1.3 posterior sds, of PEEK 4.9, 3.9 and 3.0; of 50 seeds two lose PEEK at 101 to 112 runs placed three at a time.
const STAGES: usize = 38;
/// Fewest samples of which the last stage that a process places may be larger than those before it: alike, with 19 of them, the bounded
/// ridge was .014 and .018 posterior sds off at 512 and 1024 simulations (20 seeds), not .011.
pub(crate) const ALIKE: usize = 400;
/// Stages from there on: so many there, in proportion to 1/n, and at least so many. Large stages are large nets: with 20 throughout, and a
/// [`Settings::final_share`] of .3, the mean of the bounded ridge was .019 posterior sds off at 1536 simulations (10 seeds), not .010. With 8
/// at least, 4 of 30 runs of 1024 simulations of PS have weights with a heavy tail; with these, as with 20, none, but 3 of PA12.
const STAGES_ALIKE: [usize; 2] = [20, 12];
/// [`Settings::final_share`] there, in proportion to n, and at most.
const FINALLY: [f64; 2] = [0.3, 0.4];

/// Fields added later are written only where they say something, so that older readers understand the rest.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples: 16_384,
            earlier: Vec::new(),
            iterations: 8,
            seed: 1,
            replicates: 16,
            final_share: 0.5,
            tempering_share: 0.1,
            max_components: 8,
            patches: 4,
            widening: 1.6,
            degrees_of_freedom: 10.0,
            defensive_share: 0.02,
            max_failed_share: 0.9,
            ess_target: None,
            mean_se_target: None,
            draws: 4096,
            map_simulations: 400,
            batch: 0,
            overlap: 0,
            surrogate: false,
            first_proposal: None,
            path: true,
        }
    }
}

impl Settings {
    /// Fewest samples that a Gaussian process does not place all: with 2047 it places them all, with 2048 the first 400.
    pub const PLAIN: usize = 2048;
    /// Fewest samples for which [`for_budget`](Self::for_budget) asks for no Gaussian process.
    pub const WHOLLY_PLAIN: usize = 8192;

    /// For simulators of which only 30 to about two thousand runs can be paid for.
    ///
    /// Many stages, each placed by a Gaussian process through the outputs (or the log likelihoods) so far, with a length of
    /// its own for every parameter ([`Settings::surrogate`]), and nothing simulated but the samples. Set [`Settings::batch`] to the number of runs
    /// that go on at a time. From 2048 simulations on these are the default settings without the search for the MAP; up to 8191 a process places
    /// the first 400, as with fewer the default sampler does not always find a posterior that is narrow in its prior (PEEK at 1001:
    /// 2.6 standard deviations off; placed by the process 0.03).
    ///
    /// Measured in `results/benchmarks/small-budget/report.md`.
    pub fn for_budget(samples: usize) -> Self {
        let default = Self { samples, map_simulations: 0, ..Self::default() };
        if samples >= Self::PLAIN {
            return Self { surrogate: samples < Self::WHOLLY_PLAIN, ..default };
        }
        Self {
            iterations: if samples < ALIKE {
                STAGES * FEW_RUNS / samples.max(FEW_RUNS)
            } else {
                (STAGES_ALIKE[0] * ALIKE / samples).max(STAGES_ALIKE[1])
            },
            final_share: (FINALLY[0] * samples as f64 / ALIKE as f64).clamp(FINALLY[0], FINALLY[1]),
            max_components: 3,
            patches: 1,
            defensive_share: 0.05,
            tempering_share: 0.3,
            batch: if samples <= FEW_RUNS { 1 } else { 4 },
            surrogate: true,
            ..default
        }
    }

    /// The settings of this run extended to `samples`: see [`earlier`](Self::earlier). All other settings stay. Those of a small budget
    /// that were not chosen do not hold for a part beyond [`PLAIN`](Self::PLAIN).
    ///
    /// # Errors
    /// [`CalibrateError::Setting`] where that is no more than the run has.
    pub fn extended(&self, samples: usize) -> Result<Self, CalibrateError> {
        if samples <= self.samples {
            let (setting, value) = ("samples", samples as f64);
            let range = "above the number that the run has";
            return Err(CalibrateError::Setting { setting, value, range });
        }
        let mut earlier = self.earlier.clone();
        earlier.push(self.samples);
        Ok(Self { samples, earlier, ..self.clone() })
    }

    /// The settings of the first run, before it was extended.
    pub fn as_begun(&self) -> Self {
        Self { samples: self.first_budget(), earlier: Vec::new(), ..self.clone() }
    }

    /// Refuses values outside their range, for a problem of `dimension` parameters.
    pub(crate) fn check(&self, dimension: usize) -> Result<(), CalibrateError> {
        let refuse =
            |setting, value: f64, range| Err(CalibrateError::Setting { setting, value, range });
        let within = |value: f64, lower: f64, upper: f64| value >= lower && value <= upper;
        if dimension + 2 > MAX_DIMENSIONS {
            return refuse("number of parameters", dimension as f64, "at most 19");
        }
        if !(1..=1 << 27).contains(&self.samples) {
            return refuse("samples", self.samples as f64, "between 1 and 2^27");
        }
        let budgets: Vec<usize> = self.earlier.iter().copied().chain([self.samples]).collect();
        if let Some(pair) = budgets.windows(2).find(|pair| pair[0] == 0 || pair[0] >= pair[1]) {
            return refuse("earlier", pair[0] as f64, "above 0 and below the budget after it");
        }
        if !(1..=1000).contains(&self.iterations) {
            return refuse("iterations", self.iterations as f64, "between 1 and 1000");
        }
        if !(1..=256).contains(&self.replicates) {
            return refuse("replicates", self.replicates as f64, "between 1 and 256");
        }
        if !within(self.final_share, 0.0, 1.0) {
            return refuse("final_share", self.final_share, "between 0 and 1");
        }
        if !(self.tempering_share > 0.0 && self.tempering_share <= 1.0) {
            return refuse("tempering_share", self.tempering_share, "above 0, at most 1");
        }
        if !(1..=64).contains(&self.max_components) {
            return refuse("max_components", self.max_components as f64, "between 1 and 64");
        }
        if self.patches > 64 {
            return refuse("patches", self.patches as f64, "at most 64");
        }
        if !within(self.widening, 1e-3, 1e3) {
            return refuse("widening", self.widening, "between 0.001 and 1000");
        }
        if !within(self.degrees_of_freedom, 1.0, 1e6) {
            return refuse("degrees_of_freedom", self.degrees_of_freedom, "between 1 and 10^6");
        }
        if !within(self.defensive_share, 1e-6, 1.0) {
            return refuse("defensive_share", self.defensive_share, "between 10^-6 and 1");
        }
        if self.batch > 1 << 27 {
            return refuse("batch", self.batch as f64, "at most 2^27");
        }
        if self.overlap > self.first_budget() / 4 {
            return refuse("overlap", self.overlap as f64, "at most a quarter of samples");
        }
        if !within(self.max_failed_share, 0.0, 1.0) {
            return refuse("max_failed_share", self.max_failed_share, "between 0 and 1");
        }
        self.opening(dimension).map(|_| ())
    }
}
