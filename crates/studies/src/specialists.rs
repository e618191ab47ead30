//! The problems by which packages for dear likelihoods show themselves, at their own numbers of calls.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use smc_calib::normal::ln_density;
use smc_calib::{
    CalibrateError, DensitySummary, Prior, PriorSpec, Settings, SimError, Target, sample_density_in,
};
use workbench::error::{Failure, RunError};

use crate::args::SpecialistsArgs;
use crate::quantile::{median, rms};
use crate::report::{Report, Table};
use crate::seeds::over_seeds;

/// A log likelihood over parameters.
type LnLikelihood = Box<dyn Fn(&[f64]) -> f64 + Send + Sync>;

/// A problem with its exact answer.
struct Problem {
    priors: Vec<Prior>,
    ln_likelihood: LnLikelihood,
    log_evidence: f64,
    mean: Vec<f64>,
    sd: Vec<f64>,
    /// Covariance of the parameters, where the Kullback-Leibler divergence is wanted.
    covariance: Option<DMatrix<f64>>,
}

/// A problem of a package.
struct Example {
    name: String,
    package: &'static str,
    /// Calls of the package.
    calls: usize,
    /// What was measured of it, or what it promises.
    theirs: &'static str,
    /// The problem of a seed; most have one for all seeds.
    problem: Box<dyn Fn(u64) -> Result<Problem, RunError> + Sync>,
}

/// Errors of one run.
struct Off {
    log_evidence: f64,
    log_evidence_se: f64,
    /// Of the worst parameter, in posterior sds.
    mean: f64,
    /// Of the worst parameter, relative.
    sd: f64,
    divergence: Option<f64>,
}

const TEXT: &str = "\
The examples by which PyVBMC (1 and 4 of its documentation), BOBE (its examples) and GPry (the random Gaussians of its paper) show what they can do
with few calls of a likelihood, given to `Settings::for_budget` with the calls that were stated of these packages and with half of them. Errors are root mean squares over the
seeds, of ln Z with the median beside it, of mean and sd of the worst parameter in posterior sds; \"spread of z\" is that of the error of ln Z over its stated standard error. \"Theirs\" is the
error of ln Z measured of PyVBMC 1.x (four seeds) and BOBE (bobe.md), BOBE's own threshold of convergence (0.05) within 250 calls, and the divergence that GPry's paper promises.

Exact answers are recomputed by quadrature in the tests of this study. Our sampler sees log likelihoods only, one number a call, as the packages do; it
stops at its budget, they where they think that they are done.

Definitions: PyVBMC, ln L = -(x^2 - y)^2 - (x - 1)^2/100 under N(0, 3^2) (example 1) and N(0, 3) (example 4) in each of two parameters
(L. Acerbi, NeurIPS 2018 and 2020; B. Huggins et al., JOSS 8 (2023) 5428). BOBE (arXiv 2601.11150): banana, -(5 (0.2 - x))^2/4 - (20 (y/4 - x^4))^2, uniform on [-1, 1] x [-1, 2];
Himmelblau, -((x + y^2 - 7)^2/10 + (x^2 + y - 11)^2)/2 on [-4, 4]^2; Rosenbrock, -(1 - x)^2 - 100 (y - x^2)^2 on [-1, 4] x [-1, 7]; ring, -((r - 0.2)/0.02)^2/2 with r from the middle of the unit
square. GPry (J. El Gammal et al., JCAP 10 (2023) 021): Gaussians of zero mean, standard deviations uniform in 0 to 1, correlations of eigenvalues uniform in 0 to 1, priors of 5 standard deviations to
either side, another Gaussian for every seed; at most 70 d^1.5 calls to a divergence below 0.05.
";

pub(crate) fn run(args: &SpecialistsArgs, out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "specialists")?;
    let mut table = Table::new(&[
        "problem",
        "package",
        "theirs",
        "calls",
        "ln Z",
        "ln Z, median",
        "spread of z",
        "mean [posterior sd]",
        "sd, relative",
        "divergence, median",
        "divergence, largest",
    ]);
    let asked = |name: &str| args.only.as_deref().is_none_or(|only| name.contains(only));
    for example in examples().into_iter().filter(|example| asked(&example.name)) {
        for calls in [example.calls.div_ceil(2), example.calls] {
            eprintln!("{}, {calls} calls", example.name);
            let runs = over_seeds(args.seeds, &|seed| {
                let problem = (example.problem)(seed)?;
                problem.sampled(calls, seed).map_err(RunError::new)
            })?;
            let what = [&example.name, example.package, example.theirs].map(str::to_owned);
            table.push([&what[..], &[calls.to_string()], &cells(&runs)].concat());
        }
    }
    report.table(&table)?;
    let text = format!("{} seeds. {TEXT}\n{}", args.seeds, table.markdown());
    Ok(report.page("The problems of the specialists", &text)?)
}

fn cells(runs: &[Off]) -> Vec<String> {
    let over = |of: &dyn Fn(&Off) -> f64| rms(runs.iter().map(of));
    let mut divergences: Vec<f64> = runs.iter().filter_map(|run| run.divergence).collect();
    divergences.sort_by(f64::total_cmp);
    let divergence = |k: usize| divergences.get(k).map_or("-".to_owned(), |d| format!("{d:.4}"));
    vec![
        format!("{:.4}", over(&|run| run.log_evidence)),
        format!("{:.4}", median(runs.iter().map(|run| run.log_evidence.abs()))),
        format!("{:.1}", over(&|run| run.log_evidence / run.log_evidence_se)),
        format!("{:.3}", over(&|run| run.mean)),
        format!("{:.3}", over(&|run| run.sd)),
        divergence(divergences.len() / 2),
        divergence(divergences.len().saturating_sub(1)),
    ]
}

impl Target for Problem {
    fn dimension(&self) -> usize {
        self.priors.len()
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let x: Vec<f64> = self.priors.iter().zip(z).map(|(prior, z)| prior.from_z(*z)).collect();
        Ok((self.ln_likelihood)(&x))
    }
}

impl Problem {
    /// In two parameters, with an answer by quadrature.
    fn plane(
        priors: [PriorSpec; 2],
        ln_likelihood: fn(f64, f64) -> f64,
        (log_evidence, mean, sd): (f64, [f64; 2], [f64; 2]),
    ) -> Result<Self, RunError> {
        let priors: Result<Vec<Prior>, _> = priors.map(Prior::new).into_iter().collect();
        Ok(Self {
            priors: priors.map_err(RunError::new)?,
            ln_likelihood: Box::new(move |x| ln_likelihood(x[0], x[1])),
            log_evidence,
            mean: mean.to_vec(),
            sd: sd.to_vec(),
            covariance: None,
        })
    }

    /// A random Gaussian of zero mean in `d` parameters; of the likelihood nothing but 6e-7 of each parameter lies beyond the prior.
    fn gaussian(d: usize, seed: u64) -> Result<Self, RunError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let sd: Vec<f64> = (0..d).map(|_| random.random_range(0.0..1.0)).collect();
        let eigenvalues: Vec<f64> = (0..d).map(|_| random.random_range(0.0..1.0)).collect();
        let normals = DMatrix::from_fn(d, d, |_, _| StandardNormal.sample(&mut random));
        let directions: DMatrix<f64> = normals.qr().q();
        let spread = DMatrix::from_diagonal(&DVector::from_vec(eigenvalues));
        let turned = &directions * spread * directions.transpose();
        let covariance = DMatrix::from_fn(d, d, |j, k| {
            turned[(j, k)] / (turned[(j, j)] * turned[(k, k)]).sqrt() * sd[j] * sd[k]
        });
        let factor =
            covariance.clone().cholesky().ok_or_else(|| RunError::new("no random Gaussian"))?;
        let ln_volume: f64 = factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum();
        let priors: Result<Vec<Prior>, _> = sd
            .iter()
            .map(|sd| Prior::new(PriorSpec::Uniform { lower: -5.0 * sd, upper: 5.0 * sd }))
            .collect();
        Ok(Self {
            priors: priors.map_err(RunError::new)?,
            log_evidence: -sd.iter().map(|sd| (10.0 * sd).ln()).sum::<f64>(),
            mean: vec![0.0; d],
            sd,
            ln_likelihood: Box::new(move |x| {
                let mut scaled = DVector::from_column_slice(x);
                factor.l_dirty().solve_lower_triangular_mut(&mut scaled);
                scaled.iter().map(|z| ln_density(*z)).sum::<f64>() - ln_volume
            }),
            covariance: Some(covariance),
        })
    }

    fn sampled(&self, calls: usize, seed: u64) -> Result<Off, CalibrateError> {
        let settings = Settings { seed, ..Settings::for_budget(calls) };
        let found = sample_density_in(self, &|j, z| self.priors[j].from_z(z), &settings)?;
        let worst = |of: &dyn Fn(usize) -> f64| {
            (0..self.mean.len()).map(|j| of(j).abs()).fold(0.0, f64::max)
        };
        Ok(Off {
            log_evidence: found.log_evidence.value - self.log_evidence,
            log_evidence_se: found.log_evidence.se,
            mean: worst(&|j| (found.mean[j] - self.mean[j]) / self.sd[j]),
            sd: worst(&|j| found.sd[j] / self.sd[j] - 1.0),
            divergence: self.covariance.as_ref().map(|exact| self.divergence(exact, &found)),
        })
    }

    /// Kullback-Leibler divergence of the Gaussian of the moments found from the exact one:
    /// `(tr(S^-1 T) - d + m' S^-1 m + ln(det S / det T)) / 2` (S. Kullback, R. A. Leibler, Ann. Math. Stat. 22 (1951) 79).
    fn divergence(&self, exact: &DMatrix<f64>, found: &DensitySummary) -> f64 {
        let d = self.mean.len();
        let covariance =
            DMatrix::from_fn(d, d, |j, k| found.correlation[j][k] * found.sd[j] * found.sd[k]);
        let (Some(found_factor), Some(factor)) = (covariance.cholesky(), exact.clone().cholesky())
        else {
            return f64::INFINITY;
        };
        let off = DVector::from_fn(d, |j, _| found.mean[j] - self.mean[j]);
        let ln_ratio = found_factor.ln_determinant() - factor.ln_determinant();
        let spread = found_factor.solve(exact).trace() - d as f64;
        0.5 * (spread + off.dot(&found_factor.solve(&off)) + ln_ratio)
    }
}

/// The likelihood of PyVBMC's examples: Rosenbrock's valley.
fn valley(x: f64, y: f64) -> f64 {
    -(x * x - y).powi(2) - (x - 1.0).powi(2) / 100.0
}

fn banana(x: f64, y: f64) -> f64 {
    -0.25 * (5.0 * (0.2 - x)).powi(2) - (20.0 * (y / 4.0 - x.powi(4))).powi(2)
}

fn himmelblau(x: f64, y: f64) -> f64 {
    -0.5 * (0.1 * (x + y * y - 7.0).powi(2) + (x * x + y - 11.0).powi(2))
}

fn rosenbrock(x: f64, y: f64) -> f64 {
    -(1.0 - x).powi(2) - 100.0 * (y - x * x).powi(2)
}

fn ring(x: f64, y: f64) -> f64 {
    -0.5 * (((x - 0.5).hypot(y - 0.5) - 0.2) / 0.02).powi(2)
}

/// An answer: log evidence, means, standard deviations.
type Answer = (f64, [f64; 2], [f64; 2]);

/// A problem in two parameters: name, package, calls, theirs, priors, likelihood, answer.
type Plane =
    (&'static str, &'static str, usize, &'static str, [PriorSpec; 2], fn(f64, f64) -> f64, Answer);

fn planes() -> [Plane; 6] {
    let normal = |sd| [PriorSpec::Normal { mean: 0.0, sd }, PriorSpec::Normal { mean: 0.0, sd }];
    let uniform =
        |x: [f64; 2], y: [f64; 2]| [x, y].map(|[lower, upper]| PriorSpec::Uniform { lower, upper });
    [
        (
            "Rosenbrock's valley, prior sd 3",
            "PyVBMC, example 1",
            75,
            "0.012 to 0.028",
            normal(3.0),
            valley,
            (-2.259_847_1, [0.026_341, 1.248_229], [1.147_555, 1.563_508]),
        ),
        (
            "Rosenbrock's valley, prior variance 3",
            "PyVBMC, example 4",
            70,
            "0.006 to 0.028",
            normal(3f64.sqrt()),
            valley,
            (-1.514_073_9, [0.014_933, 0.640_129], [0.864_057, 0.982_668]),
        ),
        (
            "banana",
            "BOBE",
            32,
            "0.055 in one run, 0.069 in the median of 12",
            uniform([-1.0, 1.0], [-1.0, 2.0]),
            banana,
            (-3.184_819_2, [0.191_290, 0.122_152], [0.272_280, 0.302_605]),
        ),
        (
            "Himmelblau",
            "BOBE",
            250,
            "at most 0.05",
            uniform([-4.0, 4.0], [-4.0, 4.0]),
            himmelblau,
            (-3.183_426_5, [0.915_369, 0.322_257], [3.126_685, 2.315_466]),
        ),
        (
            "Rosenbrock",
            "BOBE",
            250,
            "at most 0.05",
            uniform([-1.0, 4.0], [-1.0, 7.0]),
            rosenbrock,
            (-4.859_133_2, [0.986_182, 1.430_526], [0.676_763, 1.426_467]),
        ),
        (
            "ring",
            "BOBE",
            250,
            "at most 0.05",
            uniform([0.0, 1.0], [0.0, 1.0]),
            ring,
            (-2.764_645_3, [0.5, 0.5], [0.143_527, 0.143_527]),
        ),
    ]
}

fn examples() -> Vec<Example> {
    let of_plane = |(name, package, calls, theirs, priors, ln_likelihood, answer): Plane| Example {
        name: name.to_owned(),
        package,
        calls,
        theirs,
        problem: Box::new(move |_| Problem::plane(priors.clone(), ln_likelihood, answer)),
    };
    let of_gaussian = |d: usize| Example {
        name: format!("random Gaussians, {d} D"),
        package: "GPry",
        calls: (70.0 * (d as f64).powf(1.5)) as usize,
        theirs: "divergence at most 0.05",
        problem: Box::new(move |seed| Problem::gaussian(d, seed)),
    };
    planes().into_iter().map(of_plane).chain((1..=8).map(of_gaussian)).collect()
}

#[cfg(test)]
mod tests {
    use smc_calib::quadrature::{QuadratureSettings, integrate};

    use super::*;

    #[test]
    fn every_exact_answer_is_that_of_quadrature() {
        for (name, _, _, _, priors, ln_likelihood, answer) in planes() {
            let problem = Problem::plane(priors, ln_likelihood, answer).expect("priors");
            let settings = QuadratureSettings { tolerance: 1e-5, max_points: 1024 };
            let by = integrate(&problem, &|j, z| problem.priors[j].from_z(z), &settings)
                .expect("integrable");
            let off = (by.log_evidence - problem.log_evidence).abs();
            assert!(off < 1e-4, "{name}: ln Z {} and {}", by.log_evidence, problem.log_evidence);
            for j in 0..2 {
                let off = (by.mean[j] - problem.mean[j]).abs() / problem.sd[j];
                assert!(off < 1e-3, "{name}: means {:?} and {:?}", by.mean, problem.mean);
                let off = (by.sd[j] / problem.sd[j] - 1.0).abs();
                assert!(off < 1e-3, "{name}: sds {:?} and {:?}", by.sd, problem.sd);
            }
        }
    }

    #[test]
    fn a_random_gaussian_has_the_moments_and_the_evidence_of_quadrature() {
        let problem = Problem::gaussian(2, 3).expect("a Gaussian");
        let settings = QuadratureSettings { tolerance: 1e-5, max_points: 512 };
        let by = integrate(&problem, &|j, z| problem.priors[j].from_z(z), &settings)
            .expect("integrable");
        assert!((by.log_evidence - problem.log_evidence).abs() < 1e-4, "{by:?}");
        let covariance = problem.covariance.as_ref().expect("a covariance");
        let correlation = covariance[(0, 1)] / (problem.sd[0] * problem.sd[1]);
        assert!((by.correlation[0][1] - correlation).abs() < 1e-3, "{by:?} {correlation}");
        for j in 0..2 {
            assert!((by.sd[j] / problem.sd[j] - 1.0).abs() < 1e-3, "{by:?}");
        }
    }

    #[test]
    fn the_divergence_of_gaussians_is_that_of_the_closed_form_in_one_dimension() {
        // (r - 1 + m^2 / s^2 - ln r) / 2 with r the ratio of variances exact over found.
        let problem = Problem::gaussian(1, 1).expect("a Gaussian");
        let exact = problem.covariance.clone().expect("a covariance");
        let mut found = sample_density_in(
            &problem,
            &|j, z| problem.priors[j].from_z(z),
            &Settings::for_budget(100),
        )
        .expect("a run");
        found.sd[0] = 2.0 * problem.sd[0];
        found.mean[0] = 0.5 * problem.sd[0];
        let divergence = 0.5 * (0.25 - 1.0 + 0.25 * 0.25 + 4f64.ln());
        assert!((problem.divergence(&exact, &found) - divergence).abs() < 1e-12);
    }
}
