//! How much work the default calibrations are: an algorithm that needs more has become worse, one that needs less has
//! another reason to be looked at.
//!
//! Where a change of the sampler is meant, put what the failed test found in the place of what it expected, and say in
//! the commit what costs more or less, and what it is good for.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use campaign::Stop;
use smc_calib::Counters;
use workbench::calibration::Calibration;
use workbench::input::material::Material;
use workbench::plan::PairOptions;
use workbench::watch::Watch;

/// Counts the simulations of the sampler, the work that is announced as such.
#[derive(Default)]
struct Count {
    stop: Stop,
    counts: AtomicBool,
    simulations: AtomicUsize,
}

impl Watch for Count {
    fn stop(&self) -> &Stop {
        &self.stop
    }

    fn begin(&self, _: u64, _: u64, what: &'static str) {
        self.counts.store(what == "simulations", Ordering::Relaxed);
    }

    fn advance(&self) {
        let one = usize::from(self.counts.load(Ordering::Relaxed));
        self.simulations.fetch_add(one, Ordering::Relaxed);
    }
}

/// Simulations of every stage, and all counters, of `calibrate --material NAME`.
fn work(material: Material) -> (Vec<usize>, Counters) {
    let options = PairOptions { material: Some(material), ..PairOptions::default() };
    let planned = options.plan().expect("a plan");
    let called = Count::default();
    let found = Calibration::run(&planned, &called).expect("a posterior").posterior;
    let counters = found.counters;
    // Those of the search for the MAP are held to the calls of a simulator by the sampler's own tests.
    let called = called.simulations.into_inner();
    assert_eq!(called, counters.simulations, "{material}: simulations that are not counted");
    (found.stages.iter().map(|stage| stage.simulations).collect(), counters)
}

#[test]
fn default_calibrations_cost_other_work_than_they_did() {
    let found = Material::ALL.map(work);
    let counters =
        |map_simulations, em_iterations, mixtures_fitted, component_densities| Counters {
            simulations: 16_384,
            map_simulations,
            em_iterations,
            mixtures_fitted,
            component_densities,
        };
    let stages = || [vec![1024; 8], vec![8192]].concat();
    let expected = [
        (stages(), counters(402, 513, 42, 1_523_712)),
        (stages(), counters(404, 1_013, 54, 2_244_608)),
        (stages(), counters(406, 318, 34, 1_081_344)),
    ];
    assert_eq!(found, expected);
}
