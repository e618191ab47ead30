use smc_calib::{Likelihood, Noise, Problem, Settings, Simulator as _, leave_one_out, psis};

use super::*;
use crate::calibration::Calibration;
use crate::input::material::Material;
use crate::pair::model::NeckGrowth;
use crate::plan::{PairOptions, Planned};
use crate::watch::Unwatched;

fn planned(samples: usize, noise: Noise) -> Planned {
    let material = Some(Material::Ps);
    let options = PairOptions { material, samples, noise, ..PairOptions::default() };
    let mut planned = options.plan().expect("a plan");
    planned.plan.sampler.draws = 512;
    planned
}

fn calibrated(planned: &Planned) -> Calibration {
    Calibration::run(planned, &Unwatched::default()).expect("a posterior")
}

fn reals(groups: &Groups, group: &str, name: &str) -> Vec<f64> {
    let variable = groups.group(group).and_then(|group| group.variable(name));
    let variable = variable.unwrap_or_else(|| panic!("{group} has no {name}"));
    (0..variable.values.len()).map(|place| variable.values.at(place)).collect()
}

fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    [mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt()]
}

/// Holds the groups of a run against its record: of few simulations, or of so many that no process has a part in them, which are faster.
fn check(samples: usize, noise: Noise) {
    let found = calibrated(&planned(samples, noise));
    let groups = Groups::of(&found).expect("groups");
    assert_eq!(groups.notes, [""; 0]);
    let record = &found.record;
    let by_errors = record.ess.by_errors.filter(|_| record.drawn_by_process);
    let effective = record.trust.effective_samples.max(by_errors.unwrap_or(0.0));
    check_likelihoods(&found, &groups);
    for summary in &record.parameters {
        let name = &summary.parameter.name;
        let drawn = reals(&groups, "posterior", name);
        assert!(drawn.len() as f64 <= effective && drawn.len() as f64 > 0.9 * effective.min(512.0));
        let of = &summary.in_coordinate;
        let drawn: Vec<f64> = drawn.iter().map(|x| summary.coordinate.of(*x)).collect();
        for (of, share) in [(of.eti50, 0.5), (of.eti90, 0.9)] {
            let inside = drawn.iter().filter(|x| (of.lower..=of.upper).contains(*x)).count();
            let found = inside as f64 / drawn.len() as f64;
            let se = (share * (1.0 - share) / drawn.len() as f64).sqrt();
            assert!((found - share).abs() < 4.0 * se, "{name}: {found} for {share}");
        }
        let prior = reals(&groups, "prior", name);
        let prior: Vec<f64> = prior.iter().map(|x| summary.coordinate.of(*x)).collect();
        let [mean, sd] = moments(&prior);
        let se = summary.prior_sd / (prior.len() as f64).sqrt();
        assert!((mean - summary.prior_mean).abs() < 4.0 * se, "{name}: {mean}");
        assert!((sd / summary.prior_sd - 1.0).abs() < 0.1, "{name}: {sd}");
    }
    let (_, observable) = record.observables().next().expect("an observable");
    let sigma = observable.sigma.expect("inferred");
    let [mean, _] = moments(&reals(&groups, "posterior", "sigma"));
    assert!((mean / sigma.mean - 1.0).abs() < 0.1, "{mean} for {}", sigma.mean);
    let again = reals(&groups, "posterior_predictive", &observable.label);
    let width = observable.predictive.len();
    for band in &observable.predictive {
        let column = again.iter().skip(band.index).step_by(width).copied();
        let inside = column.filter(|y| (band.noisy90[0]..=band.noisy90[1]).contains(y)).count();
        let share = inside as f64 / (again.len() / width) as f64;
        let se = (0.09 / (again.len() / width) as f64).sqrt();
        assert!((share - 0.9).abs() < 0.02 + 4.0 * se, "observation {}: {share}", band.index);
    }
}

/// Holds lp against the log likelihoods of simulations at the draws, for so many draws.
fn check_lp(Calibration { record, .. }: &Calibration, groups: &Groups) -> usize {
    let lp = reals(groups, "sample_stats", "lp");
    let plan = &record.plan;
    let model = NeckGrowth::of(plan).expect("a model");
    let (_, measured) = plan.pair().expect("a pair");
    let likelihood = Likelihood::new(&measured.noise, &measured.observations().expect("rows"));
    let likelihood = likelihood.expect("a likelihood");
    let columns: Vec<Vec<f64>> =
        plan.parameters.iter().map(|one| reals(groups, "posterior", &one.name)).collect();
    for (k, lp) in lp.iter().enumerate() {
        let theta: Vec<f64> = columns.iter().map(|column| column[k]).collect();
        let mut curve = vec![0.0; measured.values.len()];
        model.simulate(&theta, &mut curve).expect("simulated");
        let prior = plan.parameters.iter().zip(&theta);
        let prior: f64 = prior.map(|(one, value)| one.prior.ln_density(*value)).sum();
        let wanted = prior + likelihood.ln_joint(&curve);
        assert!((lp - wanted).abs() < 1e-9 * wanted.abs(), "{lp} for {wanted}");
    }
    lp.len()
}

/// Holds lp against the log likelihoods of the samples, and the prediction of each observation by the others, as ArviZ
/// computes it from the exported draws, against ours from all weighted samples.
fn check_likelihoods(found: &Calibration, groups: &Groups) {
    let Calibration { record, posterior } = found;
    let plan = &record.plan;
    let draws = check_lp(found, groups) as f64;
    let model = NeckGrowth::of(plan).expect("a model");
    let (_, measured) = plan.pair().expect("a pair");
    let problem = Problem {
        simulator: &model,
        parameters: plan.parameters.clone(),
        observations: measured.observations().expect("observations"),
        noise: measured.noise.clone(),
    };
    let ours = leave_one_out(&problem, posterior).expect("computed").expect("a posterior");
    let all = reals(groups, "log_likelihood", &measured.name);
    let width = measured.values.len();
    let mut difference = 0.0;
    for point in &ours.points {
        let column: Vec<f64> = all.iter().skip(point.index).step_by(width).copied().collect();
        let ratios: Vec<f64> = column.iter().map(|ln| -ln).collect();
        let smoothed = psis::smooth(&ratios);
        let density: f64 = smoothed.weights.iter().zip(&column).map(|(w, ln)| w * ln.exp()).sum();
        if smoothed.khat < 0.5 && point.khat < 0.5 {
            difference += density.ln() - point.ln_density;
        }
    }
    let error = 6.0 * (width as f64 / draws).sqrt() + 4.0 * ours.se;
    assert!(difference.abs() < error.min(0.5 * ours.spread), "{difference} beyond {error}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn draws_of_few_simulations_are_of_the_process_and_their_likelihoods_are_simulated_there() {
    let mut planned = planned(40, Noise::default());
    // The first of some seeds with which the process knows more than the weights.
    let run = |seed: u64| {
        planned.plan.sampler.seed = seed;
        calibrated(&planned)
    };
    let found = (1..=20).map(run).find(|found| found.posterior.is_drawn()).expect("drawn");
    let groups = Groups::of(&found).expect("groups");
    let Calibration { record, posterior } = &found;
    for (place, summary) in record.parameters.iter().enumerate() {
        let all: Vec<f64> = posterior.draws.iter().map(|draw| draw.theta[place]).collect();
        let exported = reals(&groups, "posterior", &summary.parameter.name);
        assert!(exported.iter().all(|theta| all.contains(theta)));
    }
    assert!(check_lp(&found, &groups) > 0);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn draws_of_independent_errors_are_those_of_the_record() {
    check(512, Noise::default());
}

#[test]
fn draws_of_correlated_errors_are_those_of_the_record() {
    check(
        Settings::WHOLLY_PLAIN,
        Noise::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes: Some([6, 6]) },
    );
}

#[test]
fn draws_of_errors_with_outliers_are_those_of_the_record() {
    check(Settings::WHOLLY_PLAIN, Noise::robust());
}

#[test]
fn units_are_not_taken_for_times_of_day_and_names_are_not_taken_twice() {
    let text = |unit: &str| groups::units(unit).as_str().map(str::to_owned);
    for (unit, written) in [
        ("", "1"),
        ("N", "N"),
        ("Seconds", "s"),
        ("hours", "h"),
        ("days since 2000", "days_since_2000"),
    ] {
        assert_eq!(text(unit).as_deref(), Some(written));
    }
    let mut taken = vec!["draw".to_owned()];
    let names = ["draw", "draw", "k"].map(|name| groups::free_name(name, &mut taken));
    assert_eq!(names, ["draw_", "draw__", "k"]);
}
