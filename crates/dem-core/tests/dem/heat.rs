//! Histories and their reduced times.

use dem_core::heat::{
    CoolDown, Heat, HeatError, History, Mobility, MobilityLaw, at_radius, literature,
};

const ARRHENIUS: MobilityLaw =
    MobilityLaw::Arrhenius { activation_energy_j_per_mol: 100e3, reference_k: 450.0 };
const PULSE: History = History::Pulse { ambient_k: 300.0, rise_k: 200.0, cooling_s: 0.5 };

fn mobility(law: MobilityLaw) -> Mobility {
    Mobility::new(law).expect("valid")
}

fn heat(history: &History, mobility: &Mobility, start_s: f64) -> Heat {
    Heat::new(history, mobility, start_s).expect("valid")
}

/// Simpson's rule.
fn integral(heat: &Heat, from: f64, to: f64) -> f64 {
    let n = 40_000;
    let h = (to - from) / f64::from(n);
    let m = |t: f64| heat.mobility(t);
    let at = |k: i32| from + f64::from(k) * h;
    (0..n).map(|k| m(at(k)) + 4.0 * m(at(k) + 0.5 * h) + m(at(k + 1))).sum::<f64>() * h / 6.0
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

#[test]
fn mobility_laws_are_one_at_their_reference_and_say_the_same_in_each_others_constants() {
    let wlf = literature::PS_WLF;
    let vogel =
        MobilityLaw::Vogel { b_k: 13.7 * 50.0 * 10f64.ln(), t0_k: 323.0, reference_k: 373.0 };
    for law in [ARRHENIUS, wlf, vogel, literature::universal_wlf(370.0)] {
        assert_eq!(mobility(law).at(law.reference_k()), 1.0);
    }
    for kelvin in [330.0, 360.0, 373.0, 450.0, 900.0] {
        let log10 = 13.7 * (kelvin - 373.0) / (50.0 + kelvin - 373.0);
        assert!(close(mobility(wlf).at(kelvin), 10f64.powf(log10), 1e-12), "{kelvin}");
        assert!(close(mobility(vogel).at(kelvin), mobility(wlf).at(kelvin), 1e-12), "{kelvin}");
        let arrhenius = (-(100e3 / 8.314_462_618) * (1.0 / kelvin - 1.0 / 450.0)).exp();
        assert!(close(mobility(ARRHENIUS).at(kelvin), arrhenius, 1e-8), "{kelvin}");
    }
    // At and below T_ref - c2 the WLF melt is a solid; and any melt where it is told to be.
    assert_eq!(mobility(wlf).at(323.0), 0.0);
    assert_eq!(mobility(wlf).at(100.0), 0.0);
    let frozen = mobility(ARRHENIUS).frozen_below(420.0).expect("a temperature");
    assert_eq!(frozen.at(419.999), 0.0);
    assert_eq!(frozen.at(420.0), mobility(ARRHENIUS).at(420.0));
}

#[test]
fn reduced_time_is_the_integral_of_the_mobility_for_every_history_and_start() {
    let back = Some(CoolDown { hold_s: 0.7, rate_k_per_s: 400.0 });
    let rows = vec![(-0.2, 350.0), (0.1, 470.0), (0.4, 470.0), (0.5, 520.0), (1.6, 310.0)];
    let histories = [
        PULSE,
        History::Constant { temperature_k: 440.0 },
        History::RampAndHold { start_k: 400.0, rate_k_per_s: 100.0, hold_k: 480.0, then: None },
        History::RampAndHold { start_k: 400.0, rate_k_per_s: 300.0, hold_k: 480.0, then: back },
        History::RampAndHold { start_k: 480.0, rate_k_per_s: 300.0, hold_k: 400.0, then: back },
        History::Table(rows),
    ];
    let frozen = mobility(ARRHENIUS).frozen_below(425.0).expect("a temperature");
    for (k, history) in histories.iter().enumerate() {
        for mobility in [mobility(ARRHENIUS), mobility(literature::PS_WLF), frozen] {
            for start_s in [0.0, 0.312_3, -0.312_3] {
                let heat = heat(history, &mobility, start_s);
                let times = [0.05, 0.3, 0.9, 1.1, 2.5];
                let mut through = [0.0; 5];
                heat.reduced_times(&times, &mut through);
                for (time_s, through) in times.into_iter().zip(through) {
                    let expected = integral(&heat, 0.0, time_s);
                    let found = heat.reduced_time(time_s);
                    // Simpson's rule sees a jump of m to a step only.
                    let jumps = mobility.frozen_below_k().is_some() || (k == 0 && start_s > 0.0);
                    let step = if jumps { mobility.at(520.0) * time_s / 40_000.0 } else { 0.0 };
                    let within = |s: f64| (s - expected).abs() <= 1e-7 * expected + step;
                    assert!(within(found), "{k} {start_s} {time_s}: {found} {expected}");
                    assert!(close(through, found, 1e-11), "{k} {start_s} {time_s}");
                    // And T(t) is that of the history.
                    let kelvin = history.temperature_k(time_s - start_s);
                    let m = mobility.at(kelvin);
                    assert!(close(heat.mobility(time_s), m, 1e-9), "{k} {start_s} {time_s}");
                }
            }
        }
    }
}

#[test]
fn direct_pulses_have_their_closed_form() {
    let heat = Heat::direct(0.7, 0.19, 0.0).expect("valid");
    for time_s in [1e-9, 0.01, 0.19, 1.0] {
        let exact = 0.7 * 0.19 * -(-time_s / 0.19f64).exp_m1();
        assert!(close(heat.reduced_time(time_s), exact, 1e-15), "{time_s}");
        assert!(close(heat.time(exact).expect("reached"), time_s, 1e-13), "{time_s}");
    }
    assert_eq!(heat.reduced_time_at_end(), 0.7 * 0.19);
    assert_eq!(heat.time(0.14), None);
    // Begun half a second before contact: what is left of it. Begun after it: nothing until then.
    let early = Heat::direct(0.7, 0.19, -0.5).expect("valid");
    let left = 0.7 * (-0.5 / 0.19f64).exp() * 0.19;
    assert!(close(early.reduced_time_at_end(), left, 1e-14));
    let late = Heat::direct(0.7, 0.19, 0.5).expect("valid");
    assert_eq!((late.mobility(0.4), late.reduced_time(0.5)), (0.0, 0.0));
    assert!(close(late.reduced_time(0.6), heat.reduced_time(0.1), 1e-14));
}

#[test]
fn unit_pulses_without_cooling_are_time_to_the_bit() {
    let constant = History::Constant { temperature_k: 450.0 };
    let pulse = History::Pulse { ambient_k: 300.0, rise_k: 150.0, cooling_s: f64::INFINITY };
    let times: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.037_123).collect();
    for heat in [
        Heat::direct(1.0, f64::INFINITY, 0.0).expect("valid"),
        heat(&constant, &mobility(ARRHENIUS), 0.0),
        heat(&pulse, &mobility(ARRHENIUS), 0.0),
    ] {
        let mut reduced = vec![0.0; times.len()];
        heat.reduced_times(&times, &mut reduced);
        assert_eq!(reduced, times);
        assert_eq!(heat.time(0.3), Some(0.3));
        assert_eq!(heat.reduced_time_at_end(), f64::INFINITY);
    }
}

#[test]
fn time_is_the_inverse_of_reduced_time() {
    let late = 0.4;
    for law in [ARRHENIUS, literature::PS_WLF, literature::universal_wlf(400.0)] {
        for start_s in [0.0, late, -0.1] {
            let heat = heat(&PULSE, &mobility(law), start_s);
            for time_s in [1e-4, 0.02, 0.2, 0.5, 0.61] {
                let s = heat.reduced_time(time_s);
                let share = heat.mobility(time_s) * time_s / s;
                if s > 0.0 && share > 1e-6 {
                    let back = heat.time(s).expect("reached");
                    assert!(close(back, time_s, 1e-12 / share), "{law:?} {time_s}: {back}");
                }
            }
        }
    }
    assert_eq!(heat(&PULSE, &mobility(ARRHENIUS), late).time(0.0), Some(0.0));
    assert_eq!(heat(&PULSE, &mobility(ARRHENIUS), late).time(f64::NAN), None);
}

#[test]
fn frozen_histories_end_at_a_finite_reduced_time_and_others_do_not() {
    let glass = mobility(ARRHENIUS).frozen_below(373.0).expect("a temperature");
    for (mobility, freezes) in
        [(glass, true), (mobility(literature::PS_WLF), true), (mobility(ARRHENIUS), false)]
    {
        let heat = heat(&PULSE, &mobility, 0.0);
        let end = heat.reduced_time_at_end();
        assert_eq!(end.is_finite(), freezes);
        assert_eq!(heat.time(1e12).is_none(), freezes);
        if freezes {
            // 500 K falls to 373 K after 0.5 ln(200/73) s.
            let frozen_s = 0.5 * (200.0f64 / 73.0).ln();
            assert!(close(heat.reduced_time(frozen_s), end, 1e-6));
            assert_eq!(heat.reduced_time(1e9), end);
            assert_eq!(heat.mobility(10.0), 0.0);
            assert_eq!(heat.time(1.0001 * end), None);
        }
    }
    // A cold pair never starts; without sintering there is no time.
    let cold = heat(&History::Constant { temperature_k: 300.0 }, &glass, 0.0);
    assert_eq!((cold.reduced_time_at_end(), cold.time(1e-300)), (0.0, None));
}

#[test]
fn times_before_contact_are_contact() {
    let heat = heat(&PULSE, &mobility(ARRHENIUS), 0.0);
    for time_s in [0.0, -0.0, -1.0, f64::NEG_INFINITY] {
        assert_eq!(heat.reduced_time(time_s), 0.0);
    }
    assert!(heat.reduced_time(f64::NAN).is_nan() && heat.mobility(f64::NAN).is_nan());
    assert_eq!(heat.mobility(-1.0), mobility(ARRHENIUS).at(300.0));
}

#[test]
fn cooling_times_go_by_the_stated_power_of_the_radius() {
    assert_eq!(at_radius(0.2, 30e-6, 60e-6, 1.0), 0.4);
    assert_eq!(at_radius(0.2, 30e-6, 60e-6, 2.0), 0.8);
    assert_eq!(at_radius(0.2, 30e-6, 60e-6, 0.0), 0.2);
}

#[test]
fn no_number_panics_and_every_refusal_names_field_value_and_remedy() {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 1e-320, 1e9, 1e300];
    let mut refused = 0;
    let mut look = |result: Result<Heat, HeatError>| match result {
        Ok(heat) => {
            let mut out = [0.0; 5];
            heat.reduced_times(&[0.0, 1e-9, 0.5, 1e9, f64::INFINITY], &mut out);
            assert!(out.is_sorted() && out.iter().all(|s| !s.is_nan()), "{heat:?}: {out:?}");
            let _ = (heat.time(1.0), heat.mobility(0.3));
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains(" = ") && text.contains(": "), "{text}");
            refused += 1;
        }
    };
    let good = mobility(literature::PS_WLF);
    for a in bad {
        for b in [a, 1.0, 400.0] {
            for law in [
                MobilityLaw::Arrhenius { activation_energy_j_per_mol: a, reference_k: b },
                MobilityLaw::Wlf { c1: b, c2_k: a, reference_k: 373.0 },
                MobilityLaw::Vogel { b_k: a, t0_k: b, reference_k: 373.0 },
            ] {
                look(Mobility::new(law).and_then(|mobility| Heat::new(&PULSE, &mobility, 0.0)));
            }
            look(good.frozen_below(a).and_then(|mobility| Heat::new(&PULSE, &mobility, b)));
            let then = Some(CoolDown { hold_s: a, rate_k_per_s: b });
            for history in [
                History::Constant { temperature_k: a },
                History::Pulse { ambient_k: b, rise_k: a, cooling_s: 0.1 },
                History::Pulse { ambient_k: 300.0, rise_k: b, cooling_s: a },
                History::RampAndHold { start_k: a, rate_k_per_s: b, hold_k: 500.0, then: None },
                History::RampAndHold { start_k: 300.0, rate_k_per_s: 3.0, hold_k: b, then },
                History::Table(vec![(0.0, 300.0), (a, b), (2e9, 500.0)]),
            ] {
                look(Heat::new(&history, &good, 0.0));
            }
            look(Heat::direct(a, b, 0.0));
            look(Heat::direct(b, a, a));
        }
    }
    assert!(refused > 100, "{refused}");
    let empty = Heat::new(&History::Table(vec![]), &good, 0.0).expect_err("no rows");
    assert_eq!(empty, HeatError::NoRows);
}
