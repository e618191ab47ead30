//! Mistakes: exit 2, file, line, field, value and remedy on standard error, and nothing touched.

use crate::sandbox::Sandbox;

const TABLE: &str = "time_s,contact_ratio\n0,0.1\n1,0.5\n2,1.0\n";
const PRIOR: &str = "[tau_s]\ndistribution = \"log-uniform\"\nlower = 0.5\nupper = 50\n";

/// `simulate` and `check` read experiments by the same code as the main job.
#[track_caller]
fn table_is_refused(table: impl AsRef<[u8]>, words: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("my.csv", table);
    sandbox.write("my.toml", "material = \"ps\"\ntable = \"my.csv\"\n");
    let before = sandbox.snapshot();
    let mut words = words.to_vec();
    words.push("my.csv");
    sandbox.run("check my.csv").refused(&words);
    sandbox.run("check my.toml").refused(&words);
    sandbox.run("simulate --experiment my.toml --table3 --out new.csv").refused(&words);
    sandbox.run("simulate --material ps --experiment my.csv --table3").refused(&words);
    sandbox.run("--material ps --experiment my.csv").refused(&words);
    sandbox.run("--experiment my.toml --dry-run").refused(&words);
    assert_eq!(sandbox.snapshot(), before);
}

#[track_caller]
fn description_is_refused(description: &str, words: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("t.csv", TABLE);
    sandbox.write("my.toml", description);
    let before = sandbox.snapshot();
    sandbox.run("check my.toml").refused(words);
    sandbox.run("simulate --experiment my.toml --table3 --out new.csv").refused(words);
    sandbox.run("--experiment my.toml").refused(words);
    assert_eq!(sandbox.snapshot(), before);
}

#[track_caller]
fn prior_is_refused(prior: &str, words: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("p.toml", prior);
    let before = sandbox.snapshot();
    sandbox.run("check p.toml").refused(words);
    if !prior.is_empty() {
        sandbox.run("--material ps --prior p.toml").refused(words);
    }
    assert_eq!(sandbox.snapshot(), before);
}

#[test]
fn empty_tables_and_missing_columns() {
    table_is_refused("", &["empty table", "help: the shortest table"]);
    table_is_refused("time_s,contact_ratio\n", &["line 1", "header without rows"]);
    table_is_refused("time_s,sigma\n0,1\n", &["line 1, column contact_ratio: missing"]);
    table_is_refused("0,0.1\n1,0.5\n", &["line 1", "put the line \"time_s,contact_ratio\""]);
    table_is_refused("time,contact_ratio\n0,0\n", &["line 1, column time", "called time_s"]);
}

#[test]
fn unsorted_and_repeated_times() {
    let unsorted = "# c\ntime_s,contact_ratio\n0,0.1\n2,0.2\n1,0.3\n";
    table_is_refused(unsorted, &["line 5, column time_s: found 1", "2 of line 4", "sort the rows"]);
    let repeated = "time_s,contact_ratio\n1,0.1\n1,0.2\n";
    table_is_refused(repeated, &["line 3, column time_s: found 1, the same as in line 2"]);
}

#[test]
fn values_that_are_no_numbers_not_finite_negative_or_absurd() {
    let row = |row: &str| format!("time_s,contact_ratio\n{row}\n");
    table_is_refused(
        row("0,abc"),
        &["line 2, column contact_ratio: found \"abc\", expected a number >= 0"],
    );
    table_is_refused(row("0,NaN"), &["line 2, column contact_ratio: found NaN"]);
    table_is_refused(row("inf,0.1"), &["line 2, column time_s: found inf"]);
    table_is_refused(row("0,-0.1"), &["found -0.1, expected a number >= 0"]);
    table_is_refused(row("-3,0.1"), &["column time_s: found -3", "first contact"]);
    table_is_refused(row("0,43"), &["found 43", "percent"]);
    table_is_refused(row("0,0.1,7"), &["found 3 values, expected 2"]);
    table_is_refused("time_s;contact_ratio\n0.5;0,5\n", &["found \"0,5\"", "write all alike"]);
    table_is_refused(
        "time_s;contact_ratio\n1,234;1,100\n",
        &["found \"1,234\"", "--decimal comma"],
    );
    table_is_refused(row("1e-320,0.1"), &["line 2, column time_s: found 1e-320", "1e-15"]);
    table_is_refused(row("1e308,0.1"), &["line 2, column time_s: found 1e308", "1e15 s"]);
}

#[test]
fn files_that_are_no_text() {
    table_is_refused(b"time_s,contact_ratio\n0,\x81\n", &["line 2", "0x81", "UTF-8"]);
    table_is_refused(b"time_s,contact_ratio\n0,\xff\n", &["line 2", "found \"\u{ff}\""]);
    table_is_refused(b"\xff\xfet\0i\0m\0e", &["UTF-16"]);
    table_is_refused(b"PK\x03\x04......", &["a workbook", "\"CSV UTF-8\""]);
}

#[test]
fn files_that_are_not_there() {
    let sandbox = Sandbox::new();
    sandbox.write("powder.csv", TABLE);
    sandbox
        .run("check powdr.csv")
        .refused(&["powdr.csv: no such file", "did you mean powder.csv?"]);
    sandbox.write("my.toml", "material = \"ps\"\ntable = \"powdr.csv\"\n");
    sandbox.run("check my.toml").refused(&[
        "powdr.csv: no such file",
        "my.toml, line 2, names it",
        "powder.csv?",
    ]);
    sandbox
        .run("simulate --material ps --table3 --times no.csv")
        .refused(&["no.csv: no such file"]);
    sandbox.run("simulate --experiment pa12-r99.toml --table3").refused(&["no such file"]);
    sandbox.write("folder/x.csv", TABLE);
    sandbox.run("check folder/x.csv").succeeded();
    sandbox.run("simulate --material ps --table3 --times folder").refused(&["a directory"]);
}

#[test]
fn unknown_materials_fields_and_names() {
    let ps = "material = \"ps\"\ntable = \"t.csv\"\n";
    let unknown = "material = \"pa21\"\ntable = \"t.csv\"\n";
    description_is_refused(
        unknown,
        &["my.toml, line 1, field material: found \"pa21\"", "\"pa12\"?"],
    );
    description_is_refused(
        &format!("{ps}titel = \"x\"\n"),
        &["line 3, field titel", "mean title?"],
    );
    description_is_refused("table = \"t.csv\"\n", &["field material: found missing", "[powder]"]);
    description_is_refused("material = \"ps\"\n", &["field table: found missing", "add table"]);
    description_is_refused(&format!("{ps}title\n"), &["my.toml, line 3", "not TOML"]);
    let sandbox = Sandbox::new();
    sandbox.run("simulate --material pekk --table3").refused(&["--material", "peek"]);
    sandbox.run("simulate --material ps --table3 --kinetics frenkle").refused(&["frenkel"]);
    sandbox.run("simulate --material ps --table3 --solver verlett").refused(&["verlet"]);
    sandbox.run("simulat --material ps").refused(&["simulate"]);
    sandbox.run("--material ps --resume").refused(&["--resume"]);
}

#[test]
fn radii_windows_and_final_contact_ratios_that_cannot_be() {
    let ps = "material = \"ps\"\ntable = \"t.csv\"\n";
    let with = |line: &str| format!("{ps}{line}\n");
    description_is_refused(&with("radius_m = 0"), &["line 3, field radius_m: found 0", "> 0 [m]"]);
    description_is_refused(&with("radius_m = 30.5"), &["is that in um? write radius_m = 30.5e-6"]);
    description_is_refused(&with("window_s = [2, 1]"), &["line 3, field window_s", "swap"]);
    description_is_refused(&with("window_s = [7, 9]"), &["window_s", "from 0 s to 2 s"]);
    description_is_refused(&with("final_contact_ratio = 126"), &["between 0.1 and 2"]);
    let own = "table = \"t.csv\"\n[powder]\nradius_m = 2e-5\nyoungs_modulus_pa = 1.6\n\
               surface_tension_n_per_m = 0.03\n";
    description_is_refused(own, &["powder.youngs_modulus_pa", "is that in GPa?"]);
}

#[test]
fn priors_with_bounds_the_wrong_way_round_or_unknown_names() {
    prior_is_refused(
        &PRIOR.replace("0.5", "500"),
        &["p.toml, line 3, field tau_s.lower: found lower = 500, upper = 50", "swap them"],
    );
    prior_is_refused(&PRIOR.replace("0.5", "0"), &["field tau_s.lower: found 0", "> 0"]);
    prior_is_refused(&PRIOR.replace("0.5", "\"low\""), &["found \"low\", expected a number"]);
    prior_is_refused(&PRIOR.replace("log-uniform", "loguniform"), &["\"log-uniform\"?"]);
    prior_is_refused(&PRIOR.replace("upper", "uper"), &["field tau_s.upper: found missing"]);
    prior_is_refused(&format!("{PRIOR}[c2]\n"), &["line 5, field c2", "mean c1?"]);
    prior_is_refused("", &["an empty file"]);
    prior_is_refused(
        &PRIOR.replace("0.5", "1e-300").replace("50", "1e300"),
        &["p.toml, line 3, field tau_s.lower: found 1e-300", "between 1e-15 and 1e15 s"],
    );
}

/// What `check` lets through does not fail after the work.
#[test]
fn the_widest_priors_and_times_that_are_taken_end_in_a_posterior() {
    let sandbox = Sandbox::new();
    sandbox.write("t.csv", "time_s,contact_ratio\n1e-15,0.1\n1,0.3\n1e15,0.9\n");
    let wide = |name: &str, lower: f64, upper: f64| {
        format!(
            "{name} = {{ distribution = \"log-uniform\", lower = {lower:e}, upper = {upper:e} }}\n"
        )
    };
    let priors = [("c1", 1e-30, 1e30), ("tau_s", 1e-15, 1e15), ("delta_c", 1e-15, 1e3)];
    sandbox.write("p.toml", priors.map(|(name, lower, upper)| wide(name, lower, upper)).concat());
    sandbox.run("check t.csv p.toml").succeeded();
    sandbox
        .run("--material ps --experiment t.csv --prior p.toml --samples 8192 --out r")
        .succeeded();
    sandbox.posterior("r");
    sandbox.run("predict --posterior r --contact-ratio 0.9 --after 1e-15,1e15").succeeded();
}

#[test]
fn options_that_exclude_or_need_each_other() {
    let sandbox = Sandbox::new();
    sandbox.write("t.csv", TABLE);
    sandbox.write("ps.toml", "material = \"ps\"\ntable = \"t.csv\"\n");
    let own = "table = \"t.csv\"\n[powder]\nradius_m = 2e-5\nyoungs_modulus_pa = 1.6e9\n\
               surface_tension_n_per_m = 0.03\n";
    sandbox.write("own.toml", own);
    sandbox
        .run("predict --posterior p --contact-ratio 0.9 --radius-m 1")
        .refused(&["expected 1e-9 to 1e-2 m", "is that in um? write 1e-6"]);
    sandbox.run("predict --posterior p --after 1e308").refused(&["between 1e-15 and 1e15 s"]);
    sandbox.run("--experiment ps-r30 --time-unit min").refused(&["whose columns are known"]);
    sandbox
        .run("--plan x.toml --time-unit min")
        .refused(&["'--plan <FILE>' cannot be used with '--time-unit <UNIT>'"]);
    sandbox.run("simulate --table3").refused(&["--material", "ps|pa12|peek"]);
    sandbox.run("simulate --material ps").refused(&["--tau-s", "--table3"]);
    sandbox.run("simulate --material ps --tau-s 1").refused(&["--c1"]);
    sandbox.run("simulate --experiment t.csv --table3").refused(&["bare table", "--material"]);
    sandbox
        .run("simulate --material pa12 --experiment ps.toml --table3")
        .refused(&["--material: found pa12, expected ps"]);
    sandbox.run("simulate --material ps --experiment own.toml --table3").refused(&["[powder]"]);
    sandbox.run("simulate --experiment own.toml --table3").refused(&["--table3", "--tau-s"]);
    sandbox
        .run("simulate --material ps --kinetics frenkel --tau-s 1 --c1 1")
        .refused(&["--c1", "frenkel"]);
    sandbox.run("simulate --material ps --table3 --step 0.01").refused(&["--solver verlet"]);
}

#[test]
fn a_step_beyond_the_stability_limit_is_refused() {
    let sandbox = Sandbox::new();
    sandbox
        .run("simulate --material ps --table3 --solver verlet --step 0.3")
        .refused(&["--step", "stability limit"]);
}

#[test]
fn output_that_cannot_be_written_is_refused_and_existing_files_stay() {
    let sandbox = Sandbox::new();
    sandbox.write("file", "mine");
    sandbox.write("folder/notes", "mine");
    let before = sandbox.snapshot();
    for out in ["file/curve.csv", "folder", "no/such/folder/curve.csv"] {
        sandbox
            .run(&format!("simulate --material ps --table3 --out {out}"))
            .refused(&[out, "--out"]);
    }
    assert_eq!(sandbox.snapshot(), before);
}

#[test]
fn results_go_nowhere_near_what_is_not_a_run() {
    let sandbox = Sandbox::new();
    sandbox.write("file", "mine");
    sandbox.write("thesis/chapter1.tex", "mine");
    // As a run that was cut off by a full disk of old would have left it.
    sandbox.write("cut/posterior.json", "{\"schema_version\": 1, \"plan\": {\"na");
    let before = sandbox.snapshot();
    sandbox.run("--material ps --out file").refused(&["file: found a file", "--out"]);
    sandbox.run("--material ps --out file/results").refused(&["file/results", "--out"]);
    sandbox.run("--material ps --out thesis").refused(&["thesis", "no posterior.json", "--out"]);
    sandbox.run("--material ps --out cut").refused(&["cut", "not whole", "--out"]);
    assert_eq!(sandbox.snapshot(), before);
}

#[test]
fn a_main_job_that_lacks_something_says_what() {
    let sandbox = Sandbox::new();
    sandbox.write("t.csv", TABLE);
    let own = "table = \"t.csv\"\n[powder]\nradius_m = 2e-5\nyoungs_modulus_pa = 1.6e9\n\
               surface_tension_n_per_m = 0.03\n";
    sandbox.write("own.toml", own);
    sandbox.write("tau.toml", PRIOR);
    let before = sandbox.snapshot();
    sandbox.run("--quiet").refused(&["--material", "--experiment"]);
    sandbox.run("--experiment own.toml").refused(&["--prior", "priors/example-my-powder.toml"]);
    sandbox.run("--experiment t.csv").refused(&["t.csv", "bare table", "--material"]);
    sandbox.run("--material ps --prior tau.toml").refused(&["tau.toml", "[c1]", "frenkel"]);
    sandbox.run("--material ps --prior no.toml").refused(&["no.toml: no such file"]);
    sandbox.run("--material ps --prior t.csv").refused(&["t.csv", "priors in TOML"]);
    sandbox.run("--material ps --window 5:9").refused(&["--window: found 5:9", "1.0651 s"]);
    sandbox.run("--material ps --window 9:5").refused(&["--window", "5:9"]);
    sandbox.run("--material ps --noise fixed:table").refused(&["--noise", "column sigma"]);
    sandbox.run("--material pa12 --noise fixed-relative:0.1").refused(&["--noise", "time_s = 0"]);
    assert_eq!(sandbox.snapshot(), before);
}

#[test]
fn a_truncated_posterior_is_refused_by_inspect_and_check() {
    let sandbox = Sandbox::new();
    sandbox.write("posterior.json", "{\"schema_version\": 1, \"plan\": {\"na");
    sandbox.run("inspect posterior.json").refused(&["posterior.json, line 1", "cut off"]);
    sandbox.run("inspect .").refused(&["posterior.json", "line 1"]);
    sandbox.run("check posterior.json").refused(&["posterior.json", "line 1"]);
    sandbox.run("inspect no.json").refused(&["no.json: no such file"]);
}

#[test]
fn nothing_at_all_says_what_the_main_job_is() {
    let ran = Sandbox::new().run("");
    assert_eq!((ran.code, ran.stdout.as_str()), (2, ""));
    assert!(ran.stderr.contains("calibrate --material ps"), "{}", ran.stderr);
}

#[test]
fn check_goes_on_after_a_mistake_and_reports_all() {
    let sandbox = Sandbox::new();
    sandbox.write("good.csv", TABLE);
    sandbox.write("bad.csv", "time_s\n");
    let ran = sandbox.run("check bad.csv good.csv missing.csv");
    assert_eq!(ran.code, 2);
    assert!(ran.stdout.starts_with("good.csv: ok"), "{}", ran.stdout);
    assert_eq!(ran.stderr.matches("error: ").count(), 2, "{}", ran.stderr);
}
