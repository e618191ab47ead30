//! What the control variate is made of, and the share of each part.

use super::variate::metric;
use crate::gaussian_process::Found;
use crate::mixture::Proposal;
use crate::pool::Pool;
use crate::small_budget::StandIn;
use crate::surrogate::coefficients;
use std::sync::Arc;

/// Least share of a process whose own integrals are taken.
const LEAST_TRUSTED: f64 = 0.1;

/// What g is made of.
pub(super) enum MadeOf<'a> {
    /// Local quadratics, which measure distances by this factor of a covariance.
    Quadratics { metric: Vec<f64> },
    /// A process with this covariance through the samples of all other sub-nets; simulations fail as for that through all samples.
    Process { all: &'a StandIn<'a>, found: &'a Found },
    /// A process through the samples before a final stage alone, which are many.
    ProcessBefore(Arc<StandIn<'a>>),
}

impl<'a> MadeOf<'a> {
    fn quadratics(proposal: &Proposal) -> Option<Self> {
        Some(Self::Quadratics { metric: metric(proposal)? })
    }

    /// The ways to make g: by each covariance that was found for a process, and by local quadratics. All
    /// samples count where there are many dimensions or few samples, because the final stage alone misses what earlier ones found.
    /// `before` is how many samples are before a final stage, with the weights of all.
    pub(super) fn ways(
        pool: &'a Pool,
        proposal: &Proposal,
        process: Option<&'a StandIn<'a>>,
        before: Option<(usize, &[f64])>,
    ) -> Vec<Self> {
        let mut ways = Vec::new();
        if let Some(all) = process {
            ways.extend(all.process.found.iter().flatten().filter_map(|found| {
                Some(match before {
                    None => Self::Process { all, found },
                    Some((n, weights)) => {
                        Self::ProcessBefore(Arc::new(all.like(pool, weights, 0..n, found)?))
                    }
                })
            }));
        }
        if pool.len() >= 16 * coefficients(pool.d) {
            ways.extend(Self::quadratics(proposal));
        }
        ways
    }
}

/// A way to make g, and its share of the g of the evidence and of every moment.
pub(super) struct Part<'a> {
    pub made_of: MadeOf<'a>,
    pub shares: Vec<f64>,
}

impl Part<'_> {
    /// The share of integral a: of what lies below a level that of the evidence, as few samples in a tail would tell it badly.
    pub(super) fn share(&self, a: usize) -> f64 {
        self.shares.get(a).copied().unwrap_or(self.shares[0])
    }
}

/// Of the processes with a mean share of [`LEAST_TRUSTED`] and more: the covariance of the most probable one through all samples, where it
/// is one of them, or of that with the largest share.
///
/// The marginal likelihood says how well a covariance goes with the values, stacking how well it predicts the likelihood: of PS, from 200
/// simulations on, it preferred one whose integrals are 0.4 posterior standard deviations off, without a share.
pub(super) fn most_trusted<'a>(
    process: Option<&StandIn<'_>>,
    stack: &[Part<'a>],
) -> Option<&'a Found> {
    let of = |part: &Part<'a>| match part.made_of {
        MadeOf::Process { found, .. } => {
            Some((found, part.shares.iter().sum::<f64>() / part.shares.len() as f64))
        }
        _ => None,
    };
    let shares: Vec<(&Found, f64)> = stack.iter().filter_map(of).collect();
    trusted(&process?.process.covariance, &shares)
}

/// Of those with share enough: the probable one, or the one with the largest share.
fn trusted<'a, T: PartialEq>(probable: &T, shares: &[(&'a T, f64)]) -> Option<&'a T> {
    let enough = || shares.iter().filter(|(_, share)| *share >= LEAST_TRUSTED);
    let largest = || enough().max_by(|a, b| a.1.total_cmp(&b.1));
    enough().find(|(one, _)| *one == probable).or_else(largest).map(|(one, _)| *one)
}

#[cfg(test)]
mod tests {
    use super::super::{Control, Drawn};
    use super::*;
    use crate::sampler::Sampler;
    use crate::target::Target;
    use crate::{Settings, SimError};

    /// A smooth log likelihood of one parameter.
    struct Wave;

    impl Target for Wave {
        fn dimension(&self) -> usize {
            1
        }

        fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
            Ok((2.0 * z[0]).sin() - z[0] * z[0])
        }
    }

    #[test]
    fn a_process_for_a_final_stage_runs_through_samples_before_it_alone() {
        let settings = Settings { samples: 60, replicates: 4, ..Settings::default() };
        let run = || {
            let mut sampler = Sampler::new(&Wave, &settings);
            sampler.run().expect("never fails");
            sampler
        };
        let (one, mut other_end, mut other_begin) = (run(), run(), run());
        let n = one.final_stage().expect("has one").0;
        let first = 60 - n;
        other_end.pool.ln_l[first..].iter_mut().for_each(|ln_l| *ln_l += 1.0);
        other_begin.pool.ln_l[..first].iter_mut().for_each(|ln_l| *ln_l += 1.0);
        let (weights, zeros) = (vec![1.0; 60], vec![0.0; n]);
        let process = StandIn::of_all(&Wave, &one.pool, &weights).expect("has spread");
        let value = |sampler: &Sampler<'_>| {
            let proposal = sampler.final_stage().expect("has one").1;
            let drawn = Drawn { first, proposal, ln_q: &zeros, ln_w: &zeros };
            let control = Control::new(sampler, (&weights, 0.0), &drawn, &|_, z| z, Vec::new());
            let before = Some((first, &weights[..]));
            let made_of = &MadeOf::ways(&sampler.pool, proposal, Some(&process), before)[0];
            [0, 1].map(|fold| {
                let fold = control.fold(made_of, fold).expect("has spread");
                fold.variate.at(&[0.3], 3.0, &mut Vec::new())
            })
        };
        let [of_one, of_end, of_begin] = [&one, &other_end, &other_begin].map(value);
        assert!(of_one[0] > 0.0, "{of_one:?}");
        assert_eq!(of_one, of_end);
        assert!((of_begin[0] / of_one[0] - 1.0f64.exp()).abs() < 1e-6, "{of_begin:?} {of_one:?}");
    }

    #[test]
    fn what_is_probable_is_trusted_from_a_tenth_on_and_else_what_has_the_largest_share() {
        let shares = |probable: f64| [(&'a', 0.3), (&'b', probable), (&'c', 0.6)];
        assert_eq!(trusted(&'b', &shares(0.1)), Some(&'b'));
        assert_eq!(trusted(&'b', &shares(0.099)), Some(&'c'));
        assert_eq!(trusted(&'d', &shares(0.1)), Some(&'c'));
        assert_eq!(trusted(&'d', &[(&'d', 0.099)]), None);
        assert_eq!(trusted(&'d', &[]), None);
    }
}
