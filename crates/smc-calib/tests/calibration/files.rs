//! Results and settings survive being written and read.

use crate::support::{line, line_problem};
use smc_calib::{Noise, Posterior, PriorSpec, Settings, calibrate};

#[test]
fn a_posterior_survives_json() {
    let simulator = line();
    let p = calibrate(
        &line_problem(&simulator, Noise::default()),
        &Settings { samples: 300, ..Settings::default() },
        &mut (),
    )
    .unwrap();
    let text = serde_json::to_string(&p).unwrap();
    let back: Posterior = serde_json::from_str(&text).unwrap();
    assert_eq!(p, back);
}

#[test]
fn unknown_fields_are_refused() {
    assert!(serde_json::from_str::<Settings>(r#"{"samples": 10, "sampels": 3}"#).is_err());
    assert!(
        serde_json::from_str::<PriorSpec>(r#"{"kind": "uniform", "lower": 0, "upper": 1, "x": 2}"#)
            .is_err()
    );
    assert_eq!(serde_json::from_str::<Settings>("{}").unwrap(), Settings::default());
}
