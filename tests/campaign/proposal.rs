//! Runs that begin from an earlier result: what is taken of it, what is kept of it, and what is refused.

use std::fs;

use rustix::process::Signal;

use super::{Driver, line, line_plan, runs, status, until};
use crate::sandbox::{Sandbox, root};

/// The plan of a line that begins from `earlier`, under the name `next`.
fn next_plan(samples: usize, seconds: &str) -> String {
    line_plan(samples, seconds)
        .replace("name = \"line\"", "name = \"next\"")
        .replace("[sampler]", "[sampler]\nproposal = \"results/line\"")
}

/// A finished run of a line, and a plan that begins from it.
fn after_line(samples: usize, seconds: &str) -> Sandbox {
    let sandbox = line(40, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    fs::remove_file(sandbox.path().join("runs.txt")).expect("the note of the runs");
    sandbox.write("next.toml", next_plan(samples, seconds));
    sandbox
}

#[test]
fn a_plan_begins_from_an_earlier_result_and_says_what_it_took() {
    let sandbox = after_line(24, "0");
    let checked = sandbox.run("check next.toml");
    let said = &checked.succeeded().stdout;
    assert!(
        said.contains("begins from   results/line (run line, 40 simulations, seed 1"),
        "{said}"
    );
    let ran = sandbox.run("--plan next.toml");
    let said = &ran.succeeded().stdout;
    assert!(said.contains("begun from results/line (run line"), "{said}");
    let file = sandbox.posterior("results/next");
    let earlier = &file["plan"]["proposal"];
    assert_eq!((&earlier["from"], &earlier["seed"]), (&"results/line".into(), &1.into()));
    assert_eq!(earlier["parameters"], serde_json::json!(["a"]));
    assert_eq!(earlier["first"]["outside_priors"], 0.0);
    assert_eq!(file["stages"][0]["proposal"]["prior_share"], 0.25);
    let table = fs::read_to_string(sandbox.path().join("results/next/table.md")).expect("a table");
    assert!(table.contains("Begun from results/line"), "{table}");
    // The slope of 2.03 +- 0.1 in [0, 5]: most of the first runs are near it.
    let samples =
        fs::read_to_string(sandbox.path().join("results/next/samples.csv")).expect("rows");
    let slopes = samples.lines().skip(1).take(4).map(|row| row.split(',').next().expect("a slope"));
    let near = |text: &str| (text.parse::<f64>().expect("a number") - 2.03).abs() < 0.6;
    assert!(slopes.filter(|slope| near(slope)).count() >= 3, "{samples}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_run_that_was_interrupted_goes_on_although_the_earlier_result_is_gone() {
    let whole = after_line(40, "0");
    whole.run("--plan next.toml --quiet").succeeded();

    let sandbox = after_line(40, "0.05");
    let driver = Driver::start(&sandbox, "--plan next.toml");
    until("a run", || runs(&sandbox) > 9);
    driver.signal(Signal::INT);
    driver.wait();
    fs::rename(sandbox.path().join("results/line"), sandbox.path().join("moved")).expect("moved");
    let again = sandbox.run("--resume results/next --plan next.toml --quiet");
    again.succeeded();
    let samples =
        |of: &Sandbox| fs::read(of.path().join("results/next/samples.csv")).expect("rows");
    assert!(samples(&sandbox) == samples(&whole), "the same bits as without an interruption");
    assert_eq!(status(&sandbox, "results/next")["finished"], 40);
    let made = runs(&sandbox);
    // Extended, and still not asking for the other result.
    let ran = sandbox.run("--resume results/next --samples 60 --quiet");
    ran.succeeded();
    assert_eq!(runs(&sandbox), made + 20, "none is made again");
    assert_eq!(status(&sandbox, "results/next")["finished"], 60);
    // A new run does.
    let anew = sandbox.run("--plan next.toml --out anew");
    anew.refused(&["next.toml", "sampler.proposal", "results/line, which is not there"]);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_earlier_result_that_has_changed_does_not_change_a_run_that_goes_on() {
    let sandbox = after_line(24, "0");
    sandbox.run("--plan next.toml --quiet").succeeded();
    let bytes = sandbox.posterior_bytes("results/next");
    sandbox.run("--resume results/line --samples 80 --quiet").succeeded();
    let again = sandbox.run("--resume results/next");
    assert!(!again.succeeded().stderr.contains("has changed"), "{}", again.stderr);
    sandbox.run("--resume results/next --plan next.toml --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/next"), bytes);
    // Another result is another plan.
    fs::rename(sandbox.path().join("results/line"), sandbox.path().join("other")).expect("moved");
    sandbox.write("next.toml", next_plan(24, "0").replace("results/line", "other"));
    let other = sandbox.run("--resume results/next --plan next.toml");
    other.refused(&["proposal.", "as in the run in results/next"]);
}

#[test]
fn what_cannot_be_begun_from_is_refused_with_its_place_and_a_remedy() {
    let sandbox = after_line(24, "0");
    let plan = next_plan(24, "0");
    let refused = |plan: String, words: &[&str]| {
        sandbox.write("next.toml", plan);
        sandbox.run("check next.toml").refused(words);
        sandbox.run("--plan next.toml").refused(words);
    };
    let named = |folder: &str| plan.replace("results/line", folder);
    refused(named("nowhere"), &["line 19", "sampler.proposal", "nowhere, which is not there"]);
    refused(
        named("results"),
        &["posterior.json", "finished calibration", "field sampler.proposal"],
    );
    refused(named("line.csv"), &["line.csv", "not JSON", "field sampler.proposal"]);
    refused(named(""), &["sampler.proposal"]);
    refused(
        plan.replace("[parameters.a]", "[parameters.b]").replace("{a}", "{b}"),
        &["with the parameters a", "one of b among them", "matched by name"],
    );
    refused(
        plan.replace("lower = 0.0\nupper = 5.0", "lower = 4.0\nupper = 5.0"),
        &["of the earlier posterior lie outside the priors", "widen the priors"],
    );
    refused(
        plan.replace("[parameters.a]", "[parameters.a]\nunit = \"kN\""),
        &["a (in 1 there, in kN here)", "in the same unit"],
    );
    let tuned = "kind = \"ess-target\", share = 0.2";
    refused(plan.replace("kind = \"inferred\", s0 = 0.2", tuned), &["tuned noise", "leave one"]);
    sandbox.write("sets.csv", "a\n1\n2\n3\n");
    refused(
        plan.replace("samples = 24", "design = \"sets.csv\""),
        &["beside a design", "leave one"],
    );
    // A run that has no posterior yet, and one that was damaged.
    fs::remove_file(sandbox.path().join("results/line/posterior.json")).expect("removed");
    refused(plan.clone(), &["no posterior yet", "calibrate --resume"]);
    let sandbox = after_line(24, "0");
    // Of so few samples draws are of the process, and what is begun from is of these.
    let draws = sandbox.path().join("results/line/draws.csv");
    let text = fs::read_to_string(&draws).expect("rows").replacen('1', "2", 1);
    fs::write(draws, text).expect("damaged");
    sandbox.run("--plan next.toml").refused(&["draws.csv", "damaged", "field sampler.proposal"]);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_earlier_result_that_is_wrong_is_warned_of_and_does_not_decide_the_answer() {
    let sandbox = line(40, "0");
    // Another slope in other data, hardly any runs, and a prior that excludes most of the right answer.
    sandbox.write("line.csv", "t,y\n1,4.1\n2,7.9\n3,12.2\n");
    sandbox.write("line.toml", line_plan(16, "0"));
    sandbox.run("--plan line.toml --quiet").succeeded();
    sandbox.write("line.csv", "t,y\n1,2.1\n2,3.9\n3,6.2\n");
    sandbox.write("plain.toml", line_plan(60, "0").replace("name = \"line\"", "name = \"plain\""));
    sandbox.run("--plan plain.toml --quiet").succeeded();
    sandbox.write("next.toml", next_plan(60, "0"));
    let ran = sandbox.run("--plan next.toml");
    let judged = &sandbox.posterior("results/line")["trust"]["verdict"];
    let warned = ran.succeeded().stdout.contains("untrusted-proposal");
    assert_eq!((warned, judged), (true, &"untrusted".into()), "{}", ran.stdout);
    let of = |folder: &str| {
        let file = sandbox.posterior(folder);
        let at = &file["parameters"][0]["in_coordinate"];
        let number = |key: &str| at[key].as_f64().expect("a number");
        (number("mean"), number("sd"))
    };
    let (plain, next) = (of("results/plain"), of("results/next"));
    assert!((plain.0 - next.0).abs() < 0.15 * plain.1, "{plain:?} {next:?}");
    assert!((next.1 / plain.1 - 1.0).abs() < 0.15, "{plain:?} {next:?}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_material_begins_from_an_earlier_result_and_is_continued_without_it() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps -n 8192 --no-other-kinetics --quiet --out cheap").succeeded();
    let options = "--material ps --solver quasi-static -n 60 --no-other-kinetics --proposal cheap";
    let dry = sandbox.run(&format!("{options} --dry-run --toml"));
    let toml = dry.succeeded().stdout.clone();
    assert!(toml.contains("\nproposal = \"/") && toml.contains("cheap\"\n"), "{toml}");
    sandbox.write("dear.toml", toml);
    sandbox.run(&format!("{options} --quiet --out dear")).succeeded();
    sandbox.run("--plan dear.toml --quiet --out from-file").succeeded();
    let rows = |folder: &str| {
        fs::read_to_string(sandbox.path().join(folder).join("samples.csv")).expect("rows")
    };
    assert_eq!(rows("dear"), rows("from-file"), "the option and the plan file say the same");
    sandbox.run(&format!("{options} -j 1 --quiet --out one-thread")).succeeded();
    assert_eq!(rows("dear"), rows("one-thread"));
    // The former result moved away, the run is continued as it began.
    fs::rename(sandbox.path().join("cheap"), sandbox.path().join("moved")).expect("moved");
    sandbox
        .run("--continue-from dear --samples 100 --no-other-kinetics --quiet --out more")
        .succeeded();
    let theta = |rows: &str| -> Vec<String> {
        let row = |row: &str| row.split(',').take(3).collect::<Vec<_>>().join(",");
        rows.lines().skip(1).map(row).collect()
    };
    assert_eq!(theta(&rows("more"))[..60], theta(&rows("dear"))[..]);
    // The posterior of 8192 simulations of the closed form, within the error of sixty runs.
    let of = |folder: &str| sandbox.posterior(folder)["parameters"].clone();
    let (cheap, dear) = (of("moved"), of("dear"));
    for j in 0..3 {
        let number = |of: &serde_json::Value, key: &str| of[j]["in_coordinate"][key].as_f64();
        let [mean, sd, found] = [(&cheap, "mean"), (&cheap, "sd"), (&dear, "mean")]
            .map(|(of, key)| number(of, key).expect("a number"));
        assert!((found - mean).abs() < 0.5 * sd, "{j}: {found} {mean} {sd}");
    }
    sandbox.run("--material peek --proposal dear").refused(&["--proposal", "outside the priors"]);
    for with in ["--resume dear", "--continue-from dear --samples 200", "--plan dear.toml"] {
        sandbox.run(&format!("{with} --proposal dear")).refused(&["--proposal"]);
    }
}

#[test]
fn the_bed_of_the_examples_begins_from_the_posterior_of_its_pair() {
    let sandbox = Sandbox::new();
    for name in ["plan.toml", "bed.toml", "density.csv"] {
        let from = root().join("experiments/external/bed").join(name);
        sandbox.write(&format!("experiments/external/bed/{name}"), fs::read(from).expect(name));
    }
    // The program that the plan calls is this one.
    let plan = "experiments/external/bed/plan.toml";
    let text = fs::read_to_string(sandbox.path().join(plan)).expect("the plan");
    let own = format!("argv = [\"{}\"", env!("CARGO_BIN_EXE_calibrate"));
    let text = text.replace("argv = [\"calibrate\"", &own);
    sandbox.write(plan, text);
    let missing = sandbox.run(&format!("check {plan}"));
    missing.refused(&["sampler.proposal", "results/peek, which is not there"]);
    sandbox.run("--material peek -n 8192 --no-other-kinetics --quiet").succeeded();
    let checked = sandbox.run(&format!("check {plan}"));
    let said = &checked.succeeded().stdout;
    assert!(said.contains("takes       c1, tau_s; delta_c left out"), "{said}");
}
