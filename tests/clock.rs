//! A time of first contact that is calibrated with the kinetics, and a clock that is off.

use std::fmt::Write as _;
use std::fs;

use crate::sandbox::{Sandbox, root};

/// Priors of a material with one more table.
fn priors(material: &str, more: &str) -> String {
    let own = fs::read_to_string(root().join(format!("priors/{material}.toml"))).expect("priors");
    format!("{own}\n{more}\n")
}

/// A built-in table with its times moved by `shift_s` and its contact ratios as they are.
fn shifted(name: &str, shift_s: f64) -> String {
    let table =
        fs::read_to_string(root().join(format!("experiments/{name}.csv"))).expect("a table");
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.fold("time_s,contact_ratio\n".to_owned(), |mut text, row| {
        let (time, ratio) = row.split_once(',').expect("two columns");
        let time: f64 = time.parse().expect("a time");
        writeln!(text, "{},{ratio}", time + shift_s).expect("a string");
        text
    })
}

fn parameter<'r>(record: &'r serde_json::Value, name: &str) -> &'r serde_json::Value {
    let all = record["parameters"].as_array().expect("parameters");
    all.iter().find(|one| one["parameter"]["name"] == name).expect("the parameter")
}

#[test]
fn a_known_time_of_first_contact_is_recovered_and_everything_is_told_in_the_clock_of_the_table() {
    let sandbox = Sandbox::new();
    let times = (1..40).fold("time_s\n".to_owned(), |text, k| {
        format!("{text}{}\n", 0.1 * f64::from(k * k) / 10.0)
    });
    sandbox.write("times.csv", times);
    let curve = sandbox
        .run("simulate --material pa12 --c1 3e-6 --tau-s 3.9 --delta-c 2e-7 --times times.csv");
    let mut table = String::from("time_s,contact_ratio\n0,0.04\n1.5,0.03\n");
    for (k, row) in curve.succeeded().stdout.lines().skip(1).enumerate() {
        let columns: Vec<f64> = row.split(',').map(|one| one.parse().expect("a number")).collect();
        // Errors of a hundredth, evenly spread and in no order.
        let error = 0.02 * ((k as f64 * 0.618_034).fract() - 0.5);
        writeln!(table, "{},{}", columns[0] + 3.0, (columns[3] + error).max(0.0))
            .expect("a string");
    }
    sandbox.write("late.csv", table);
    let t0 = "[t0]\ndistribution = \"uniform\"\nlower = -5\nupper = 10";
    sandbox.write("t0.toml", priors("pa12", t0));
    let options = "--material pa12 --experiment late.csv --prior t0.toml --samples 8192";
    sandbox.run(&format!("{options} --out run")).succeeded();
    let found = sandbox.posterior("run");
    let interval = &parameter(&found, "t0")["in_si"]["eti95"];
    let [lower, upper] = ["lower", "upper"].map(|end| interval[end].as_f64().expect("an end"));
    assert!(lower < 3.0 && 3.0 < upper && upper - lower < 0.5, "t0 is 3, not {lower} .. {upper}");
    let knee = &found["experiments"][0]["neck_growth"]["knee"]["time_s"]["median"];
    assert!(knee.as_f64().expect("a knee") > lower, "{knee}");
    // The row at 1.5 s is before first contact: the bands and the MAP have the starting value there.
    let fit = fs::read_to_string(sandbox.path().join("run/fit.csv")).expect("fit.csv");
    let rows: Vec<Vec<&str>> = fit.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((rows[1][3], &rows[1][5..7]), (rows[2][3], &rows[2][5..7]), "{fit}");
    // Predicted times count from first contact.
    let predicted = sandbox.run("predict --posterior run --contact-ratio 0.9");
    let words = &predicted.succeeded().stdout;
    assert!(words.contains("times count from first contact, at t0 = 3"), "{words}");
    // The plan in text is the same plan.
    let plan = sandbox.run(&format!("{options} --dry-run --toml"));
    sandbox.write("plan.toml", &plan.succeeded().stdout);
    sandbox.run("--plan plan.toml --out again").succeeded();
    let bytes =
        |folder: &str| fs::read(sandbox.path().join(folder).join("samples.csv")).expect("samples");
    assert_eq!(bytes("run"), bytes("again"));
}

#[test]
fn a_posterior_with_t0_is_that_of_quadrature() {
    let sandbox = Sandbox::new();
    let more = "[phi]\ndistribution = \"uniform\"\nlower = 1.1\nupper = 1.35\n\
                [t0]\ndistribution = \"normal\"\nmean = 0\nsd = 1";
    sandbox.write("t0.toml", priors("pa12", more));
    sandbox.write("late.csv", shifted("pa12-r32", 1.0));
    let ran = sandbox.run(
        "--material pa12 --experiment late.csv --prior t0.toml --kinetics frenkel --verify --out run",
    );
    ran.succeeded();
}

/// The lines of the summary that say why to be careful.
fn careful(sandbox: &Sandbox, options: &str) -> Vec<String> {
    let ran = sandbox.run(&format!("{options} --samples 8192 --seed 1 --out out"));
    let found = sandbox.posterior("out");
    assert_eq!(ran.code, 0, "{ran:#?}");
    let lines = found["advice"].as_array().expect("advice").iter();
    lines.map(|line| line.as_str().expect("words").to_owned()).collect()
}

fn about(lines: &[String], words: &str) -> bool {
    lines.iter().any(|line| line.contains(words))
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_clock_that_is_a_thousand_seconds_off_is_suspected_before_the_model_and_the_right_ones_are_not()
{
    let sandbox = Sandbox::new();
    for (material, table) in [("ps", "ps-r30"), ("pa12", "pa12-r32"), ("peek", "peek-450pf-r25")] {
        sandbox.write("late.csv", shifted(table, 1000.0));
        let lines = careful(&sandbox, &format!("--material {material} --experiment late.csv"));
        assert!(
            about(
                &lines,
                "the clock of the table is suspected, and nothing was observed before 100"
            ),
            "{lines:#?}"
        );
        assert!(about(&lines, "add [t0] to the prior, or correct the times"), "{lines:#?}");
        assert!(!about(&lines, "the model or the data are in doubt"), "{lines:#?}");
        let doubt = &sandbox.posterior("out")["experiments"][0]["neck_growth"]["doubts"][0];
        let t0 = doubt["t0_s"].as_f64().expect("t0");
        assert_eq!(doubt["kind"], "clock");
        // PEEK's slow beginning could have begun half a minute earlier.
        assert!((950.0..1020.0).contains(&t0), "{material}: {t0}");
        let lines = careful(&sandbox, &format!("--material {material}"));
        assert!(!about(&lines, "suspected") && !about(&lines, "excludes"), "{lines:#?}");
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_prior_that_excludes_the_answer_is_named_with_what_the_data_ask_for() {
    let sandbox = Sandbox::new();
    let own = fs::read_to_string(root().join("priors/pa12.toml")).expect("priors");
    let with = |was: &str, is: &str| {
        assert!(own.contains(was), "{was}");
        sandbox.write("prior.toml", own.replace(was, is));
        careful(&sandbox, "--material pa12 --prior prior.toml")
    };
    for bounds in ["lower = 300\nupper = 3000", "lower = 0.005\nupper = 0.05"] {
        let lines = with("lower = 0.5\nupper = 50.0", bounds);
        assert!(
            lines[0]
                .starts_with("the prior excludes what the data ask for: for tau_s they ask for 3."),
            "{lines:#?}"
        );
        assert!(!about(&lines, "the model or the data are in doubt"), "{lines:#?}");
    }
    let lines = with(
        "distribution = \"log-uniform\"\nlower = 0.5\nupper = 50.0",
        "distribution = \"log-normal\"\nmedian = 1000\nsd_log10 = 0.3",
    );
    assert!(
        about(&lines, "the prior of tau_s all but excludes what the data ask for"),
        "{lines:#?}"
    );
}

#[test]
fn check_holds_an_experiment_and_priors_against_each_other() {
    let sandbox = Sandbox::new();
    let example = |name: &str| fs::read_to_string(root().join(name)).expect("an example");
    sandbox.write("e.toml", example("experiments/example-my-powder.toml"));
    sandbox.write("example-my-powder.csv", example("experiments/example-my-powder.csv"));
    let own = example("priors/example-my-powder.toml");
    let warned = |was: &str, is: &str, words: &[&str]| {
        assert!(own.contains(was), "{was}");
        sandbox.write("p.toml", own.replace(was, is));
        let ran = sandbox.run("check e.toml p.toml");
        let said = &ran.succeeded().stderr;
        assert_eq!(said.is_empty(), words.is_empty(), "{said}");
        for word in words {
            assert!(said.contains(word), "{word} is not in {said}");
        }
    };
    warned("", "", &[]);
    let unit = [
        "warning: p.toml: [delta_c]",
        "lies above the particle radius R = 0.000021 m of e.toml",
        "unit",
    ];
    warned("lower = 1e-8\nupper = 3e-6", "lower = 1e-2\nupper = 3.0", &unit);
    warned("lower = 1e-8\nupper = 3e-6", "lower = 1e-8\nupper = 1e-3", &["reaches above"]);
    let seconds =
        ["warning: p.toml: [tau_s]", "is far from the times of", "tau_s = ", "unit of time_s"];
    warned("median = 10.0\nsd_log10 = 0.5", "median = 1e4\nsd_log10 = 0.1", &seconds);
    let table = example("experiments/example-my-powder.csv");
    // A contact radius in metres in place of a ratio.
    let metres = table.lines().map(|line| match line.split(',').collect::<Vec<_>>()[..] {
        [time, ratio, sigma] if ratio.parse::<f64>().is_ok() => {
            format!("{time},{},{sigma}\n", 21e-6 * ratio.parse::<f64>().expect("a number"))
        }
        _ => format!("{line}\n"),
    });
    sandbox.write("example-my-powder.csv", metres.collect::<String>());
    let said = sandbox.run("check e.toml").succeeded().stderr.clone();
    assert!(
        said.contains("rows lie below") && said.contains("the adhesive contact a0/R"),
        "{said}"
    );
}
