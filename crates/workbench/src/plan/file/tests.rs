use campaign::{Format, Interpolation, Keep};

use super::*;
use smc_calib::Noise;

const PLAN: &str = r#"
[parameters.k]
unit = "N/m"
distribution = "log-uniform"
lower = 1
upper = 10

[experiments.pull.simulator]
kind = "command"
argv = ["sh", "-c", "echo {k} {{}} > out.txt"]

[experiments.pull.observables.force]
table = "force.txt"
control = "u"
value = "f"
noise = { kind = "inferred", s0 = 0.1 }
result = { file = "out.csv", control = "x", value = "y" }

[sampler]
samples = 40
"#;
const TABLE: &str = "# u f s\n0 0 0.1\n1 2 0.1\n2 4 0.2\n";

struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("force.txt"), TABLE).expect("written");
        Self { folder }
    }

    fn read(&self, text: &str) -> Result<Planned, InputError> {
        Planned::parse(&self.folder.path().join("my.toml"), text.to_owned())
    }
}

#[test]
fn a_plan_is_read_with_its_defaults() {
    let file = Place::new().read(PLAN).expect("a plan");
    let plan = &file.plan;
    assert_eq!((plan.name.as_str(), plan.title.as_str()), ("my", "my"));
    assert_eq!(plan.parameter_names(), ["k"]);
    assert_eq!((plan.sampler.samples, plan.sampler.map_simulations), (40, 0));
    let late = PLAN.replacen("samples = 40", "samples = 40\noverlap = 10", 1);
    let late = Place::new().read(&late).expect("a plan").plan;
    assert_eq!((plan.sampler.overlap, late.sampler.overlap), (0, 10));
    assert!(crate::plan::toml::toml(&late).contains("\noverlap = 10\n"));
    let observable = &plan.experiments[0].observables[0];
    assert_eq!(observable.control, [0.0, 1.0, 2.0]);
    assert_eq!(observable.values, [0.0, 2.0, 4.0]);
    assert_eq!(observable.noise, Noise::Inferred { nu0: 4.0, s0: 0.1 });
    let result = observable.result.as_ref().expect("a result");
    assert_eq!((result.format, result.interpolate), (Format::Csv, Interpolation::Linear));
    let SimulatorPlan::Command(command) = &plan.experiments[0].simulator else {
        panic!("a command");
    };
    assert_eq!((command.timeout_s, command.retries, command.keep), (3600.0, 2, Keep::Failed));
    assert_eq!(file.executor, ExecutorPlan::Local { parallel: None });
    let text = serde_json::to_string(plan).expect("JSON");
    assert_eq!(serde_json::from_str::<Plan>(&text).expect("back"), *plan);
}

#[test]
fn the_same_plan_in_json_is_the_same_plan() {
    let place = Place::new();
    let value: toml::Value = toml::from_str(PLAN).expect("TOML");
    let json = serde_json::to_string_pretty(&value).expect("JSON");
    let path = place.folder.path().join("my.json");
    let from_json = Planned::parse(&path, json).expect("a plan");
    assert_eq!(from_json.plan, place.read(PLAN).expect("a plan").plan);
    let broken = "{\n \"parameters\": {\n  \"k\": { \"unit\": 3 }\n } }";
    let error = Planned::parse(&path, broken.to_owned()).expect_err("wrong type");
    assert_eq!((error.mistake, error.line), (Mistake::WrongType, Some(3)), "{error}");
    for (text, mistake) in [
        ("", Mistake::Syntax),
        ("{", Mistake::Syntax),
        ("[1]", Mistake::WrongType),
        ("{\"name\": null}", Mistake::WrongType),
        ("{\"name\": \"a\", \"name\": \"b\"}", Mistake::Duplicate),
        ("{\"name\": \"a\",}", Mistake::Syntax),
        ("{} x", Mistake::Syntax),
    ] {
        let error = Planned::parse(&path, text.to_owned()).expect_err(text);
        assert_eq!(error.mistake, mistake, "{text}: {error}");
    }
}

#[test]
fn each_mistake_names_its_line_and_field() {
    let place = Place::new();
    for (old, new, says) in [
        ("unit = ", "units = ", "parameters.k.unit?"),
        ("lower = 1\n", "lower = 11\n", "parameters.k.lower"),
        ("lower = 1\n", "", "field parameters.k.lower"),
        ("[parameters.k]", "[parameters.run]", "placeholder"),
        ("[parameters.k]", "[parameters.\"k m\"]", "a letter"),
        ("kind = \"command\"", "kind = \"comand\"", "did you mean \"command\"?"),
        ("kind = \"command\"\n", "", "experiments.pull.simulator.kind"),
        ("{k}", "{kk}", "did you mean {k}?"),
        ("{{}}", "{}", "one of k, parameters"),
        ("{{}}", "}", "written twice"),
        ("\"sh\", ", "\"no-such-program-anywhere\", ", "not on the path"),
        ("\"sh\", ", "\"./nothing.sh\", ", "nothing.sh"),
        ("\"sh\", ", "\"{plan_dir}/nothing.sh\", ", "a file that is there"),
        ("argv = [\"sh\"", "argv = [3", "text in quotes"),
        ("argv = ", "timeout_s = -1\nargv = ", "timeout_s"),
        ("argv = ", "retries = 1.5\nargv = ", "whole number"),
        ("argv = ", "keep = \"al\"\nargv = ", "did you mean \"all\"?"),
        ("table = \"force.txt\"", "table = \"forse.txt\"", "force.txt?"),
        ("value = \"f\"", "value = \"g\"", "column g"),
        ("control = \"u\"", "control = \"v\"", "column v"),
        ("noise = { kind = \"inferred\", s0 = 0.1 }\n", "", "how the measurements scatter"),
        ("s0 = 0.1", "s0 = 0", "noise.s0"),
        ("{ kind = \"inferred\", s0 = 0.1 }", "{ kind = \"inferred\" }", "noise.s0"),
        ("{ kind = \"inferred\", s0 = 0.1 }", "{ kind = \"fixed-table\" }", "standard deviations"),
        ("{ kind = \"inferred\", s0 = 0.1 }", "{ kind = \"fixed-relative\", share = 0.1 }", "zero"),
        ("out.csv", "../out.csv", "folder of the run"),
        ("out.csv", "out", "does not say"),
        ("control = \"x\", ", "", "result.control"),
        ("value = \"y\" }", "value = \"y\", interpolate = \"cubic\" }", "linear, refuse"),
        ("samples = 40", "samples = 4", "from 16 to"),
        ("samples = 40", "samples = 40\noverlap = 11", "sampler.overlap"),
        ("samples = 40", "samples = 40\noverlap = 11", "a whole number from 0 to 10"),
        ("samples = 40", "samples = 40\noverlap = 0.5", "a whole number from 0 to 10"),
        ("samples = 40", "sample = 40", "sampler.samples?"),
        ("samples = 40", "design = \"no.txt\"", "no.txt"),
        ("[sampler]", "[executor]\nkind = \"threads\"\n[sampler]", "built-in simulators alone"),
        ("[sampler]", "[executor]\nkind = \"slurm\"\nextra = [\"-q low\"]\n[sampler]", "long form"),
        ("[sampler]", "[samples]\n", "sampler?"),
    ] {
        assert!(PLAN.contains(old), "{old}");
        let error = place.read(&PLAN.replacen(old, new, 1)).expect_err(new);
        assert!(error.to_string().contains(says), "{new}:\n{error}");
        let of_the_plan = error.source_name.ends_with("my.toml");
        assert!(!of_the_plan || error.line.is_some() || says == "sampler?", "{error}");
    }
}

#[test]
fn parts_that_are_missing_are_named() {
    let place = Place::new();
    for (text, says) in [
        ("", "field parameters"),
        ("[parameters]\n[experiments]\n", "at least one [parameters.NAME]"),
        ("parameters = 3\n", "a table [parameters]"),
        (&PLAN[..PLAN.find("[experiments.pull.simulator]").expect("there")], "experiments"),
        (
            &PLAN[..PLAN.find("[experiments.pull.observables").expect("there")],
            "experiments.pull.observables",
        ),
    ] {
        let error = place.read(text).expect_err(text);
        assert!(error.to_string().contains(says), "{text}:\n{error}");
    }
}

const PAIRS: &str = r#"
[parameters.c1]
distribution = "log-uniform"
lower = 1e-8
upper = 1e-2
[parameters.tau_s]
unit = "s"
distribution = "log-uniform"
lower = 0.5
upper = 50
[parameters.delta_c]
distribution = "log-uniform"
lower = 1e-8
upper = 3e-6
[experiments.r32.simulator]
kind = "builtin"
experiment = "pa12-r32"
tau_s_radius_m = 31.5e-6
[experiments.r30.simulator]
kind = "builtin"
experiment = "pa12-r30"
tau_s_radius_m = 31.5e-6
[experiments.r30.observables.contact_ratio]
window = [0.0, 10.0]
noise = { kind = "fixed", sigma = 0.05 }
"#;

#[test]
fn pairs_of_two_radii_share_parameters_and_must_say_whose_tau_s_it_is() {
    let place = Place::new();
    let plan = place.read(PAIRS).expect("a plan").plan;
    assert_eq!(plan.experiments.len(), 2);
    assert_eq!(plan.experiments[0].observables[0].values.len(), 30);
    assert!(plan.experiments[1].observables[0].values.len() < 30);
    let error =
        place.read(&PAIRS.replacen("tau_s_radius_m = 31.5e-6\n", "", 1)).expect_err("whose tau_s?");
    assert!(error.to_string().contains("tau_s_radius_m"), "{error}");
    let own = PAIRS.replace("tau_s_radius_m = 31.5e-6\n", "").replace(
        "experiment = \"pa12-r30\"\n",
        "experiment = \"pa12-r30\"\nparameters = { tau_s = \"tau_30\" }\n",
    );
    let error = place.read(&own).expect_err("no such parameter");
    assert!(error.to_string().contains("tau_30"), "{error}");
    let own = own.replacen(
        "[parameters.delta_c]",
        "[parameters.tau_30]\ndistribution = \"uniform\"\nlower = 1\nupper = 9\n[parameters.delta_c]",
        1,
    );
    place.read(&own).expect("a tau_s of its own");
    for (old, new, says) in [
        ("lower = 0.5\n", "lower = -0.5\n", "parameters.tau_s.lower"),
        ("[parameters.delta_c]", "[parameters.delta_d]", "delta_c"),
        ("\"pa12-r30\"", "\"pa12-r31\"", "pa12-r31"),
        ("observables.contact_ratio", "observables.force", "contact_ratio"),
        ("window = [0.0, 10.0]", "window = [100.0, 101.0]", "window"),
        ("tau_s_radius_m", "tau_radius_m", "tau_s_radius_m?"),
    ] {
        let error = place.read(&PAIRS.replacen(old, new, 1)).expect_err(new);
        assert!(error.to_string().contains(says), "{new}:\n{error}");
    }
}

#[test]
fn a_design_gives_the_parameter_sets_and_must_lie_in_the_prior() {
    let place = Place::new();
    let design = place.folder.path().join("sets.txt");
    std::fs::write(&design, "!OMP_NUM_THREADS description key k\n1 a 0 2\n1 b 1 3\n")
        .expect("written");
    let text = PLAN.replace("samples = 40", "design = \"sets.txt\"");
    let plan = place.read(&text).expect("a plan").plan;
    assert_eq!(plan.design.as_ref().expect("a design").sets, [[2.0], [3.0]]);
    assert_eq!(plan.budget(), 2);
    let error = place.read(&text.replace("design", "samples = 99\ndesign")).expect_err("both");
    assert_eq!(error.mistake, Mistake::Conflict);
    place.read(&text.replace("design", "samples = 2\ndesign")).expect("they agree");
    std::fs::write(&design, "description k\na 2\nb 30\n").expect("written");
    let error = place.read(&text).expect_err("out of the prior");
    assert_eq!((error.mistake, error.line), (Mistake::OutOfRange, Some(3)));
}

#[test]
fn a_plan_says_how_many_processes_stand_idle_and_none_does_with_the_batch_that_it_names() {
    for samples in [17, 30, 50, 51, 100, 101, 150, 151, 200, 201, 300, 1000, 2047, 2048, 9000] {
        for parallel in [1, 2, 3, 4, 5, 8, 13, 64] {
            let words = |batch: String| {
                let text =
                    PLAN.replacen("samples = 40", &format!("samples = {samples}\n{batch}"), 1);
                let text = format!("{text}\n[executor]\nkind = \"local\"\nparallel = {parallel}\n");
                let planned = Place::new().read(&text).expect("a plan");
                crate::plan::understood(&planned).details
            };
            let idle = |lines: &[String]| {
                lines.iter().find_map(|l| Some(l.trim().strip_prefix("idle")?.trim().to_owned()))
            };
            let lines = words(String::new());
            let at_a_time = match () {
                () if samples <= 50 => "one by one",
                () if samples <= 100 => "up to 2 at a time",
                () if samples <= 150 => "up to 3 at a time",
                () if samples == 2048 => "the first 400 placed by a Gaussian process",
                () if samples == 9000 => "8 adaptive stages",
                () if samples == 300 => "up to 12 at a time",
                () => " at a time",
            };
            assert!(
                lines.iter().any(|l| l.contains("sampler") && l.contains(at_a_time)),
                "{lines:?}"
            );
            let few = usize::from(samples > 50) + usize::from(samples > 100) + 1;
            if samples <= 150 {
                assert_eq!(idle(&lines).is_some(), few < parallel, "{samples} {parallel}");
            }
            if let Some(idle_now) = idle(&lines) {
                let expected = format!("{} of {parallel} processes", parallel - few);
                assert!(samples > 150 || idle_now.starts_with(&expected), "{idle_now}");
                let batch = idle_now.split("batch = ").nth(1).and_then(|t| t.split(' ').next());
                let with = words(format!("batch = {}", batch.expect("a remedy")));
                assert_eq!(idle(&with), None, "{samples} {parallel}: {with:?}");
            }
        }
    }
}
