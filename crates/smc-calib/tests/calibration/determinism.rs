use crate::support::{line, line_problem};
use smc_calib::{Noise, Posterior, Settings, calibrate};

fn run(threads: usize) -> Posterior {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let simulator = line();
        let problem = line_problem(&simulator, Noise::default());
        calibrate(&problem, &Settings { samples: 2000, seed: 11, ..Settings::default() }, &mut ())
            .unwrap()
    })
}

#[test]
fn one_two_and_seven_threads_give_the_same_bits() {
    let one = run(1);
    for threads in [2, 7] {
        let other = run(threads);
        // Debug prints every float to its last bit.
        assert!(format!("{one:?}") == format!("{other:?}"), "{threads} threads differ");
    }
}

#[test]
fn work_of_a_default_run_does_not_grow_unnoticed() {
    let c = run(1).counters;
    assert_eq!(c.simulations, 2000);
    assert!(c.map_simulations <= 402, "{c:?}");
    assert!(c.em_iterations <= 700 && c.mixtures_fitted <= 64, "{c:?}");
    assert!(c.component_densities <= 2000 * 9 * 12, "{c:?}");
}

#[test]
fn another_seed_gives_other_samples() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    let at = |seed| {
        calibrate(&problem, &Settings { samples: 500, seed, ..Settings::default() }, &mut ())
            .unwrap()
    };
    assert_ne!(at(1).samples[0].z, at(2).samples[0].z);
}
