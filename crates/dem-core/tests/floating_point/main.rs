//! The closed forms near their singular points against 100 digits: `closed_forms.csv`, written by
//! `closed_forms.py` beside it.

use dem_core::heat::{Heat, History, Mobility, MobilityLaw};
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
        let sintering =
            Sintering { c1: number(2), tau_s: number(3), delta_c: number(4), lambda: 0.0 };
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

/// Reduced times against exponential integrals of 50 digits: `reduced_times.csv`, written by `reduced_times.py`.
#[test]
fn reduced_times_are_those_of_the_exponential_integrals() {
    let (mut worst, mut compared) = (0.0f64, 0);
    for row in include_str!("reduced_times.csv").lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let number = |place: usize| fields[place].parse::<f64>().expect("a number");
        let (first, second, reference_k) = (number(1), number(2), number(3));
        let law = match fields[0] {
            "arrhenius" => {
                MobilityLaw::Arrhenius { activation_energy_j_per_mol: first, reference_k }
            }
            _ => MobilityLaw::Wlf { c1: first, c2_k: second, reference_k },
        };
        let (low, high, scale, floor) = (number(5), number(6), number(7), number(8));
        let mut mobility = Mobility::new(law).expect("valid");
        if floor > 0.0 {
            mobility = mobility.frozen_below(floor).expect("a temperature");
        }
        let history = match fields[4] {
            "pulse" => History::Pulse { ambient_k: low, rise_k: high, cooling_s: scale },
            _ => {
                History::RampAndHold { start_k: low, rate_k_per_s: scale, hold_k: high, then: None }
            }
        };
        let (time_s, expected) = (number(9), number(10));
        let heat = Heat::new(&history, &mobility, 0.0).expect("valid");
        let found = heat.reduced_time(time_s);
        let error = (found / expected - 1.0).abs();
        assert!(error < 1e-10, "off by {error:.1e}: {row}: {found}");
        worst = worst.max(error);
        compared += 1;
        // And back, where m has not fallen so low that s no longer tells the time.
        let slope = heat.mobility(time_s) * time_s / expected;
        if slope > 1e-3 {
            let back = heat.time(found).expect("reached");
            assert!((back / time_s - 1.0).abs() < 1e-12 / slope, "{row}: {back}");
        }
    }
    eprintln!("{compared} rows, worst {worst:.1e}");
    assert!(compared > 200, "{compared}");
}
