use std::path::PathBuf;

use dem_core::Kinetics;
use smc_calib::Noise;
use tempfile::TempDir;

use super::*;
use crate::calibration::{self, RunOptions};
use crate::pair::draws::PairDraws;
use crate::plan::PairOptions;
use crate::predict::{Wanted, predict};
use crate::record;

/// Calibrates a built-in experiment into a folder of its name, with so many simulations that no process places them.
fn calibrated(folder: &TempDir, name: &str, options: PairOptions) -> PathBuf {
    let options =
        PairOptions { experiment: Some(name.into()), samples: Settings::WHOLLY_PLAIN, ..options };
    let out = folder.path().join(format!("{name}-{}", options.kinetics));
    let planned = options.plan().expect("a plan");
    let how = RunOptions {
        out: Some(out.clone()),
        without_other_kinetics: true,
        ..RunOptions::default()
    };
    calibration::run(&planned, &how, &Unwatched::default()).expect("a run");
    out
}

fn of(runs: &[&PathBuf]) -> PopulationOptions {
    let runs = runs.iter().map(|run| (*run).clone()).collect();
    PopulationOptions { runs, samples: 1024, ..PopulationOptions::default() }
}

fn refused(options: &PopulationOptions) -> String {
    match PopulationJob::read(options) {
        Ok(_) => panic!("read"),
        Err(error) => error.to_string(),
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_population_is_a_run_whose_next_pair_is_less_certain_than_each_of_its_members() {
    let folder = TempDir::new().expect("a folder");
    let one = calibrated(&folder, "pa12-r32", PairOptions::default());
    let noise = Noise::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes: Some([4, 4]) };
    let other = calibrated(&folder, "pa12-r30", PairOptions { noise, ..PairOptions::default() });
    // By 1024 samples intervals would be known to 5 %, no better than what noise adds to them.
    let options = PopulationOptions { samples: 8192, ..of(&[&one, &other]) };
    let job = PopulationJob::read(&options).expect("a population");
    let out = RunFolder::prepare(&folder.path().join("powder"), FILE_NAME).expect("a folder");
    let (found, _) = job.publish(&out, &Unwatched::default()).expect("written");
    let back = record::read(out.path()).expect("a posterior.json");
    assert_eq!(back, found);
    let population = found.population.as_ref().expect("a population");
    let radius_m = 0.5 * (31.5e-6 + 29.8318e-6);
    let factor = population.members[0].tau_s_factor;
    assert!((factor - radius_m / 31.5e-6).abs() < 1e-12, "{factor}");
    assert!(found.advice.iter().any(|line| line.contains("few-members")), "{:?}", found.advice);
    let wanted = Wanted { targets: vec![0.9], ..Wanted::default() };
    let width = |run: &Path| {
        let draws = PairDraws::read(run).expect("draws");
        let found = predict(&draws, &wanted).expect("a prediction");
        let [lower, upper] = found.sintering[0].time_s.as_ref().expect("a time").eti90;
        (upper / lower).ln()
    };
    let [of_one, of_other, of_next] = [&one, &other, &out.path().to_owned()].map(|run| width(run));
    assert!(of_next > of_one.max(of_other), "{of_next} {of_one} {of_other}");
    // A measurement of the next one scatters as those of the members did.
    let with_noise = Wanted { after_s: vec![2.0], with_noise: true, ..Wanted::default() };
    let draws = PairDraws::read(out.path()).expect("draws");
    let after = &predict(&draws, &with_noise).expect("a prediction").after[0];
    let width = |[lower, upper]: [f64; 2]| upper - lower;
    let measured = after.measured.as_ref().expect("with noise");
    assert!(width(measured.eti50) > width(after.contact_ratio.eti50));
    // The run of a member stays where it is.
    let own = RunFolder::prepare(&one, FILE_NAME).expect("the run of a member");
    let aside = job.publish(&own, &Unwatched::default()).expect_err("a member's folder");
    assert!(aside.to_string().contains("would be moved aside"), "{aside}");
    // A population is no member.
    let nested = refused(&of(&[&one, &out.path().to_owned()]));
    assert!(nested.contains("the runs that it was made of"), "{nested}");
    let extended = calibration::continued(out.path(), 4096).expect_err("a population");
    assert!(extended.to_string().contains("calibrate population"), "{extended}");
    assert_eq!(draws.pair.powder.radius_m, radius_m);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn runs_that_are_not_of_one_model_are_refused_with_what_to_do() {
    let folder = TempDir::new().expect("a folder");
    let one = calibrated(&folder, "pa12-r32", PairOptions::default());
    let frenkel = PairOptions { kinetics: Kinetics::Pokluda, ..PairOptions::default() };
    let frenkel = calibrated(&folder, "pa12-r30", frenkel);
    let text = refused(&of(&[&one]));
    assert!(text.contains("two or more"), "{text}");
    let text = refused(&of(&[&one, &one]));
    assert!(text.contains("once more") && text.contains("leave one of the two out"), "{text}");
    let text = refused(&of(&[&one, &frenkel]));
    assert!(text.contains("c1") && text.contains("calibrate") && text.contains("[c1]"), "{text}");
    let rate = PairOptions { kinetics: Kinetics::ThreeStagePokluda, ..PairOptions::default() };
    let rate = calibrated(&folder, "pa12-r30", rate);
    let text = refused(&of(&[&one, &rate]));
    assert!(
        text.contains("three-stage-pokluda kinetics") && text.contains("--kinetics three-stage"),
        "{text}"
    );
    let ps = calibrated(&folder, "ps-r30", PairOptions::default());
    let text = refused(&of(&[&one, &ps]));
    assert!(text.contains("final contact ratio of 1.08"), "{text}");
    let missing = folder.path().join("nothing");
    assert!(refused(&of(&[&one, &missing])).contains("nothing"));
    let other = calibrated(&folder, "pa12-r30", PairOptions::default());
    let unknown =
        PopulationOptions { spread: vec![(Some("tau".to_owned()), 0.1)], ..of(&[&one, &other]) };
    let text = refused(&unknown);
    assert!(text.contains("did you mean tau_s?"), "{text}");
    let samples = other.join("samples.csv");
    let whole = std::fs::read_to_string(&samples).expect("samples");
    let cut: String = whole.split_inclusive('\n').take(100).collect();
    std::fs::write(&samples, cut).expect("written");
    assert!(PopulationJob::read(&of(&[&one, &other])).is_err(), "a table that was cut off");
}

#[test]
fn hyperpriors_are_those_that_were_asked_for_and_the_range_that_all_priors_have_in_common() {
    let folder = TempDir::new().expect("a folder");
    let prior = "[c1]\ndistribution = \"log-uniform\"\nlower = 1e-7\nupper = 1e-3\n[tau_s]\ndistribution = \"log-normal\"\nmedian = 3.0\nsd_log10 = 0.5\n[delta_c]\ndistribution = \"log-uniform\"\nlower = 1e-8\nupper = 3e-6\n";
    let file = folder.path().join("own.toml");
    std::fs::write(&file, prior).expect("written");
    let own = PairOptions { prior: Some(file), ..PairOptions::default() };
    let one = calibrated(&folder, "pa12-r32", PairOptions::default());
    let other = calibrated(&folder, "pa12-r30", own);
    let spread = vec![(None, 0.2), (Some("delta_c".to_owned()), 0.1)];
    let options = PopulationOptions {
        spread,
        correlation: None,
        radius_m: Some(31.5e-6),
        ..of(&[&one, &other])
    };
    let job = PopulationJob::read(&options).expect("a population");
    let found = &job.problem().hyperprior;
    assert_eq!((&found.spread, found.correlation), (&vec![0.2, 0.2, 0.1], None));
    let [lower, upper] = found.mean[0];
    assert!((lower + 7.0).abs() < 1e-9 && (upper + 3.0).abs() < 1e-9, "{:?}", found.mean);
    // Four standard deviations of a prior without bounds, at the radius of the population; the other prior begins above it.
    let [lower, upper] = found.mean[1];
    let moved = (31.5 / 29.8318f64).log10();
    assert!((lower - 0.5f64.log10()).abs() < 1e-9, "{lower}");
    assert!((upper - 50f64.log10()).abs() < 1e-9 || upper < 3f64.log10() + 2.01 + moved);
}
