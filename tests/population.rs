//! Populations of runs of a program, which need no pair of particles.

use std::f64::consts::TAU;

use serde_json::Value;

use crate::sandbox::Sandbox;

/// Three specimens: what was measured at the times 1, 2, 3 and 4.
const SPECIMENS: [(&str, [f64; 4]); 3] = [
    ("one", [-0.5, -0.1, -0.9, -0.7]),
    ("two", [0.3, 0.1, 0.6, 0.2]),
    ("three", [0.4, 1.0, 0.8, 1.5]),
];
const SIGMA: f64 = 0.3;

/// A program whose output is log10(k) t, and a specimen that it is calibrated on.
fn calibrate(sandbox: &Sandbox, (name, values): (&str, [f64; 4]), parameter: &str) {
    let rows = values.iter().zip(1..).map(|(value, time)| format!("{time},{value}\n"));
    sandbox.write(&format!("{name}.csv"), format!("t,y\n{}", rows.collect::<String>()));
    sandbox.write(
        "line.sh",
        "awk -v k=\"$1\" 'BEGIN { print \"t,y\"; for (t = 1; t < 5; t++) printf \"%d,%.17g\\n\", t, t * log(k) / log(10) }' > out.csv\n",
    );
    let plan = format!(
        "name = \"{name}\"\ntitle = \"Specimen {name}\"\n\n\
         [parameters.{parameter}]\nunit = \"N\"\ndistribution = \"log-uniform\"\nlower = 1e-2\nupper = 1e2\n\n\
         [experiments.pull.simulator]\nkind = \"command\"\nargv = [\"sh\", \"{{plan_dir}}/line.sh\", \"{{{parameter}}}\"]\n\
         timeout_s = 60\nkeep = \"none\"\n\n\
         [experiments.pull.observables.y]\ntable = \"{name}.csv\"\ncontrol = \"t\"\nvalue = \"y\"\nunit = \"N\"\n\
         noise = {{ kind = \"fixed\", sigma = {SIGMA} }}\nresult = {{ file = \"out.csv\", control = \"t\", value = \"y\" }}\n\n\
         [sampler]\nsamples = 64\n\n[executor]\nkind = \"local\"\nparallel = 2\n"
    );
    sandbox.write(&format!("{name}.toml"), plan);
    sandbox.run(&format!("--plan {name}.toml --quiet --out {name}")).succeeded();
}

fn normal(x: f64, mean: f64, sd: f64) -> f64 {
    (-0.5 * ((x - mean) / sd).powi(2)).exp() / (TAU.sqrt() * sd)
}

/// Means of mean and spread of log10(k), and the log evidence, by quadrature.
///
/// # Formula
///
/// With x_k the least-squares slope of specimen k and e its standard error, specimen k has the likelihood
/// `C_k sqrt(2 pi) e N(x_k | mean, sqrt(e^2 + spread^2))`, `C_k` its likelihood at x_k: errors and population are normal and no
/// mass of any account lies beyond the prior. The mean is uniform over -2..2, the spread half-normal of 0.3.
fn exact() -> [f64; 3] {
    let times = [1.0, 2.0, 3.0, 4.0];
    let squares: f64 = times.iter().map(|t| t * t).sum();
    let error = SIGMA / squares.sqrt();
    let slopes = SPECIMENS.map(|(_, values)| {
        let slope = values.iter().zip(times).map(|(y, t)| y * t).sum::<f64>() / squares;
        let at = values.iter().zip(times).map(|(y, t)| normal(*y, slope * t, SIGMA)).product();
        (slope, at)
    });
    let mut sums = [0.0; 3];
    let step = 1.0 / 500.0;
    for i in 0..2000 {
        let mean = -2.0 + (f64::from(i) + 0.5) * step;
        for j in 0..1000 {
            let spread = (f64::from(j) + 0.5) * step;
            let mut density = 0.25 * 2.0 * normal(spread, 0.0, 0.3) * step * step;
            for (slope, at) in slopes {
                let at: f64 = at;
                density *= at * TAU.sqrt() * error * normal(slope, mean, error.hypot(spread));
            }
            for (sum, value) in sums.iter_mut().zip([1.0, mean, spread]) {
                *sum += density * value;
            }
        }
    }
    [sums[1] / sums[0], sums[2] / sums[0], sums[0].ln()]
}

#[test]
#[ignore = "long: run by .ci/run"]
fn specimens_calibrated_with_a_program_have_the_population_of_the_closed_form() {
    let sandbox = Sandbox::new();
    for specimen in SPECIMENS {
        calibrate(&sandbox, specimen, "k");
    }
    sandbox.run("population one two three --out powder").succeeded();
    let posterior = sandbox.json("powder/posterior.json");
    let number = |pointer: &str| {
        posterior.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}"))
    };
    let [mean, spread, log_evidence] = exact();
    for (name, exact, tolerance) in [
        ("/population/mean/0/mean", mean, 0.02),
        ("/population/spread/0/mean", spread, 0.02),
        ("/log_evidence/value", log_evidence, 0.05),
    ] {
        let found = number(name);
        assert!((found - exact).abs() < tolerance, "{name}: {found}, exactly {exact}");
    }
    // The next specimen is as uncertain as mean and spread together.
    let next = number("/parameters/0/in_coordinate/sd");
    assert!(next > number("/population/mean/0/sd"), "{next}");
    assert!(posterior.pointer("/population/next").is_none(), "there is no pair of particles");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_specimen_with_another_parameter_or_the_same_measurements_is_refused_with_what_to_do() {
    let sandbox = Sandbox::new();
    let [one, two, _] = SPECIMENS;
    calibrate(&sandbox, one, "k");
    calibrate(&sandbox, ("again", one.1), "k");
    calibrate(&sandbox, two, "stiffness");
    for (other, found, remedy) in [
        ("again", "measurements of one once more", "leave one of the two out"),
        ("two", "no k, which is a parameter of one", "[k] in its priors"),
    ] {
        let refused = sandbox.run(&format!("population one {other} --out powder"));
        assert_eq!(refused.code, 2, "{refused:?}");
        let said = refused.stderr;
        assert!(said.contains(found) && said.contains(remedy), "{other}: {said}");
        assert!(!sandbox.path().join("powder").exists(), "{other}");
    }
}
