//! Beds and single curves under a heat: `scene`, `densify` and `simulate`.

use std::fs;

use crate::heat::number;
use crate::sandbox::Sandbox;
use crate::scenes;

/// s = 0.5 s in all, of which 6 s leave 3e-6.
const PULSE: &str =
    "[heat]\nhistory = \"pulse\"\nmobility = \"direct\"\namplitude = 1.0\ncooling_time_s = 0.5\n";

/// m is 1.
const REFERENCE: &str = "[heat]\nhistory = \"constant\"\nmobility = \"arrhenius\"\nreference_temperature_k = 450.0\n\
                         temperature_k = 450.0\nactivation_energy_j_per_mol = 1e5\n";

/// The same kinetics as [`packing`] for a pair.
const PA12: &str = "--material pa12 --c1 1.177e-5 --tau-s 3.81 --delta-c 9.55e-8";

/// The particles in a periodic box of other scenes for 6 s, to where necks meet.
fn packing() -> String {
    scenes::PACKING
        .replace(
            "calibrated_radius_m = 31.5e-6",
            "calibrated_radius_m = 31.5e-6\nwhen_necks_meet = \"stop\"",
        )
        .replace("count = 40", "count = 20")
        .replace("duration_s = 1.5", "duration_s = 6.0")
        .replace("tolerance = 1e-2", "tolerance = 2e-3")
}

/// The pair of the paper, from balance to balance.
fn pair(duration_s: f64) -> String {
    scenes::pair(20).replace("duration_s = 8.0", &format!("duration_s = {duration_s}"))
}

/// a/R of the pair at a time, exactly.
fn contact_ratio(sandbox: &Sandbox, options: &str, time_s: f64) -> f64 {
    sandbox.write("times.csv", format!("time_s\n0\n{time_s:e}\n"));
    let ran = sandbox.run(&format!("simulate {options} --times times.csv --quiet"));
    let last = ran.succeeded().stdout.lines().last().expect("a row");
    last.rsplit(',').next().expect("a cell").parse().expect("a number")
}

#[test]
fn a_scene_at_the_reference_has_the_bits_of_one_without_heat() {
    let sandbox = Sandbox::new();
    sandbox.write("cold.toml", pair(1.0));
    sandbox.write("hot.toml", pair(1.0) + REFERENCE);
    for scene in ["cold", "hot"] {
        sandbox.run(&format!("scene {scene}.toml --out {scene} --quiet")).succeeded();
    }
    let series = |run| fs::read(sandbox.path().join(run).join("series.csv")).expect("a series");
    assert!(series("cold") == series("hot"), "a mobility of 1 has changed a bit");
    let [cold, hot] = ["cold", "hot"].map(|run| sandbox.json(&format!("{run}/scene.json")));
    assert_eq!(hot["plan"]["heat"]["history"]["kind"], "constant");
    assert!(cold["plan"].get("heat").is_none() && cold.get("growth").is_none());
}

#[test]
fn a_pair_of_a_scene_freezes_where_it_is_after_the_reduced_time_without_heat() {
    let sandbox = Sandbox::new();
    let scene: toml::Table = toml::from_str(&(pair(6.0) + PULSE)).expect("TOML");
    sandbox.write("pulse.json", serde_json::to_string_pretty(&scene).expect("JSON"));
    let said = sandbox.run("scene pulse.json --out pair").succeeded().stdout.clone();
    assert!(said.contains("0.500 s of reduced time, and nothing moves any more"), "{said}");
    let record = sandbox.json("pair/scene.json");
    assert!((number(&record["growth"]["in_all_s"]) - 0.5).abs() < 1e-12, "{record}");
    let (frozen, exact) =
        (number(&record["end"]["mean_contact_ratio"]), contact_ratio(&sandbox, PA12, 0.5));
    assert!((frozen - exact).abs() < 1e-4, "{frozen}, exactly {exact}");
    let page = fs::read_to_string(sandbox.path().join("pair/report.html")).expect("a page");
    assert!(page.contains("mobility direct") && page.contains("nothing moves any more"));
    // A scene that is shorter than its heat says so.
    sandbox.write("early.toml", pair(0.5) + PULSE);
    let said = sandbox.run("scene early.toml --out early").succeeded().stdout.clone();
    assert!(
        said.contains(
            "0.316 of 0.500 s of reduced time: its heat ends later than the heated phases"
        ),
        "{said}"
    );
}

#[test]
fn a_bed_freezes_at_the_density_that_it_has_after_the_reduced_time_without_heat() {
    let sandbox = Sandbox::new();
    sandbox.write("pulse.toml", packing() + PULSE);
    sandbox.write("short.toml", packing().replace("duration_s = 6.0", "duration_s = 0.5"));
    let [[before, frozen], [_, isothermal]] = ["pulse", "short"].map(|run| {
        sandbox.run(&format!("scene {run}.toml --out {run} --quiet")).succeeded();
        let record = sandbox.json(&format!("{run}/scene.json"));
        ["start", "end"].map(|at| number(&record[at]["relative_density"]))
    });
    assert!(frozen > before + 0.01, "{before} to {frozen}: nothing has grown");
    assert!((frozen - isothermal).abs() < 1e-3, "{frozen}, without heat {isothermal}");
}

#[test]
fn every_constant_that_a_heat_lacks_is_named_by_scene_and_simulate() {
    let sandbox = Sandbox::new();
    let pulse = "history = \"pulse\"\npulse_energy = 23.0\ncooling_time_s = 0.2\n";
    let warm = format!("{pulse}ambient_temperature_k = 300.0\nheating_k = 9.0\n");
    let constant = "history = \"constant\"\ntemperature_k = 450.0\n";
    let reference = "reference_temperature_k = 430.0\n";
    let whole = [
        format!("{pulse}mobility = \"direct\"\n"),
        format!(
            "{pulse}mobility = \"threshold-power\"\nreference_energy = 29.0\nthreshold_energy = 18.0\nenergy_power = 1.4\n"
        ),
        format!("{warm}{reference}mobility = \"arrhenius\"\nactivation_energy_j_per_mol = 1e5\n"),
        format!("{constant}{reference}mobility = \"wlf\"\nwlf_c1 = 13.7\nwlf_c2_k = 50.0\n"),
        format!(
            "{constant}{reference}mobility = \"vogel\"\nvogel_b_k = 1600.0\nvogel_t0_k = 320.0\n"
        ),
        format!("{pulse}mobility = \"direct\"\ncooling_radius_m = 60e-6\ncooling_power = 1.0\n"),
    ];
    for heat in whole {
        sandbox.write("scene.toml", format!("{}[heat]\n{heat}", pair(1.0)));
        sandbox.run("scene scene.toml --dry-run").succeeded();
        sandbox.write("heat.toml", format!("[heat]\n{heat}"));
        sandbox.run(&format!("simulate {PA12} --heat heat.toml --quiet")).succeeded();
        for line in heat.lines() {
            let less = heat.replace(&format!("{line}\n"), "");
            let (field, _) = line.split_once(" = ").expect("a field");
            // A direct amplitude needs no energy, and a cooling radius none of its own.
            let is_optional = field == "pulse_energy" && heat.contains("\"direct\"");
            if is_optional || field == "cooling_radius_m" {
                continue;
            }
            let words = [format!("heat.{field}"), "missing".to_owned()];
            let words = words.each_ref().map(String::as_str);
            sandbox.write("scene.toml", format!("{}[heat]\n{less}", pair(1.0)));
            sandbox.run("scene scene.toml --dry-run").refused(&words);
            sandbox.write("heat.toml", format!("[heat]\n{less}"));
            sandbox.run(&format!("simulate {PA12} --heat heat.toml")).refused(&words);
        }
    }
    // Where it does nothing it cannot be meant, and mistakes have their lines.
    let cold = pair(1.0).replace("heated = true", "heated = false") + PULSE;
    sandbox.write("scene.toml", cold);
    sandbox.run("scene scene.toml").refused(&["scene.toml, field heat", "heated = true"]);
    sandbox.write("scene.toml", (pair(1.0) + PULSE).replace("tau_s = 3.81", "tau = 3.81"));
    sandbox.run("scene scene.toml").refused(&["scene.toml, line", "tau"]);
    let scene: toml::Table = toml::from_str(&(pair(1.0) + PULSE)).expect("TOML");
    let text = serde_json::to_string_pretty(&scene).expect("JSON");
    sandbox.write("scene.json", text.replace("\"direct\"", "\"direkt\""));
    sandbox.run("scene scene.json").refused(&["scene.json, line", "did you mean \"direct\"?"]);
    sandbox.write("scene.json", text.replacen('{', "{\"gravity\": null,", 1));
    sandbox.run("scene scene.json").refused(&["null", "leave the field out"]);
}

#[test]
fn a_single_curve_under_a_heat_is_that_without_at_the_reduced_time() {
    let sandbox = Sandbox::new();
    sandbox.write("pulse.toml", PULSE);
    sandbox.write("reference.toml", REFERENCE);
    let plain = sandbox.run(&format!("simulate {PA12} --quiet")).succeeded().stdout.clone();
    let at_one = sandbox.run(&format!("simulate {PA12} --heat reference.toml --quiet"));
    assert_eq!(at_one.succeeded().stdout, plain, "a mobility of 1 has changed a bit");
    for solver in ["closed-form", "quasi-static"] {
        let pulse = format!("{PA12} --solver {solver} --heat pulse.toml");
        for time_s in [0.1, 0.5, 3.0, 60.0] {
            let reduced_s = 0.5 * (1.0 - (-time_s / 0.5f64).exp());
            let (found, exact) =
                (contact_ratio(&sandbox, &pulse, time_s), contact_ratio(&sandbox, PA12, reduced_s));
            assert!((found - exact).abs() < 1e-4, "{solver} {time_s}: {found}, exactly {exact}");
        }
    }
    let ran = sandbox.run(&format!("simulate {PA12} --heat pulse.toml --json"));
    assert!(ran.succeeded().stderr.contains("heat      pulse, mobility direct"), "{}", ran.stderr);
    let value = ran.json();
    let frozen = contact_ratio(&sandbox, PA12, 0.5);
    assert!((number(&value["events"]["freezes_at"]) - frozen).abs() < 1e-12, "{value}");
    assert!(value["events"]["contact_ratio_1_s"].is_null(), "{value}");
    // The knee is where the reduced time is that of the knee without heat.
    let plain = sandbox.run(&format!("simulate {PA12} --json")).json();
    assert!(plain.get("heat").is_none() && plain["events"].get("freezes_at").is_none());
    let reduced_s = number(&plain["events"]["knee_s"]);
    let knee_s = -0.5 * (1.0 - reduced_s / 0.5).ln();
    assert!((number(&value["events"]["knee_s"]) / knee_s - 1.0).abs() < 1e-9, "{value}");
    // An experiment's own heat, which a file may complete.
    sandbox.run("simulate -e ps-r60-e23 --table3").refused(&["ps-r60-e23", "heat.cooling_time_s"]);
    let value =
        sandbox.run("simulate -e ps-r60-e23 --table3 --heat pulse.toml --json --quiet").json();
    assert_eq!(value["heat"]["history"]["energy"], 23.0);
    assert_eq!(value["heat"]["known"]["cooling_time"], 0.5);
}

/// The last a/R of each draw's bed, and what the pair has without heat after the reduced time.
#[test]
fn densify_of_a_posterior_without_heat_takes_one_that_is_stated_and_freezes_where_its_pair_does() {
    let sandbox = Sandbox::new();
    sandbox.run("--material pa12 --kinetics frenkel --samples 8192 --no-other-kinetics --out post --quiet").succeeded();
    sandbox.write("pair.toml", pair(6.0).replace("three-stage", "frenkel"));
    sandbox.write("pulse.toml", PULSE);
    let common = "densify --posterior post --scene pair.toml --draws 5 --contact-ratio";
    let said = sandbox
        .run(&format!("{common} 0.3 --heat pulse.toml --out bed"))
        .succeeded()
        .stdout
        .clone();
    assert!(said.contains("it freezes at a mean contact ratio a/R of 0."), "{said}");
    let report = sandbox.json("bed/densify.json");
    assert_eq!(report["plan"]["heat"]["law"]["kind"], "direct");
    assert_eq!(report["freezes"]["draws"], 5);
    for draw in report["draws"].as_array().expect("draws") {
        let tau_s = number(&draw["parameters"][0]);
        let options = format!("--material pa12 --kinetics frenkel --tau-s {tau_s:e}");
        let exact = contact_ratio(&sandbox, &options, 0.5);
        let last = number(&draw["last"]);
        assert!((last - exact).abs() < 1e-3, "{last}, exactly {exact}");
    }
    // What is not reached is said to freeze.
    let said = sandbox
        .run(&format!("{common} 0.9 --heat pulse.toml --out bed"))
        .succeeded()
        .stdout
        .clone();
    assert!(said.contains("5 of 5 draws freeze below the target"), "{said}");
    // A mobility of 1 gives the beds without heat, to the bit.
    sandbox.write("reference.toml", REFERENCE);
    sandbox.run(&format!("{common} 0.3 --heat reference.toml --out one --quiet")).succeeded();
    sandbox.run(&format!("{common} 0.3 --out plain --quiet")).succeeded();
    let [one, plain] = ["one", "plain"].map(|run| sandbox.json(&format!("{run}/densify.json")));
    assert_eq!(one["draws"], plain["draws"]);
    assert_eq!(one["curve"], plain["curve"]);
    assert!(plain["plan"].get("heat").is_none() && plain.get("freezes").is_none());
    // The scene's own heat counts where no other is asked for.
    sandbox.write("pair.toml", pair(6.0).replace("three-stage", "frenkel") + PULSE);
    sandbox.run(&format!("{common} 0.3 --out own --quiet")).succeeded();
    assert_eq!(sandbox.json("own/densify.json")["freezes"], report["freezes"]);
    // What no draw has must be stated, and a pulse must be there to have an energy.
    sandbox.write("open.toml", PULSE.replace("cooling_time_s = 0.5\n", ""));
    sandbox.run(&format!("{common} 0.3 --heat open.toml")).refused(&[
        "open.toml",
        "cooling_time",
        "state cooling_time_s in [heat]",
    ]);
    sandbox
        .run(&format!("{common} 0.3 --heat reference.toml --pulse-energy 3"))
        .refused(&["--pulse-energy", "no pulse"]);
}
