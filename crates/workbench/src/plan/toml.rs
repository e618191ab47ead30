//! A plan as the text of a plan file, which reads back as the same plan.

use std::fmt::Write as _;
use std::path::Path;

use smc_calib::{FixedSigma, Noise, PriorSpec, Settings};

use super::types::{ExperimentPlan, PairPlan, Plan, SimulatorPlan, SolverPlan};
use crate::input::experiment::{BUILT_IN_NAMES, is_plain};
use crate::input::prior_file::DISTRIBUTIONS;
use crate::input::toml_fields::quoted;

/// The plan file of a plan with built-in simulators. Own files are named by their whole paths, so that the text can be
/// kept anywhere.
///
/// Commands and designs are left out: a plan with such comes from a plan file, which is the text.
pub(super) fn toml(plan: &Plan) -> String {
    // A plan file's name holds no blanks; that of a table may.
    let name = plan.name.replace(|c: char| !is_plain(c), "-");
    let mut text = format!("name = {}\ntitle = {}\n", quoted(&name), quoted(&plan.title));
    for (key, value) in [("source", &plan.source), ("prior_source", &plan.prior_source)] {
        if let Some(value) = value {
            let _ = writeln!(text, "{key} = {}", quoted(value));
        }
    }
    for parameter in &plan.parameters {
        let _ = writeln!(text, "\n[parameters.{}]", parameter.name);
        let _ = writeln!(text, "unit = {}", quoted(&parameter.unit));
        text.push_str(&prior(parameter.prior.spec()));
    }
    for experiment in &plan.experiments {
        if let SimulatorPlan::Builtin(pair) = &experiment.simulator {
            text.push_str(&builtin(experiment, pair));
        }
    }
    text.push_str(&sampler(&plan.sampler));
    if let Some(earlier) = &plan.proposal {
        let _ = writeln!(text, "proposal = {}", quoted(&whole(&earlier.from)));
    }
    text
}

/// The whole path of a file.
fn whole(file: &str) -> String {
    std::path::absolute(Path::new(file))
        .map_or_else(|_| file.to_owned(), |path| path.display().to_string())
}

fn prior(spec: &PriorSpec) -> String {
    let spec = serde_json::to_value(spec).unwrap_or_default();
    let family = DISTRIBUTIONS.iter().find(|(name, _)| spec["kind"] == *name);
    let mut text = String::new();
    if let Some((name, keys)) = family {
        let _ = writeln!(text, "distribution = \"{name}\"");
        for key in *keys {
            let _ = writeln!(text, "{key} = {:?}", spec[key].as_f64().unwrap_or(f64::NAN));
        }
    }
    text
}

/// A file of the user's by its whole path; what is built in by its name.
fn named(experiment: &str) -> String {
    let built_in = experiment
        .strip_prefix("built-in experiments/")
        .and_then(|name| name.strip_suffix(".toml"))
        .filter(|name| BUILT_IN_NAMES.contains(name));
    match built_in {
        Some(name) => name.to_owned(),
        None => whole(experiment),
    }
}

fn builtin(experiment: &ExperimentPlan, pair: &PairPlan) -> String {
    let mut text = format!("\n[experiments.{}.simulator]\nkind = \"builtin\"\n", experiment.name);
    let _ = writeln!(text, "experiment = {}", quoted(&named(&pair.experiment)));
    // A bare table does not say what its particles are made of.
    if let Some(material) = pair.material
        && experiment.observables.iter().any(|observable| observable.table == pair.experiment)
    {
        let _ = writeln!(text, "material = \"{material}\"");
    }
    let _ = writeln!(text, "kinetics = \"{}\"", pair.kinetics);
    if pair.solver.forced {
        let _ = writeln!(text, "solver = \"{}\"", pair.solver.name);
    }
    if pair.solver.tolerance != SolverPlan::DEFAULT_TOLERANCE {
        let _ = writeln!(text, "tolerance = {:?}", pair.solver.tolerance);
    }
    if let Some(radius) = pair.tau_s_radius_m {
        let _ = writeln!(text, "tau_s_radius_m = {radius:?}");
    }
    if !pair.parameters.is_empty() {
        let renamed: Vec<String> = pair
            .parameters
            .iter()
            .map(|(model, name)| format!("{} = {}", model.name(), quoted(name)))
            .collect();
        let _ = writeln!(text, "parameters = {{ {} }}", renamed.join(", "));
    }
    for observable in &experiment.observables {
        let _ =
            writeln!(text, "\n[experiments.{}.observables.{}]", experiment.name, observable.name);
        if let Some([from, to]) = observable.window {
            let _ = writeln!(text, "window = [{from:?}, {to:?}]");
        }
        let _ = writeln!(text, "noise = {{ {} }}", noise(&observable.noise));
    }
    text
}

fn noise(noise: &Noise) -> String {
    match noise {
        Noise::Inferred { nu0, s0 } => format!("kind = \"inferred\", nu0 = {nu0:?}, s0 = {s0:?}"),
        Noise::Robust { nu0, s0 } => format!("kind = \"robust\", nu0 = {nu0:?}, s0 = {s0:?}"),
        Noise::Correlated { nu0, s0, scale, nodes } => {
            let scale = scale.map_or_else(String::new, |scale| format!(", scale = \"{scale}\""));
            let nodes = nodes.map_or_else(String::new, |[l, w]| format!(", nodes = [{l}, {w}]"));
            format!("kind = \"correlated\", nu0 = {nu0:?}, s0 = {s0:?}{scale}{nodes}")
        }
        Noise::Fixed { sigma: FixedSigma::Absolute(sigma) } => {
            format!("kind = \"fixed\", sigma = {sigma:?}")
        }
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => {
            format!("kind = \"fixed-relative\", share = {share:?}")
        }
        Noise::Fixed { sigma: FixedSigma::PerPoint } => "kind = \"fixed-table\"".to_owned(),
        Noise::EssTarget { share } => format!("kind = \"ess-target\", share = {share:?}"),
    }
}

/// The settings that are not those of a plan that names the number of samples alone.
fn sampler(settings: &Settings) -> String {
    let default = Settings::for_budget(settings.samples);
    let mut text =
        format!("\n[sampler]\nsamples = {}\nseed = {}\n", settings.samples, settings.seed);
    let mut line = |key: &str, is: String, was: String| {
        if is != was {
            let _ = writeln!(text, "{key} = {is}");
        }
    };
    macro_rules! lines {
        ($($field:ident),*) => {
            $(line(stringify!($field), format!("{:?}", settings.$field), format!("{:?}", default.$field));)*
        };
    }
    lines!(
        iterations,
        batch,
        overlap,
        map_simulations,
        replicates,
        max_components,
        patches,
        draws,
        max_failed_share,
        final_share,
        tempering_share,
        widening,
        degrees_of_freedom,
        defensive_share
    );
    let surrogate = |on: bool| if on { "\"on\"" } else { "\"off\"" }.to_owned();
    line("surrogate", surrogate(settings.surrogate), surrogate(default.surrogate));
    for (key, value) in [("ess", settings.ess_target), ("mean_se", settings.mean_se_target)] {
        line(key, value.map_or_else(String::new, |value| format!("{value:?}")), String::new());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::{PairOptions, Planned};
    use super::*;
    use crate::input::material::Material;
    use dem_core::{Kinetics, SolverKind};
    use smc_calib::DistanceScale;
    use std::path::PathBuf;

    fn reads_back(options: &PairOptions) {
        let planned = options.plan().expect("a plan");
        let read = Planned::parse(&PathBuf::from("plan.toml"), planned.text.clone())
            .unwrap_or_else(|error| panic!("{error}\n{}", planned.text));
        assert_eq!(read.plan, planned.plan, "{}", planned.text);
        assert_eq!(read.executor, planned.executor);
    }

    #[test]
    fn the_text_of_any_plan_of_options_reads_back_as_the_same_plan() {
        let of = |material| PairOptions { material: Some(material), ..PairOptions::default() };
        let noises = [
            Noise::Inferred { nu0: 6.0, s0: 0.02 },
            Noise::Fixed { sigma: FixedSigma::Absolute(0.03) },
            Noise::Fixed { sigma: FixedSigma::Relative(0.05) },
            Noise::EssTarget { share: 0.2 },
            Noise::correlated(),
            Noise::Correlated {
                nu0: 3.0,
                s0: 0.02,
                scale: Some(DistanceScale::Linear),
                nodes: Some([20, 15]),
            },
            Noise::Robust { nu0: 3.0, s0: 0.01 },
        ];
        for material in Material::ALL {
            reads_back(&of(material));
            for kinetics in Kinetics::ALL {
                reads_back(&PairOptions { kinetics, ..of(material) });
            }
            for samples in [16, 100, 1000, 1024, 2047, 2048, 4096, 65_537] {
                for iterations in [None, Some(3), Some(8), Some(20), Some(38)] {
                    reads_back(&PairOptions { samples, iterations, ..of(material) });
                }
            }
            for solver in SolverKind::ALL {
                let tolerance = 3e-7;
                reads_back(&PairOptions { solver: Some(solver), tolerance, ..of(material) });
            }
            for window_s in [[0.01, f64::INFINITY], [0.0, 0.1], [1.0 / 3.0, 1e3]] {
                if of(material).plan().is_ok() {
                    let options = PairOptions { window_s: Some(window_s), ..of(material) };
                    if options.plan().is_ok() {
                        reads_back(&options);
                    }
                }
            }
        }
        for noise in noises {
            reads_back(&PairOptions { noise, ess: Some(1e3), seed: 1 << 63, ..of(Material::Peek) });
        }
    }

    #[test]
    fn own_files_are_named_by_their_whole_paths() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        reads_back(&PairOptions {
            experiment: Some(root.join("experiments/example-my-powder.toml")),
            prior: Some(root.join("priors/example-my-powder.toml")),
            ..PairOptions::default()
        });
        reads_back(&PairOptions {
            experiment: Some(root.join("experiments/pa12-r30.csv")),
            material: Some(Material::Pa12),
            ..PairOptions::default()
        });
    }
}
