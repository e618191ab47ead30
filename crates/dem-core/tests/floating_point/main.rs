//! The closed forms near their singular points against 100 digits: `closed_forms.csv`, written by
//! `closed_forms.py` beside it.

use dem_core::{Kinetics, PairSpec, Sintering, SolverSettings, contact_ratios, knee, paper};

#[test]
fn closed_forms_keep_their_digits_near_singular_points() {
    let table = include_str!("closed_forms.csv");
    let mut failures = Vec::new();
    let (mut worst, mut compared) = (0.0f64, 0);
    for (line, row) in table.lines().enumerate().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let kinetics: Kinetics = fields[0].parse().expect("kinetics");
        let number = |place: usize| fields[place].parse::<f64>().expect("a number");
        let scene = PairSpec::new(paper::PA12, number(1)).build().expect("valid");
        let sintering = Sintering { c1: number(2), tau_s: number(3), delta_c: number(4) };
        let (time_s, expected) = (number(5), number(6));
        let mut found = [0.0];
        contact_ratios(
            &scene,
            kinetics,
            &sintering,
            &SolverSettings::default(),
            &[time_s],
            &mut found,
        )
        .expect("valid");
        let error = (found[0] / expected - 1.0).abs();
        compared += 1;
        // Documented: where fast stretching follows slow zipping, the time since the knee has the rounding of
        // the knee's time, a few parts in 1e16 of it, and a/R moves by half of that over tau_s and x.
        let bend = knee(&scene, &sintering);
        let known =
            if kinetics.separates_c1_from_delta_c() && bend.has_zipping && bend.time_s < time_s {
                1e-15 * bend.time_s / sintering.tau_s / (expected * expected)
            } else {
                0.0
            };
        // Documented: Pokluda's law is a series whose error is absolute.
        let is_series = matches!(kinetics, Kinetics::Pokluda | Kinetics::ThreeStagePokluda);
        if is_series && (found[0] - expected).abs() < 2e-14 {
            continue;
        }
        if error > 1e-13 + known {
            failures.push(format!("line {}: off by {error:.1e}: {row}: {}", line + 1, found[0]));
        }
        if known == 0.0 {
            worst = worst.max(error);
        }
    }
    eprintln!("{compared} rows, worst {worst:.1e}");
    assert!(compared > 400, "{compared}");
    assert!(failures.is_empty(), "{} of {compared}\n{}", failures.len(), failures.join("\n"));
}
