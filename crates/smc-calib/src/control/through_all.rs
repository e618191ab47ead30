//! Integrals of the likelihood that one process through all samples predicts, and how far they are believed beside those that
//! every sub-net knows with a process through the others.
//!
//! Where the process knows the likelihood, its own integrals are far better: they have no noise of residuals at samples in the tail.
//! How well it knows it, its own draws tell, and they are as sure as its covariance is right: on smooth likelihoods their error is two
//! to ten times what they say. The sub-nets tell without it, but no more than their own noise shows. The standard error that counts lies
//! midway between the two, as their geometric mean, unless the draws say the larger one; a process that is further off the
//! sub-nets than [`FOUND_OUT`] standard errors of both has the error with which it would not be. Where they part, both are known less well
//! ([`mean_of_two`]). What no sample has shown, both miss alike: but for the points that each is integrated with, the errors of the process
//! go together with those of the sub-nets ([`TOGETHER`]).

use super::variate::{mean, off_by_nets, scatter};
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};
use rayon::prelude::*;

/// Points that it is integrated with, and nets that they are: few large ones have far smaller an error together than many small ones.
const POINTS: usize = 16_384;
const NETS: usize = 4;

/// Difference, in standard errors, beyond which the process is found to be wrong.
const FOUND_OUT: f64 = 5.0;

/// Correlation of the errors of the sub-nets and of the process, but for the points that each is integrated with: over 24 to 50 seeds
/// .68 to .87 for PS, PA12, PEEK, the banana and the bounded ridge at 50 simulations, .44 to .75 at 100, points included (a third of
/// the banana's variance there, next to nothing of the others'). Taken as independent, PA12 has
/// errors of 1.6 standard errors at 50 simulations, 1.1 at 100 and 1.3 at 300, and so 1.3, 0.9 and 1.1.
const TOGETHER: f64 = 0.7;

/// The p integrals of g phi by some nets, and what the logarithm of the first and the ratios of the others to it are off by in draws of what
/// the process does not know, row by row.
pub(super) struct ThroughAll {
    pub of_nets: Vec<f64>,
    pub off: Vec<f64>,
}

/// The integrals by every net, row by row, as `integrate` adds them to zeros for the points of a net of this width.
pub(super) fn of_nets(
    width: usize,
    p: usize,
    seed: u64,
    integrate: &(dyn Fn(&[f64], &mut [f64]) + Sync),
) -> Vec<f64> {
    let mut of_nets = vec![0.0; NETS * p];
    of_nets.par_chunks_mut(p).enumerate().for_each(|(k, sums)| {
        let mut rng = stream(seed, Purpose::Surrogate, 1, k);
        integrate(&scrambled_net(width, POINTS / NETS, &mut rng), sums);
    });
    of_nets
}

/// Logarithm of the first integral, the others over it, and how unsure all are.
struct Ratios {
    values: Vec<f64>,
    unsure: Vec<Unsure>,
}

/// Means over rows of p integrals.
pub(super) fn means(rows: &[f64], p: usize) -> Vec<f64> {
    (0..p).map(|a| mean(rows, p, a)).collect()
}

/// Deviations of the ratios of every row from those of `means`, to first order.
fn deviations(rows: &[f64], means: &[f64]) -> Vec<f64> {
    let of = |row: &[f64]| -> Vec<f64> {
        let first = row[0] / means[0];
        let rest =
            row.iter().zip(means).skip(1).map(|(m, mean)| m / means[0] - first * mean / means[0]);
        std::iter::once(first - 1.0).chain(rest).collect()
    };
    rows.chunks_exact(means.len()).flat_map(of).collect()
}

/// Variances of the mean of independent rows of p deviations.
fn variances(deviations: &[f64], p: usize) -> Vec<f64> {
    let n = (deviations.len() / p) as f64;
    (0..p).map(|a| scatter(deviations, p, a) / (n * (n - 1.0))).collect()
}

impl Ratios {
    fn values(means: &[f64]) -> Vec<f64> {
        std::iter::once(means[0].ln()).chain(means[1..].iter().map(|m| m / means[0])).collect()
    }

    /// None where there is no likelihood, or nothing is known of its errors.
    fn of(all: &ThroughAll, p: usize) -> Option<Self> {
        let means = means(&all.of_nets, p);
        let draws = all.off.len() / p;
        if means[0].is_nan() || means[0] <= 0.0 || draws < 2 {
            return None;
        }
        // Draws are one by one, nets are for their mean.
        let of_draws = variances(&all.off, p);
        let of_nets = variances(&deviations(&all.of_nets, &means), p);
        let unsure = of_draws.iter().zip(of_nets).map(|(of_draws, of_nets)| {
            let of_likelihood = draws as f64 * of_draws;
            Unsure { variance: of_likelihood + of_nets, of_likelihood, of_nets }
        });
        Some(Self { unsure: unsure.collect(), values: Self::values(&means) })
    }

    /// By R sub-nets, whose rows of integrals deviate so from these means, each with its two nets for them. Both the variance and its part by the nets are
    /// known to about two over the root of R; half of that at least counts as of the likelihood, or draws would be believed by chance.
    fn of_sub_nets(deviating: &[f64], of_nets: &[f64], means: &[f64]) -> Self {
        let p = means.len();
        let r = (deviating.len() / p) as f64;
        let mut off = off_by_nets(of_nets, p);
        off.iter_mut().zip(means.iter().cycle()).for_each(|(off, mean)| *off += mean);
        let off = deviations(&off, means);
        let of_all = variances(deviating, p).into_iter().enumerate();
        let unsure = of_all.map(|(a, variance)| {
            let squares: f64 = off.iter().skip(a).step_by(p).map(|off| off * off).sum();
            let of_nets = squares / (r * r);
            let of_likelihood = (variance - of_nets).max(variance / r.sqrt());
            Unsure { variance, of_likelihood, of_nets }
        });
        Self { unsure: unsure.collect(), values: Self::values(means) }
    }
}

/// Variance of an estimate: by what is not known of the likelihood, and by the points that it is integrated with. Of the sub-nets all three
/// are told for themselves and need not add up.
#[derive(Clone, Copy)]
struct Unsure {
    variance: f64,
    of_likelihood: f64,
    of_nets: f64,
}

/// Of the estimates of one number by the sub-nets and by the process, and this square of their difference: the share of
/// the second in their mean, and the variance of the mean over that of the first.
///
/// Where the process says that it knows more, it is taken as midway between both: for the share the whole of its variance, for the variance
/// of the mean what is not known of the likelihood. Errors of the likelihood go together, those of points are independent. The share is
/// that for independent errors: with the one that is best for the correlation PS and PA12 are 6 % further off at 50 simulations.
///
/// Estimates further apart than their errors tell are known less well: the variance of the mean grows with the square of their
/// difference over the sum of their variances (R. T. Birge, Phys. Rev. 40 (1932) 207), up to that of the first and the square of the way
/// from it. Sum and bound are those for independent errors: where the process is known worse, what is said stays up to an eighth too small.
fn mean_of_two(sub_nets: Unsure, process: Unsure, square: f64) -> (f64, f64) {
    let (first, midway) = (sub_nets.variance, |a: f64, b: f64| a.max((b * a).sqrt()));
    // With this variance of the second the two are as far apart as that.
    let apart = square / FOUND_OUT.powi(2) - first;
    let at_least_apart = |second: f64| if apart > second { apart } else { second };
    let share = first / (first + at_least_apart(midway(process.variance, first)));
    let unknown = midway(process.of_likelihood, sub_nets.of_likelihood);
    let second = at_least_apart(process.of_nets + unknown);
    let together = TOGETHER * (sub_nets.of_likelihood * unknown).sqrt();
    let rest = 1.0 - share;
    let variance = rest * rest * first + share * share * second + 2.0 * share * rest * together;
    let left = variance / first * (square / (first + second)).max(1.0);
    let left = left.min(1.0 + share * share * square / first);
    if first > 0.0 && square.is_finite() && left.is_finite() { (share, left) } else { (0.0, 1.0) }
}

impl ThroughAll {
    /// Errors of integrals with the means of these rows that to first order are off by as much.
    pub(super) fn errors(&self, of_sub_nets: &[f64], p: usize) -> Vec<f64> {
        let means = means(of_sub_nets, p);
        let of = |off: &[f64]| -> Vec<f64> {
            let each = means.iter().zip(off).enumerate();
            each.map(|(a, (m, e))| if a == 0 { m * e } else { m * off[0] + means[0] * e }).collect()
        };
        self.off.chunks_exact(p).flat_map(of).collect()
    }

    /// Takes a share of this into the p integrals of the sub-nets, which then spread as their mean is known; the part of the variance
    /// of each that is left. `of_nets` are two nets of integrals of each sub-net.
    pub(super) fn mixed_into(
        &self,
        of_sub_nets: &mut [f64],
        of_nets: &[f64],
        p: usize,
    ) -> Vec<f64> {
        assert_eq!(of_nets.len(), 2 * of_sub_nets.len(), "two nets for every sub-net");
        let means = means(of_sub_nets, p);
        let Some(known) = Ratios::of(self, p).filter(|_| means[0] > 0.0) else {
            return vec![1.0; p];
        };
        let mut off = deviations(of_sub_nets, &means);
        let own = Ratios::of_sub_nets(&off, of_nets, &means);
        let mixed = |a: usize| {
            let way = known.values[a] - own.values[a];
            let (share, left) = mean_of_two(own.unsure[a], known.unsure[a], way * way);
            (if share > 0.0 { own.values[a] + share * way } else { own.values[a] }, left)
        };
        let (values, left): (Vec<f64>, Vec<f64>) = (0..p).map(mixed).unzip();
        let evidence = values[0].exp();
        for (row, off) in of_sub_nets.chunks_exact_mut(p).zip(off.chunks_exact_mut(p)) {
            off.iter_mut().zip(&left).for_each(|(off, left)| *off *= left.sqrt());
            row[0] = evidence * (1.0 + off[0]);
            for a in 1..p {
                row[a] = evidence * (values[a] * (1.0 + off[0]) + off[a]);
            }
        }
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::normals;

    const P: usize = 3;

    /// Rows of three integrals around these, off by standard normal numbers times `sds`.
    fn rows(n: usize, around: [f64; P], sds: [f64; P], seed: usize) -> Vec<f64> {
        let mut rng = stream(5, Purpose::Surrogate, 7, seed);
        let off = normals(n * P, &mut rng);
        off.iter().enumerate().map(|(i, x)| around[i % P] + sds[i % P] * x).collect()
    }

    /// Two nets for every sub-net, without an error.
    fn twice(of_sub_nets: &[f64]) -> Vec<f64> {
        of_sub_nets.chunks_exact(P).flat_map(|row| row.repeat(2)).collect()
    }

    /// Errors of two estimates over runs, by the likelihood and by points: of every sub-net, in tenths, and of the process; what its draws
    /// say of the former; and the correlation of the errors of the likelihood.
    struct Errors {
        sub_nets: [f64; 2],
        process: [f64; 2],
        of_draws: f64,
        correlation: f64,
    }

    impl Errors {
        /// Where integrals are exact.
        fn of_likelihood(of_draws: f64, error: f64, correlation: f64) -> Self {
            Self { sub_nets: [1.0, 0.0], process: [error, 0.0], of_draws, correlation }
        }
    }

    /// Root mean square of error over standard error of the three, and of their errors.
    fn over_runs(known: &Errors) -> ([f64; P], [f64; P]) {
        const RUNS: usize = 4000;
        const R: usize = 12;
        let exact = [2.0, 0.6, -0.2];
        let Errors { sub_nets, process, of_draws, correlation } = known;
        let [unknown, points] = sub_nets.map(|sd| 0.1 * sd);
        let (mut z, mut errors) = ([0.0; P], [0.0; P]);
        for run in 0..RUNS {
            let seed = |k: usize| 5 * run + k;
            let of_likelihood = rows(R, exact, [unknown; P], seed(0));
            // A sub-net's integrals are the mean of its two nets.
            let of_nets = rows(2 * R, [0.0; P], [points * 2.0_f64.sqrt(); P], seed(1));
            let of_points = (0..R * P).map(|i| {
                let first = 2 * P * (i / P) + i % P;
                0.5 * (of_nets[first] + of_nets[first + P])
            });
            let mut of_sub_nets: Vec<f64> =
                of_likelihood.iter().zip(of_points).map(|(a, b)| a + b).collect();
            let own = means(&of_likelihood, P);
            let rest = rows(1, [0.0; P], [process[0]; P], seed(2));
            let off = rows(NETS, [0.0; P], [process[1] * (NETS as f64).sqrt(); P], seed(3));
            let of_process = off.iter().enumerate().map(|(i, off)| {
                let a = i % P;
                let shared = (own[a] - exact[a]) / (unknown / (R as f64).sqrt());
                let alone = (1.0 - correlation * correlation).sqrt();
                exact[a] + process[0] * correlation * shared + alone * rest[a] + off
            });
            let all = ThroughAll {
                of_nets: of_process.collect(),
                off: deviations(&rows(200, [0.0; P], [*of_draws; P], seed(4)), &exact),
            };
            all.mixed_into(&mut of_sub_nets, &of_nets, P);
            let means = means(&of_sub_nets, P);
            let variances = variances(&deviations(&of_sub_nets, &means), P);
            let values = Ratios::values(&means);
            for (a, exact) in Ratios::values(&exact).iter().enumerate() {
                let square = (values[a] - exact).powi(2) / RUNS as f64;
                errors[a] += square;
                z[a] += square / variances[a];
            }
        }
        (z.map(f64::sqrt), errors.map(f64::sqrt))
    }

    #[test]
    fn two_estimates_together_have_the_error_that_they_say() {
        // Of sub-nets 0.1 / sqrt(12); the process as good, worse, and as much better as its draws and three times less so.
        for (of_draws, error) in [(0.03, 0.03), (0.1, 0.1), (0.001, 0.005)] {
            let (z, _) = over_runs(&Errors::of_likelihood(of_draws, error, TOGETHER));
            assert!(z.iter().all(|z| (0.8..1.25).contains(z)), "{of_draws} {error}: {z:?}");
        }
    }

    #[test]
    fn two_estimates_have_the_error_that_they_say_where_it_is_of_points() {
        // Of points nearly all of it, half of it, and a few hundredths; draws say as much as there is, or a third.
        for (of_likelihood, process, of_draws) in [
            (0.1, [0.001, 0.02], 0.001),
            (0.7, [0.01, 0.01], 0.01),
            (0.7, [0.01, 0.002], 0.0033),
            (0.98, [0.01, 0.002], 0.0033),
        ] {
            let of_points = (1.0_f64 - of_likelihood * of_likelihood).sqrt();
            let sub_nets = [of_likelihood, of_points];
            let (z, _) = over_runs(&Errors { sub_nets, process, of_draws, correlation: TOGETHER });
            assert!(z.iter().all(|z| (0.75..1.25).contains(z)), "{sub_nets:?} {process:?}: {z:?}");
        }
    }

    #[test]
    fn errors_that_do_not_go_together_are_stated_up_to_a_half_too_large() {
        let (z, _) = over_runs(&Errors::of_likelihood(0.03, 0.03, 0.0));
        assert!(z.iter().all(|z| (2.0 / 3.0..0.9).contains(z)), "{z:?}");
    }

    #[test]
    fn errors_of_the_points_that_a_process_is_integrated_with_are_its_own() {
        // The variance of a draw, and of the mean of two nets, are 2 x^2 and y^2 over the square of the evidence.
        for (draw, net) in [(0.1, 0.0), (0.1, 0.2), (0.0, 0.1)] {
            let off = |by: f64| [2.0 + by, 0.6, -0.2].into_iter().chain([2.0 - by, 0.6, -0.2]);
            let errors = [draw, 0.0, 0.0, -draw, 0.0, 0.0];
            let all = ThroughAll {
                of_nets: off(net).collect(),
                off: deviations(&errors, &[2.0, 0.6, -0.2]),
            };
            let found = Ratios::of(&all, P).expect("has errors").unsure[0];
            let exact = [2.0 * draw * draw + net * net, net * net].map(|square| square / 4.0);
            assert!((found.variance - exact[0]).abs() < 1e-12, "{draw} {net}: {}", found.variance);
            assert!((found.of_nets - exact[1]).abs() < 1e-12, "{draw} {net}: {}", found.of_nets);
        }
    }

    #[test]
    fn errors_of_the_points_that_sub_nets_are_integrated_with_are_the_half_differences_of_their_nets()
     {
        // Of three sub-nets around 2 the first two have nets that differ by 0.4 and 0.2: (0.2^2 + 0.1^2) / 9, over 2^2.
        let of_nets = [[2.2, 0.6, -0.2], [1.8, 0.6, -0.2], [2.4, 0.6, -0.2], [2.6, 0.6, -0.2]];
        let of_nets = [of_nets.concat(), [1.5, 0.6, -0.2].repeat(2)].concat();
        let rows = [[2.0, 0.6, -0.2], [2.5, 0.6, -0.2], [1.5, 0.6, -0.2]].concat();
        let of = |rows: &[f64]| {
            let means = means(rows, P);
            Ratios::of_sub_nets(&deviations(rows, &means), &of_nets, &means)
        };
        let found = of(&rows);
        assert!(
            (found.unsure[0].of_nets - 0.05 / 36.0).abs() < 1e-12,
            "{}",
            found.unsure[0].of_nets
        );
        let Unsure { variance, of_likelihood, of_nets: points } = found.unsure[0];
        assert!((variance - 0.5 / 24.0).abs() < 1e-12, "{variance}");
        assert!((of_likelihood - (variance - points)).abs() < 1e-12, "{of_likelihood}");
        // The others over it are off by as much of themselves, 0.3 and -0.1.
        for (a, ratio) in [(1, 0.3_f64), (2, -0.1)] {
            let exact = ratio * ratio * 0.05 / 36.0;
            assert!((found.unsure[a].of_nets - exact).abs() < 1e-12, "{a}");
        }
        // Of three sub-nets that hardly differ it is taken that 1 / sqrt(3) of the variance is of the likelihood.
        let alike = [[2.0, 0.6, -0.2], [2.001, 0.6, -0.2], [1.999, 0.6, -0.2]].concat();
        let found = of(&alike).unsure[0];
        assert!((found.of_likelihood / found.variance - 1.0 / 3.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_mean_of_two_estimates_has_the_variance_of_errors_that_go_together_but_for_those_of_nets()
    {
        let both = |of_likelihood: f64, of_nets: f64| Unsure {
            variance: of_likelihood + of_nets,
            of_likelihood,
            of_nets,
        };
        let (nets, unknown) = (|of_nets: f64| both(0.0, of_nets), |of: f64| both(of, 0.0));
        // As well known as each other; what is not known of the likelihood goes together, and nothing with nets.
        assert_eq!(mean_of_two(nets(1.0), nets(1.0), 0.0), (0.5, 0.5));
        assert_eq!(mean_of_two(nets(1.0), unknown(1.0), 0.0), (0.5, 0.5));
        assert_eq!(mean_of_two(unknown(1.0), nets(1.0), 0.0), (0.5, 0.5));
        let (share, left) = mean_of_two(unknown(1.0), unknown(1.0), 0.0);
        assert!(share == 0.5 && (left - 0.5 * (1.0 + TOGETHER)).abs() < 1e-12, "{left}");
        let (_, left) = mean_of_two(both(0.5, 0.5), both(0.5, 0.5), 0.0);
        assert!((left - 0.5 * (1.0 + 0.5 * TOGETHER)).abs() < 1e-12, "{left}");
        // A process that says it knows ten times as well is taken as midway, nets as what they are.
        let (share, left) = mean_of_two(unknown(1.0), unknown(0.01), 0.0);
        let rest = 1.0 - share;
        let exact =
            rest * rest + 0.1 * share * share + 2.0 * share * rest * TOGETHER * 0.1_f64.sqrt();
        assert!((share - 1.0 / 1.1).abs() < 1e-12 && (left - exact).abs() < 1e-12, "{left}");
        let (share, left) = mean_of_two(nets(1.0), nets(0.01), 0.0);
        let exact = (0.1_f64 / 1.1).powi(2) + 0.01 / 1.1_f64.powi(2);
        assert!((share - 1.0 / 1.1).abs() < 1e-12 && (left - exact).abs() < 1e-12, "{left}");
    }

    #[test]
    fn the_mean_of_two_estimates_knows_less_the_further_they_part() {
        let unknown = |variance: f64| Unsure { variance, of_likelihood: variance, of_nets: 0.0 };
        let of = |square: f64| mean_of_two(unknown(1.0), unknown(0.01), square);
        // Three standard errors apart its own is three times that; found out, it takes little and adds little.
        let (share, left) = of(9.0 * 1.1);
        assert!((share - 1.0 / 1.1).abs() < 1e-12 && (left / of(0.0).1 - 9.0).abs() < 1e-12);
        let (share, left) = of(1e4);
        assert!((share - 0.0025).abs() < 1e-12 && (left - 1.0625).abs() < 1e-12, "{share} {left}");
        // No step on the way, and never more than what the other says and the way from it.
        let mut before = 0.0;
        for k in 0..40_000 {
            let square = (0.001 * f64::from(k)).powi(2);
            let (share, left) = of(square);
            assert!(left <= 1.0 + share * share * square + 1e-12, "{square}: {left}");
            assert!(k == 0 || (left - before).abs() < 0.02, "{square}: {before} {left}");
            before = left;
        }
        for (first, second) in [(0.0, 0.0), (0.0, 1.0), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            let found = mean_of_two(unknown(first), unknown(second), 1.0);
            assert_eq!(found, (0.0, 1.0), "{first} {second}");
        }
        for square in [f64::NAN, f64::INFINITY] {
            assert_eq!(mean_of_two(unknown(1.0), unknown(1.0), square), (0.0, 1.0));
        }
    }

    #[test]
    fn a_process_that_knows_more_takes_most_of_the_error_away() {
        let (_, alone) = over_runs(&Errors::of_likelihood(1e9, 0.0, 0.0));
        let (_, with) = over_runs(&Errors::of_likelihood(0.001, 0.002, 0.0));
        assert!(
            with.iter().zip(&alone).all(|(with, alone)| with < &(0.25 * alone)),
            "{with:?} {alone:?}"
        );
    }

    #[test]
    fn a_process_that_is_sure_and_wrong_is_found_out() {
        let mut of_sub_nets = rows(12, [2.0, 0.6, -0.2], [0.1; P], 1);
        let before = of_sub_nets.clone();
        let wrong = ThroughAll {
            of_nets: [4.0, 0.2, 1.0].repeat(2),
            off: rows(50, [0.0; P], [0.001; P], 2),
        };
        let left = wrong.mixed_into(&mut of_sub_nets, &twice(&before), P);
        assert!(left.iter().all(|left| (1.0..5.0).contains(left)), "{left:?}");
        let off = |a: usize| (mean(&of_sub_nets, P, a) - mean(&before, P, a)).abs();
        assert!((0..P).all(|a| off(a) < 0.1), "{of_sub_nets:?}");
    }

    #[test]
    fn what_the_evidence_shares_with_a_mean_is_no_error_of_the_mean() {
        // Draws that make all integrals larger or smaller alike, and sub-nets too.
        let around = [2.0, 0.6, -0.2];
        let alike = |factors: &[f64]| -> Vec<f64> {
            factors.iter().flat_map(|f| around.map(|m| f * m)).collect()
        };
        let all =
            ThroughAll { of_nets: alike(&[1.0, 1.0]), off: vec![0.3, 0.0, 0.0, -0.3, 0.0, 0.0] };
        let known = Ratios::of(&all, P).expect("has errors");
        let variances: Vec<f64> = known.unsure.iter().map(|unsure| unsure.variance).collect();
        assert!(variances[0] > 0.01, "{variances:?}");
        assert!(variances[1..].iter().all(|v| *v < 1e-20), "{variances:?}");
        let mut of_sub_nets = alike(&[0.9, 1.0, 1.1]);
        let of_nets = twice(&of_sub_nets);
        all.mixed_into(&mut of_sub_nets, &of_nets, P);
        for row in of_sub_nets.chunks_exact(P) {
            assert!((row[1] / row[0] - 0.3).abs() < 1e-12 && (row[2] / row[0] + 0.1).abs() < 1e-12);
        }
    }

    #[test]
    fn nothing_is_taken_of_a_process_without_a_likelihood_or_without_draws() {
        let of_sub_nets = rows(4, [2.0, 0.6, -0.2], [0.1; P], 1);
        for (of_nets, off) in [(vec![0.0; 6], vec![0.1; 6]), (vec![1.0; 6], Vec::new())] {
            let (mut same, alike) = (of_sub_nets.clone(), twice(&of_sub_nets));
            let left = ThroughAll { of_nets, off }.mixed_into(&mut same, &alike, P);
            assert_eq!(left, [1.0; P]);
            assert_eq!(same, of_sub_nets);
        }
    }
    #[test]
    fn errors_of_integrals_are_off_by_what_draws_are() {
        let off = [0.1, 0.02, -0.03, -0.2, 0.0, 0.01];
        let of_sub_nets = [1.8, 0.5, -0.3, 2.2, 0.7, -0.1];
        let all = ThroughAll { of_nets: vec![9.0; 6], off: off.to_vec() };
        let means = [2.0, 0.6, -0.2];
        let errors = all.errors(&of_sub_nets, P);
        let integrals: Vec<f64> =
            errors.iter().zip(means.iter().cycle()).map(|(e, m)| e + m).collect();
        let found = deviations(&integrals, &means);
        assert!(found.iter().zip(off).all(|(found, off)| (found - off).abs() < 1e-12), "{found:?}");
    }
}
