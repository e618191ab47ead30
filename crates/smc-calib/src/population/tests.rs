use super::*;
use crate::sobol::scrambled_net;
use crate::{Prior, PriorSpec};

/// A member with a normal likelihood of this centre and standard deviations, correlated by `r` between neighbours, under priors
/// of its own: importance samples from a wider normal.
struct Made {
    centre: Vec<f64>,
    sd: Vec<f64>,
    r: f64,
    priors: Vec<PriorSpec>,
}

impl Made {
    fn factor(&self) -> Vec<f64> {
        let d = self.centre.len();
        let mut all = vec![0.0; d * d];
        for i in 0..d {
            for j in 0..d {
                let r = self.r.powi((i as i32 - j as i32).abs());
                all[i * d + j] = self.sd[i] * self.sd[j] * r;
            }
        }
        crate::cholesky::cholesky(&all, d).expect("positive definite")
    }

    fn member(&self, n: usize, seed: u64) -> Member {
        let (d, factor) = (self.centre.len(), self.factor());
        let inverse = crate::cholesky::packed_inverse(&factor, d);
        let priors: Vec<Prior> =
            self.priors.iter().map(|spec| Prior::new(spec.clone()).expect("a prior")).collect();
        let net = scrambled_net(d, n, &mut stream(seed, Purpose::Truth, 0, 0));
        let wide = 1.5;
        let mut samples = MemberSamples {
            name: "made".to_owned(),
            support: priors.iter().map(|p| [p.support().0, p.support().1]).collect(),
            ..MemberSamples::default()
        };
        let mut sum = 0.0;
        for u in net.chunks_exact(d) {
            let normals: Vec<f64> = u.iter().map(|u| wide * normal::quantile(*u)).collect();
            let whole = Population {
                mean: self.centre.clone(),
                spread: Vec::new(),
                correlation: Vec::new(),
                factor: factor.clone(),
            };
            let x = whole.member(&normals);
            let ln_prior: f64 = priors.iter().zip(&x).map(|(p, x)| p.ln_density(*x)).sum();
            let square = crate::mixture::distance2(&inverse, &self.centre, &x);
            let ln_det: f64 = (0..d).map(|i| factor[i * d + i].ln()).sum();
            let ln_peak = -ln_det - d as f64 * normal::LN_SQRT_2PI;
            let ln_l = ln_peak - 0.5 * square;
            let ln_q = ln_peak - 0.5 * square / (wide * wide) - d as f64 * f64::ln(wide);
            let weight = (ln_l + ln_prior - ln_q).exp();
            sum += weight;
            samples.coordinates.extend(x);
            samples.ln_prior.push(ln_prior);
            samples.ln_likelihood.push(ln_l);
            samples.weights.push(weight);
        }
        samples.log_evidence = (sum / n as f64).ln();
        Member::new(&samples, seed).expect("a member")
    }

    /// Likelihood of a population in closed form.
    fn ln_exact(&self, population: &Population) -> f64 {
        let d = self.centre.len();
        let own = self.factor();
        let square = |f: &[f64], i: usize, j: usize| {
            (0..d).map(|k| f[i * d + k] * f[j * d + k]).sum::<f64>()
        };
        let sum: Vec<f64> = (0..d * d)
            .map(|at| square(&own, at / d, at % d) + square(&population.factor, at / d, at % d))
            .collect();
        let factor = crate::cholesky::cholesky(&sum, d).expect("positive definite");
        let inverse = crate::cholesky::packed_inverse(&factor, d);
        let ln_det: f64 = (0..d).map(|i| factor[i * d + i].ln()).sum();
        let square = crate::mixture::distance2(&inverse, &population.mean, &self.centre);
        -ln_det - d as f64 * normal::LN_SQRT_2PI - 0.5 * square
    }
}

fn flat(d: usize) -> Vec<PriorSpec> {
    vec![PriorSpec::Uniform { lower: -8.0, upper: 8.0 }; d]
}

fn hyperprior(d: usize, correlation: Option<f64>) -> Hyperprior {
    Hyperprior { mean: vec![[-4.0, 4.0]; d], spread: vec![0.3; d], correlation }
}

#[test]
fn the_likelihood_of_a_population_is_that_of_the_convolved_normals_however_narrow_it_is() {
    for d in 1..=3 {
        let normals = (0..d).map(|j| PriorSpec::Normal { mean: 0.5 * j as f64, sd: 1.5 });
        for priors in [flat(d), normals.collect()] {
            let centre: Vec<f64> = (0..d).map(|j| 0.4 - 0.3 * j as f64).collect();
            let made = Made { centre, sd: vec![0.2; d], r: 0.7, priors };
            let member = made.member(4096, 3);
            for (spread, shift) in
                [(1.0, 0.5), (0.3, 0.2), (0.1, 0.1), (0.03, 0.1), (1e-3, 0.2), (1e-6, 0.0)]
            {
                let population = Population {
                    mean: made.centre.iter().map(|c| c + shift).collect(),
                    spread: vec![spread; d],
                    correlation: vec![0.0; d * (d - 1) / 2],
                    factor: (0..d * d)
                        .map(|at| if at % (d + 1) == 0 { spread } else { 0.0 })
                        .collect(),
                };
                let (found, exact) =
                    (member.ln_likelihood(&population), made.ln_exact(&population));
                let error = found.ln - exact;
                assert!(error.abs() < 0.1, "d {d}, spread {spread}: {found:?}, exact {exact}");
                assert_eq!(found.fitted, found.effective < FEW_EFFECTIVE);
                let wide = spread > 0.5;
                assert!(!(wide && found.fitted), "{found:?}");
                assert!(found.fitted || spread > 0.01, "{found:?}");
            }
        }
    }
}

#[test]
fn a_likelihood_that_ends_at_the_bound_of_the_prior_gives_nothing_beyond() {
    // Flat over the support: the likelihood of a population is its share within.
    let n = 4096;
    let net = scrambled_net(1, n, &mut stream(5, Purpose::Truth, 0, 0));
    let samples = MemberSamples {
        name: "flat".to_owned(),
        coordinates: net,
        ln_prior: vec![0.0; n],
        ln_likelihood: vec![0.0; n],
        weights: vec![1.0; n],
        log_evidence: 0.0,
        support: vec![[0.0, 1.0]],
    };
    let member = Member::new(&samples, 1).expect("a member");
    for (mean, sd) in [(0.5, 0.2), (0.9, 0.1), (1.0, 0.1), (0.5, 0.004), (0.99, 0.004), (1.1, 0.2)]
    {
        let population = Population {
            mean: vec![mean],
            spread: vec![sd],
            correlation: Vec::new(),
            factor: vec![sd],
        };
        let exact = normal::cdf((1.0 - mean) / sd) - normal::cdf(-mean / sd);
        let found = member.ln_likelihood(&population);
        assert!((found.ln - exact.ln()).abs() < 0.1, "{mean} {sd}: {found:?}, {}", exact.ln());
        assert!((member.outside(&population)[0] - (1.0 - exact)).abs() < 1e-12);
    }
}

/// Posterior of mean and spread of a population in one dimension by quadrature over the spread; the mean is integrated in
/// closed form. Gives mean and sd of both, mean and sd of the next member, and the log evidence.
fn exact_hierarchy(centres: &[f64], sds: &[f64], scale: f64, width: f64) -> [f64; 7] {
    let steps = 4000;
    let (mut sums, mut total) = ([0.0; 6], 0.0);
    for k in 0..steps {
        let tau = 5.0 * scale * (f64::from(k) + 0.5) / f64::from(steps);
        let precisions = sds.iter().map(|s| 1.0 / (s * s + tau * tau));
        let all: f64 = precisions.clone().sum();
        let centre = precisions.clone().zip(centres).map(|(p, c)| p * c).sum::<f64>() / all;
        let square: f64 =
            precisions.clone().zip(centres).map(|(p, c)| p * (c - centre).powi(2)).sum();
        let ln_det: f64 = precisions.map(f64::ln).sum();
        let members = centres.len() as f64;
        let ln =
            0.5 * (ln_det - all.ln() - square) - (members - 1.0) * normal::LN_SQRT_2PI - width.ln();
        let half_normal = 2.0 * normal::ln_density(tau / scale).exp() / scale;
        let weight = ln.exp() * half_normal * 5.0 * scale / f64::from(steps);
        total += weight;
        let variance = 1.0 / all;
        let terms = [centre, centre * centre + variance, tau, tau * tau];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        sums[4] += weight * (centre * centre + variance + tau * tau);
    }
    let [m, m2, t, t2, n2, _] = sums.map(|sum| sum / total);
    let sd = |second: f64, first: f64| (second - first * first).sqrt();
    [m, sd(m2, m), t, sd(t2, t), m, sd(n2, m), total.ln()]
}

#[test]
fn a_conjugate_hierarchy_gives_the_moments_and_evidence_of_quadrature() {
    let centres = [0.1, 0.35, -0.2, 0.5, 0.2];
    let sds = [0.05, 0.1, 0.07, 0.2, 0.02];
    let members = || -> Vec<Member> {
        let each = centres.iter().zip(&sds).enumerate();
        each.map(|(k, (c, s))| {
            // Every other member had a normal prior: what it was calibrated under makes no difference.
            let prior = match k % 2 {
                0 => PriorSpec::Uniform { lower: -8.0, upper: 8.0 },
                _ => PriorSpec::Normal { mean: 0.4, sd: 1.0 },
            };
            Made { centre: vec![*c], sd: vec![*s], r: 0.0, priors: vec![prior] }
                .member(4096, k as u64)
        })
        .collect()
    };
    let problem = |members: Vec<Member>| PopulationProblem {
        parameters: vec![("x".to_owned(), "1".to_owned(), Coordinate::Linear)],
        hyperprior: hyperprior(1, None),
        members,
    };
    let settings = Settings { samples: 8192, ..Settings::default() };
    let run =
        |members| calibrate_population(&problem(members), &settings, &mut ()).expect("a posterior");
    let found = run(members());
    let exact = exact_hierarchy(&centres, &sds, 0.3, 8.0);
    let next = &found.next.parameters[0].in_coordinate;
    let got = [
        found.mean[0].mean,
        found.mean[0].sd,
        found.spread[0].mean,
        found.spread[0].sd,
        next.mean,
        next.sd,
    ];
    for (place, (got, exact)) in got.iter().zip(&exact).enumerate() {
        assert!((got - exact).abs() < 0.012, "{place}: {got} {exact}");
    }
    assert!(
        (found.next.log_evidence.value - exact[6]).abs() < 0.05,
        "{:?}",
        found.next.log_evidence
    );
    assert!(found.trust().converged(), "{:?}", found.trust());
    assert_eq!(found.draws.len(), found.next.draws.len());
    // A member that is known poorly is pulled towards the others, one that is known well stays.
    let width = |of: &Weighted| of.moments().1;
    let [poor, well] = [&found.members[3], &found.members[4]];
    assert!(poor.shrunk[0].moments().0 < poor.alone[0].moments().0 - 0.03, "{poor:?}");
    assert!(width(&poor.shrunk[0]) < 0.95 * width(&poor.alone[0]));
    assert!((well.shrunk[0].moments().0 - well.alone[0].moments().0).abs() < 0.01);
    // What the others say of the last member is the ratio of the evidences with and without it.
    let without = run(members()[..4].to_vec());
    let predicted = without.ln_predictive(&members()[4]);
    let ratio = exact[6] - exact_hierarchy(&centres[..4], &sds[..4], 0.3, 8.0)[6];
    assert!((predicted - ratio).abs() < 0.05, "{predicted} {ratio}");
}

fn three_members(seed: u64) -> PopulationProblem {
    let centres = [[0.1, -0.3], [0.3, 0.1], [-0.1, -0.2]];
    let member = |(k, c): (usize, &[f64; 2])| {
        Made { centre: c.to_vec(), sd: vec![0.1, 0.2], r: 0.5, priors: flat(2) }
            .member(1024, seed + k as u64)
    };
    PopulationProblem {
        parameters: ["x", "y"]
            .map(|name| (name.to_owned(), "1".to_owned(), Coordinate::Log10))
            .to_vec(),
        hyperprior: hyperprior(2, Some(2.0)),
        members: centres.iter().enumerate().map(member).collect(),
    }
}

#[test]
fn the_same_seed_gives_the_same_population_for_any_number_of_threads() {
    let problem = three_members(1);
    let settings = Settings { samples: 2048, draws: 512, ..Settings::default() };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| calibrate_population(&problem, &settings, &mut ()).expect("a posterior"))
    };
    let one = with(1);
    for threads in [2, 7] {
        assert_eq!(one, with(threads), "{threads} threads");
    }
    let other = Settings { seed: 2, ..settings.clone() };
    let other = calibrate_population(&problem, &other, &mut ()).expect("a posterior");
    assert_ne!(one.next.samples, other.next.samples);
}

#[test]
fn parts_that_do_not_fit_together_are_refused_with_the_value_and_the_range() {
    let problem = three_members(1);
    let settings = Settings { samples: 64, ..Settings::default() };
    let refused = |problem: &PopulationProblem, settings: &Settings| {
        calibrate_population(problem, settings, &mut ()).expect_err("refused").to_string()
    };
    let mut changed = problem.clone();
    changed.hyperprior.spread[1] = 0.0;
    assert!(refused(&changed, &settings).contains("scale of a spread is 0"));
    let mut changed = problem.clone();
    changed.hyperprior.mean[0] = [1.0, 1.0];
    assert!(refused(&changed, &settings).contains("below its upper end"));
    let mut changed = problem.clone();
    changed.hyperprior.correlation = Some(0.0);
    assert!(refused(&changed, &settings).contains("eta of the correlations is 0"));
    let mut changed = problem.clone();
    changed.members.clear();
    assert!(refused(&changed, &settings).contains("there must be a member"));
    let many =
        Hyperprior { mean: vec![[0.0, 1.0]; 6], spread: vec![0.3; 6], correlation: Some(2.0) };
    assert!(
        many.check().expect_err("27 numbers").to_string().contains("leave the correlations out")
    );
    assert!(Hyperprior { correlation: None, ..many }.check().is_ok());
    let extended = Settings { earlier: vec![32], ..settings.clone() };
    assert!(refused(&problem, &extended).contains("sampled afresh"));
    let empty = MemberSamples { support: vec![[0.0, 1.0]], ..MemberSamples::default() };
    assert!(Member::new(&empty, 1).expect_err("empty").to_string().contains("empty"));
    let mut odd = MemberSamples {
        name: "odd".to_owned(),
        coordinates: vec![0.1, 0.2],
        ln_prior: vec![0.0, 0.0],
        ln_likelihood: vec![0.0, f64::NAN],
        weights: vec![1.0, 1.0],
        log_evidence: 0.0,
        support: vec![[0.0, 1.0]],
    };
    assert!(Member::new(&odd, 1).expect_err("NaN").to_string().contains("not finite"));
    odd.ln_likelihood[1] = 0.0;
    odd.weights = vec![0.0, 0.0];
    assert!(Member::new(&odd, 1).expect_err("no weight").to_string().contains("weights"));
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn simulated_populations_have_uniform_ranks() {
    // Populations from the hyperprior, five members each, measured with noise: the truth has any rank among the draws with
    // the same probability.
    let (data_sets, draws, bins) = (160, 99, 8);
    let prior =
        Hyperprior { mean: vec![[-1.0, 1.0]; 2], spread: vec![0.3; 2], correlation: Some(2.0) };
    let ranks: Vec<[usize; 6]> = (0..data_sets)
        .into_par_iter()
        .map(|k| {
            let mut rng = stream(11, Purpose::Truth, 1, k);
            let mut score = || normal::quantile(rng.random::<f64>().max(1e-300));
            let z: Vec<f64> = (0..prior.dimension()).map(|_| score()).collect();
            let truth = prior.population(&z);
            let mut member = |m: usize| {
                let x = truth.member(&[score(), score()]);
                let sd = [0.1 + 0.1 * (m % 2) as f64, 0.3];
                let centre = vec![x[0] + sd[0] * score(), x[1] + sd[1] * score()];
                Made { centre, sd: sd.to_vec(), r: 0.0, priors: flat(2) }
                    .member(512, (10 * k + m) as u64)
            };
            let members = (0..5).map(&mut member).collect();
            let next = truth.member(&[score(), score()]);
            let name = |name: &str| (name.to_owned(), "1".to_owned(), Coordinate::Linear);
            let problem = PopulationProblem {
                parameters: vec![name("x"), name("y")],
                hyperprior: prior.clone(),
                members,
            };
            let settings =
                Settings { samples: 2048, draws, seed: k as u64 + 1, ..Settings::default() };
            let found = calibrate_population(&problem, &settings, &mut ()).expect("a posterior");
            let rank = |true_value: f64, of: &dyn Fn(usize) -> f64| {
                (0..draws).filter(|draw| of(*draw) < true_value).count()
            };
            let of_next = |draw: usize| found.next.samples[found.next.draws[draw].sample].theta[0];
            [
                rank(truth.mean[0], &|k| found.draws[k].mean[0]),
                rank(truth.mean[1], &|k| found.draws[k].mean[1]),
                rank(truth.spread[0], &|k| found.draws[k].spread[0]),
                rank(truth.spread[1], &|k| found.draws[k].spread[1]),
                rank(truth.correlation[0], &|k| found.draws[k].correlation[0]),
                rank(next[0], &of_next),
            ]
        })
        .collect();
    for quantity in 0..6 {
        let mut counts = vec![0.0; bins];
        ranks.iter().for_each(|rank| counts[rank[quantity] * bins / (draws + 1)] += 1.0);
        let wished = data_sets as f64 / bins as f64;
        let chi_square: f64 = counts.iter().map(|c| (c - wished).powi(2) / wished).sum();
        // 7 degrees of freedom: 24.3 is exceeded once in a thousand.
        assert!(chi_square < 24.3, "quantity {quantity}: {counts:?}, chi-square {chi_square:.1}");
    }
}
