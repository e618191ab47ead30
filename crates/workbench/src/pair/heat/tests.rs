use super::*;
use crate::input::experiment::Experiment;
use crate::input::prior_file::PriorFile;
use crate::pair::model::NeckGrowth;
use crate::plan::{PairPlan, Plan, Planned};
use smc_calib::Simulator as _;
use std::path::Path;

/// The plan of `ps-r60-e29` with these lines of `[heat]`, and these priors behind those of polystyrene.
fn planned(heat: &str, priors: &[&str]) -> Plan {
    let log = |name: &str| {
        format!("[parameters.{name}]\ndistribution = \"log-uniform\"\nlower = 1e-2\nupper = 1e2\n")
    };
    let names = ["c1", "tau_s", "delta_c"].iter().chain(priors);
    let text = format!(
        "name = \"t\"\n[heat]\n{heat}\n{}[experiments.e.simulator]\nkind = \"builtin\"\nexperiment = \"ps-r60-e29\"\n",
        names.map(|name| log(name)).collect::<String>()
    );
    Planned::parse(Path::new("t.toml"), text).expect("a plan").plan
}

fn curve(plan: &Plan, theta: &[f64]) -> Vec<f64> {
    let model = NeckGrowth::of(plan).expect("a model");
    let mut out = vec![0.0; model.times_s().len()];
    model.simulate(theta, &mut out).expect("a curve");
    out
}

fn pair(plan: &mut Plan) -> &mut PairPlan {
    match &mut plan.experiments[0].simulator {
        crate::plan::SimulatorPlan::Builtin(pair) => pair,
        other => panic!("{other:?}"),
    }
}

const THETA: [f64; 3] = [1e-3, 0.15, 2e-7];

#[test]
fn a_pulse_of_amplitude_1_that_never_cools_is_no_heat() {
    let mut plan = planned("mobility = \"direct\"", &["cooling_time"]);
    let heated = curve(&plan, &[THETA[0], THETA[1], THETA[2], 1e12]);
    pair(&mut plan).heat = None;
    plan.parameters.truncate(3);
    for (heated, isothermal) in heated.iter().zip(curve(&plan, &THETA)) {
        assert!((heated - isothermal).abs() < 1e-10, "{heated} {isothermal}");
    }
}

#[test]
fn a_number_is_the_same_stated_or_calibrated() {
    let stated = planned("mobility = \"direct\"\ncooling_time_s = 0.2\namplitude = 0.5", &[]);
    let open = planned("mobility = \"direct\"", &["amplitude", "cooling_time"]);
    let [c1, tau_s, delta_c] = THETA;
    assert_eq!(curve(&stated, &THETA), curve(&open, &[c1, tau_s, delta_c, 0.5, 0.2]));
}

#[test]
fn at_the_reference_energy_a_power_above_a_threshold_is_a_direct_amplitude_of_1() {
    let direct = planned("mobility = \"direct\"\ncooling_time_s = 0.2", &[]);
    let power = "mobility = \"threshold-power\"\nreference_energy = 29.0\ncooling_time_s = 0.2";
    let power = planned(power, &["threshold_energy", "energy_power"]);
    let [c1, tau_s, delta_c] = THETA;
    assert_eq!(curve(&power, &[c1, tau_s, delta_c, 18.0, 1.4]), curve(&direct, &THETA));
    // ((23 - 18)/(29 - 18))^1.4, and nothing at or below the threshold.
    let heat = power.pair().expect("a pair").0.heat.clone().expect("a heat");
    let value = |name| match name {
        ParameterName::ThresholdEnergy => Some(18.0),
        ParameterName::EnergyPower => Some(1.4),
        _ => None,
    };
    let at = |energy: f64| heat.with_energy(energy).expect("a pulse").at(60e-6, value);
    let mobility = |energy: f64| at(energy).expect("a heat").mobility(0.0);
    assert!((mobility(23.0) - (5.0f64 / 11.0).powf(1.4)).abs() < 1e-14);
    assert_eq!(mobility(18.0), 0.0);
    assert_eq!(mobility(10.0), 0.0);
}

#[test]
fn a_cooling_time_goes_with_the_stated_power_of_the_radius() {
    let text = "mobility = \"direct\"\ncooling_time_s = 0.2\ncooling_radius_m = 30e-6\ncooling_power = 2.0";
    let of_half = planned(text, &[]);
    let own = planned("mobility = \"direct\"\ncooling_time_s = 0.8", &[]);
    assert_eq!(curve(&of_half, &THETA), curve(&own, &THETA));
}

#[test]
fn arrhenius_at_its_reference_temperature_is_no_heat_and_an_oven_reaches_it() {
    let constant = "history = \"constant\"\nmobility = \"arrhenius\"\nreference_temperature_k = 450.0\ntemperature_k = 450.0";
    // The pulse energy of the experiment belongs to another history, and is refused with it.
    let text = format!(
        "name = \"t\"\n[heat]\n{constant}\n[parameters.tau_s]\ndistribution = \"log-uniform\"\nlower = 1.0\nupper = 2.0\n\
         [experiments.e.simulator]\nkind = \"builtin\"\nkinetics = \"frenkel\"\nexperiment = \"ps-r60-e29\"\n"
    );
    let refused = Planned::parse(Path::new("t.toml"), text.clone()).expect_err("a pulse energy");
    assert!(
        refused.to_string().contains("pulse_energy, which history = \"constant\""),
        "{refused}"
    );
    let text = text.replace("ps-r60-e29", "ps-r30");
    let refused = Planned::parse(Path::new("t.toml"), text.clone()).expect_err("no energy");
    assert!(refused.to_string().contains("no parameter activation_energy"), "{refused}");
    let text = text.replace("[parameters", "activation_energy_j_per_mol = 1e5\n[parameters");
    let mut plan = Planned::parse(Path::new("t.toml"), text).expect("a plan").plan;
    let heated = curve(&plan, &[1.5]);
    pair(&mut plan).heat = None;
    assert_eq!(heated, curve(&plan, &[1.5]));
    let oven = HeatPlan {
        history: HistoryPlan::RampAndHold {
            start_temperature_k: 300.0,
            rate_k_per_s: 10.0,
            hold_temperature_k: 450.0,
            cool_down: Some([60.0, 5.0]),
        },
        law: LawPlan::Arrhenius { reference_temperature_k: 450.0 },
        frozen_below_k: Some(373.0),
        start_s: 0.0,
        known: BTreeMap::from([(ParameterName::ActivationEnergy, 1e5)]),
    };
    let heat = oven.at(60e-6, |_| None).expect("a heat");
    assert_eq!(heat.mobility(7.0), 0.0);
    assert!((heat.mobility(20.0) - 1.0).abs() < 1e-12);
    // 60 s held, and what ramps add above 373 K.
    assert!((60.0..80.0).contains(&heat.reduced_time_at_end()));
}

#[test]
fn what_a_heat_leaves_open_needs_a_prior_and_what_it_states_has_none() {
    let experiment = Experiment::built_in("ps-r60-e23").expect("built in");
    let heat = experiment.heat.expect("a heat").plan().expect("a plan");
    let radius_m = 60e-6;
    assert!(heat.leaves_open(ParameterName::CoolingTime, radius_m));
    assert!(!heat.leaves_open(ParameterName::ActivationEnergy, radius_m));
    let text = "[tau_s]\ndistribution = \"log-uniform\"\nlower = 1.0\nupper = 2.0\n";
    let priors = |more: &str| {
        let file = PriorFile::parse("p.toml", &format!("{text}{more}")).expect("priors");
        file.parameters(dem_core::Kinetics::Frenkel, Some((&heat, radius_m)))
    };
    let missing = priors("").expect_err("no cooling time").to_string();
    assert!(
        missing.contains("[cooling_time]") && missing.contains("cooling_time_s in [heat]"),
        "{missing}"
    );
    let cooling = "[cooling_time]\ndistribution = \"log-uniform\"\nlower = 0.1\nupper = 1.0\n";
    let names = priors(cooling).expect("complete");
    let names: Vec<&str> = names.iter().map(|parameter| parameter.name.as_str()).collect();
    assert_eq!(names, ["tau_s", "cooling_time"]);
    let mut known = heat.clone();
    known.known.insert(ParameterName::CoolingTime, 0.2);
    let file = PriorFile::parse("p.toml", &format!("{text}{cooling}")).expect("priors");
    let both = file.parameters(dem_core::Kinetics::Frenkel, Some((&known, radius_m)));
    let both = both.expect_err("stated and open").to_string();
    assert!(both.contains("a prior for what [heat] states: cooling_time_s = 0.2"), "{both}");
    // Without a heat the same file calibrates tau_s alone.
    let without = file.parameters(dem_core::Kinetics::Frenkel, None).expect("tau_s");
    assert_eq!(without.len(), 1);
}
