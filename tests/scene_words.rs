//! What `calibrate scene` says of stiffness, box and closed laws, and what it is careful about.

use crate::sandbox::{Sandbox, root};

/// Sixty particles that settle softly and are heated between fixed sides with necks that resist.
const SETTLED: &str = r#"
name = "settled"
[material]
youngs_modulus_pa = 1.65e9
surface_tension_n_per_m = 40.7e-3
density_kg_per_m3 = 1000.0
k1_n_per_m = 0.5
[sintering]
kinetics = "frenkel"
neck_viscosity = 10.0
c1 = 1.0
tau_s = 3.81
delta_c = 1e-7
calibrated_radius_m = 31.5e-6
[box]
size_m = [252e-6, 252e-6, 1e-3]
sides = ["periodic", "periodic", "lower-wall"]
[particles.packing]
count = 60
relative_density = 0.45
radii = { equal = { radius_m = 31.5e-6 } }
seed = 1
[adhesion]
bond_number = 100.0
[gravity]
acceleration_m_per_s2 = [0.0, 0.0, -9.81]
[drag]
viscosity_pa_s = 2e-4
[friction]
coefficient = 0.0
[[phases]]
name = "settle"
duration_s = 0.05
heated = false
outputs = 1
[[phases]]
name = "heat"
duration_s = 1.5
heated = true
mode = "quasi-static"
outputs = 15
tolerance = 3e-3
"#;

#[test]
#[ignore = "long: run by .ci/run"]
fn a_scene_says_its_stiffness_its_box_and_the_rates_where_a_closed_law_takes_over() {
    let sandbox = Sandbox::new();
    sandbox.write("settled.toml", SETTLED);
    let dry = sandbox.run("scene settled.toml --dry-run");
    let words = ["box periodic, periodic, lower-wall", "friction 0", "K1 0.500 N/m", "K1 4.08 N/m"];
    for words in words {
        assert!(dry.succeeded().stdout.contains(words), "{words}: {}", dry.stdout);
    }
    let ran = sandbox.run("scene settled.toml --out run");
    for words in [
        "with K1 = 0.500 N/m\n",
        "with K1 = 4.08 N/m, balanced with which the bed begins at a density of 0.5",
        "its box of 252.0 x 252.0 x 1000 um stretched to 25",
        "x 1000 um\n",
        "careful.md, \"soft-settling\"",
        "fa/(K1 R) = 0.0082, above 0.002",
        "K1 of 2.0 N/m or more is hard enough",
        "per tau_s by its pairs and goes on at 0.6",
    ] {
        assert!(ran.succeeded().stdout.contains(words), "{words}: {}", ran.stdout);
    }
    let record = sandbox.json("run/scene.json");
    let [settle, heat] = [0, 1].map(|phase| record["phases"][phase].clone());
    assert_eq!(settle["k1_n_per_m"], 0.5);
    assert_eq!(settle["box_m"], heat["box_before_m"]);
    assert_eq!(heat["box_m"][2], 1e-3);
    let [by_pairs, by_law] = ["by_pairs_per_tau_s", "by_closed_law_per_tau_s"]
        .map(|rate| record["pairs_end_rates"][rate].as_f64().expect("a rate"));
    assert!(by_pairs > 0.1 && by_law > 1.2 * by_pairs, "{by_pairs} {by_law}");
    // Hard enough, and free to move: nothing to be said of the stiffness.
    let hard = SETTLED.replace("k1_n_per_m = 0.5", "k1_n_per_m = 2.1");
    sandbox.write("hard.toml", hard.replace("duration_s = 1.5", "duration_s = 0.1"));
    let ran = sandbox.run("scene hard.toml --out hard");
    assert!(!ran.succeeded().stdout.contains("careful"), "{}", ran.stdout);
    // What would not be heated is not settled first, and nothing is promised.
    sandbox.write("heavy.toml", SETTLED.replace("bond_number = 100.0", "bond_number = 10.0"));
    let heavy = sandbox.run("scene heavy.toml --out heavy");
    assert!(heavy.stderr.contains("0.375 of the adhesive force"), "{}", heavy.stderr);
    assert!(!heavy.stderr.contains("goes on from there"), "{}", heavy.stderr);
}

#[test]
fn small_examples_have_nothing_to_be_careful_about() {
    let sandbox = Sandbox::new();
    for name in ["pair", "chain-of-ten", "four-particles"] {
        let path = root().join(format!("experiments/scenes/{name}.toml")).display().to_string();
        let ran = sandbox.run_args(&["scene", &path, "--out", name]);
        assert!(!ran.succeeded().stdout.contains("careful"), "{name}: {}", ran.stdout);
    }
}
