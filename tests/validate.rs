//! `calibrate validate`: simulation-based calibration of a plan.

use crate::sandbox::Sandbox;

/// 100 small calibrations are too few to pass or fail for certain; the verdict itself is held by the library's tests.
#[test]
#[ignore = "long: run by .ci/run"]
fn a_material_and_its_plan_file_have_the_same_ranks_named_by_the_plan() {
    let sandbox = Sandbox::new();
    let size = "--data-sets 100 --seed 3";
    let of_material =
        sandbox.run(&format!("validate --material pa12 --samples 8192 {size} --out one"));
    let plan = sandbox.run("--material pa12 --samples 8192 --dry-run --toml");
    let plan = plan.succeeded().stdout.clone();
    sandbox.write("plan.toml", plan.replace("name = \"pa12\"", "name = \"mine\""));
    let of_plan = sandbox.run(&format!("validate --plan plan.toml {size} --out other"));
    assert_eq!(of_material.code, of_plan.code, "{of_material:?} {of_plan:?}");
    let read = |name: &str| std::fs::read_to_string(sandbox.path().join(name)).expect(name);
    assert_eq!(read("one/sbc-pa12.csv"), read("other/sbc-mine.csv"));
    assert!(read("other/sbc-mine.md").contains("mine, 100 data sets"));
    assert!(sandbox.path().join("one/sbc-pa12.svg").exists());
}

#[test]
fn noise_without_a_prior_is_refused() {
    let sandbox = Sandbox::new();
    let plan =
        sandbox.run("--material ps --noise fixed:0.03 --dry-run --toml").succeeded().stdout.clone();
    sandbox.write("plan.toml", plan);
    sandbox.run("validate --plan plan.toml").refused(&["noise", "inferred"]);
    assert_eq!(sandbox.run("validate --plan plan.toml --material ps").code, 2);
}
