//! Work of the default runs: more work is a worse algorithm, and less work needs an explanation.

use dem_core::printed::{PrintedTable3, from_printed};
use dem_core::{Kinetics, PairSpec, Powder, SolverKind, SolverSettings, contact_ratios, paper};

/// Steps and evaluations of the law for one curve at 40 times up to `last_s`.
fn work(
    powder: Powder,
    table: &PrintedTable3,
    phi: f64,
    last_s: f64,
    kind: SolverKind,
) -> (u64, u64) {
    let scene = PairSpec::new(powder, phi).build().expect("valid");
    let sintering = from_printed(table, powder.radius_m);
    let times_s: Vec<f64> = (0..40).map(|i| last_s * f64::from(i) / 39.0).collect();
    let mut out = vec![0.0; times_s.len()];
    let settings = SolverSettings::of(kind);
    let report =
        contact_ratios(&scene, Kinetics::ThreeStage, &sintering, &settings, &times_s, &mut out)
            .expect("valid");
    (report.steps, report.force_evaluations)
}

#[test]
fn default_runs_cost_the_steps_they_did() {
    let materials = [
        ("PS", paper::PS, &paper::PS_TABLE3, 1.08, 1.0),
        ("PA12", paper::PA12, &paper::PA12_TABLE3, 2f64.cbrt(), 15.0),
        ("PEEK", paper::PEEK_450PF, &paper::PEEK_450PF_TABLE3, 2f64.cbrt(), 78.0),
    ];
    let found: Vec<_> = materials
        .iter()
        .map(|&(name, powder, table, phi, last_s)| {
            let [verlet, quasi_static, closed] =
                SolverKind::ALL.map(|kind| work(powder, table, phi, last_s, kind));
            (name, verlet, quasi_static, closed)
        })
        .collect();
    let expected = [
        ("PS", (3328, 3328), (76, 482), (0, 0)),
        ("PA12", (171_264, 171_264), (68, 434), (0, 0)),
        ("PEEK", (1_800_960, 1_800_960), (90, 566), (0, 0)),
    ];
    assert_eq!(found, expected);
}
