//! Several groups of observations that share parameters, each with a control axis and noise of its own.
//!
//! Given the parameters the groups are independent, so the joint log likelihood is the sum of theirs; each group's
//! inferred sigma is integrated out on its own, and recursive Bayes runs through the groups one after the other.

use crate::observations::Observations;
use crate::{Likelihood, Noise, NoiseError, Parameter, Problem, Simulator};
use std::ops::Range;

/// One group of observations: an experiment, or one observable of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name, as printed.
    pub name: String,
    /// Measured values on a control axis of their own.
    pub observations: Observations,
    /// Noise model.
    pub noise: Noise,
}

impl Group {
    /// A named group.
    pub fn new(name: impl Into<String>, observations: Observations, noise: Noise) -> Self {
        Self { name: name.into(), observations, noise }
    }
}

/// A calibration problem with several groups of observations.
///
/// The simulator gives the observables of all groups one after the other. With one group this is a [`Problem`], and
/// its posterior is the same to the bit.
#[derive(Clone)]
pub struct JointProblem<'a> {
    /// The simulator.
    pub simulator: &'a dyn Simulator,
    /// Parameters, in the order the simulator takes them.
    pub parameters: Vec<Parameter>,
    /// Groups, in the order in which the simulator gives them and in which they are assimilated.
    pub groups: Vec<Group>,
}

impl<'a> From<&Problem<'a>> for JointProblem<'a> {
    fn from(problem: &Problem<'a>) -> Self {
        Self {
            simulator: problem.simulator,
            parameters: problem.parameters.clone(),
            groups: vec![Group::new("", problem.observations.clone(), problem.noise.clone())],
        }
    }
}

impl JointProblem<'_> {
    /// Number of observations of all groups.
    pub fn observations(&self) -> usize {
        self.groups.iter().map(|g| g.observations.len()).sum()
    }

    /// Places of each group's observations among those of all.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        let mut first = 0;
        self.groups
            .iter()
            .map(|g| {
                let range = first..first + g.observations.len();
                first = range.end;
                range
            })
            .collect()
    }

    /// What moments are taken of: the coordinate of a parameter at its normal score.
    pub(crate) fn coordinate(&self) -> impl Fn(usize, f64) -> f64 + Sync + '_ {
        |j, z| {
            let prior = &self.parameters[j].prior;
            prior.to_coordinate(prior.from_z(z))
        }
    }

    /// Control values of all observations, group after group.
    pub(crate) fn control(&self) -> Vec<f64> {
        self.groups.iter().flat_map(|g| g.observations.control().iter().copied()).collect()
    }
}

/// The likelihood of all groups' curves, one after the other, under checked noise models.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointLikelihood {
    parts: Vec<Likelihood>,
    ranges: Vec<Range<usize>>,
}

impl JointLikelihood {
    /// Checks the noise models against the observations.
    pub(crate) fn new(problem: &JointProblem<'_>) -> Result<Self, NoiseError> {
        let several = problem.groups.len() > 1;
        let parts = problem
            .groups
            .iter()
            .map(|g| {
                if several && g.noise.is_tuned() {
                    return Err(NoiseError::TunedGroup { group: g.name.clone() });
                }
                let part = Likelihood::new(&g.noise, &g.observations);
                part.map_err(|error| if several { error.of_group(&g.name) } else { error })
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { parts, ranges: problem.ranges() })
    }

    /// Each group's likelihood and the places of its observations.
    pub(crate) fn groups(&self) -> impl Iterator<Item = (&Likelihood, Range<usize>)> {
        self.parts.iter().zip(self.ranges.iter().cloned())
    }

    /// Whether the noise of a group has more than its standard deviation.
    pub(crate) fn has_shape(&self) -> bool {
        self.parts.iter().any(Likelihood::has_shape)
    }

    /// The likelihood where there is one group.
    pub(crate) fn single(&self) -> Option<&Likelihood> {
        if let [one] = self.parts.as_slice() { Some(one) } else { None }
    }

    /// Log likelihood of all curves: the sum of the groups'.
    pub(crate) fn ln_joint(&self, outputs: &[f64]) -> f64 {
        if let Some(one) = self.single() {
            return one.ln_joint(outputs);
        }
        self.groups().map(|(part, range)| part.ln_joint(&outputs[range])).sum()
    }

    /// Log likelihood of the first 1, 2, .. observations, on through the groups.
    pub(crate) fn ln_cumulative(&self, outputs: &[f64], cumulative: &mut [f64]) {
        let mut before = 0.0;
        for (k, (part, range)) in self.groups().enumerate() {
            let cumulative = &mut cumulative[range.clone()];
            part.ln_cumulative(&outputs[range], cumulative);
            if k > 0 {
                cumulative.iter_mut().for_each(|c| *c += before);
            }
            before = cumulative[cumulative.len() - 1];
        }
    }

    /// Known standard deviation of observation `index`, counted through the groups.
    pub(crate) fn fixed_sigma(&self, index: usize) -> Option<f64> {
        self.groups()
            .find(|(_, range)| range.contains(&index))
            .and_then(|(part, range)| part.fixed_sigma(index - range.start))
    }
}
