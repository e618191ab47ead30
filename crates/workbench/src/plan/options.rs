//! A plan as the command that makes it, where options do.

use std::path::PathBuf;

use smc_calib::{DistanceScale, FixedSigma, Noise};

use super::heats::pairs;
use super::pair::PairOptions;
use super::types::{ObservablePlan, PairPlan, Plan, SolverPlan};
use crate::input::experiment::BUILT_IN_NAMES;

/// The command whose options make this plan, to the last digit; none where the files that it names have moved or changed, or
/// where a plan file says what options cannot.
pub fn command_line(plan: &Plan) -> Option<String> {
    let (_, pair) = pairs(&plan.experiments).next()?;
    let (_, measured) = plan.observables().next()?;
    let found = |iterations: Option<usize>| {
        noise_options(&measured.noise).into_iter().find_map(|(noise, words)| {
            let options = PairOptions { noise, iterations, ..options(plan, pair, measured) };
            let same = options.plan().is_ok_and(|planned| planned.plan == *plan);
            same.then(|| in_words(&options, &words))
        })
    };
    found(None).or_else(|| found(Some(plan.sampler.iterations)))
}

fn options(plan: &Plan, pair: &PairPlan, measured: &ObservablePlan) -> PairOptions {
    let sampler = &plan.sampler;
    let by_default = pair.material.is_some_and(|material| material.name() == plan.name);
    let (experiment, is_built_in) = named(pair);
    let experiment = Some(experiment).filter(|_| !(is_built_in && by_default));
    let bare = measured.table == pair.experiment;
    let own_priors = plan.prior_source.as_ref().filter(|file| !file.starts_with("built-in "));
    PairOptions {
        material: pair.material.filter(|_| experiment.is_none() || bare),
        experiment: experiment.map(PathBuf::from),
        others: pairs(&plan.experiments).skip(1).map(|(_, pair)| named(pair).0.into()).collect(),
        prior: own_priors.map(PathBuf::from),
        // Several have those of their descriptions.
        window_s: measured.window.filter(|_| plan.experiments.len() == 1),
        kinetics: pair.kinetics,
        solver: pair.solver.forced.then_some(pair.solver.name),
        tolerance: pair.solver.tolerance,
        samples: sampler.samples,
        ess: sampler.ess_target,
        seed: sampler.seed,
        proposal: plan.proposal.as_ref().map(|earlier| PathBuf::from(&earlier.from)),
        ..PairOptions::default()
    }
}

/// The experiment of a pair as an option names it, and whether it is built in.
fn named(pair: &PairPlan) -> (&str, bool) {
    let built_in = pair.experiment.strip_prefix("built-in experiments/");
    let built_in = built_in.and_then(|name| name.strip_suffix(".toml"));
    match built_in.filter(|name| BUILT_IN_NAMES.contains(name)) {
        Some(name) => (name, true),
        None => (&pair.experiment, false),
    }
}

/// Noise models that options can name and a table makes this one of, each with its words.
fn noise_options(noise: &Noise) -> Vec<(Noise, String)> {
    let plain = |noise: Noise, words: &str| (noise, words.to_owned());
    match noise {
        Noise::Inferred { nu0, s0 } => vec![plain(noise.clone(), &format!("inferred:{nu0},{s0}"))],
        Noise::Robust { nu0, s0 } => vec![plain(noise.clone(), &format!("robust:{nu0},{s0}"))],
        Noise::Correlated { nu0, s0, scale, .. } => {
            let open = Noise::Correlated { nu0: *nu0, s0: *s0, scale: None, nodes: None };
            let mut all = vec![(open, format!("correlated:{nu0},{s0}"))];
            all.extend(scale.map(|scale| match scale {
                DistanceScale::Log => (noise.clone(), "correlated:log".to_owned()),
                DistanceScale::Linear => (noise.clone(), "correlated:linear".to_owned()),
            }));
            all
        }
        Noise::Fixed { sigma } => {
            let words = match sigma {
                FixedSigma::Absolute(sigma) => format!("fixed:{sigma}"),
                FixedSigma::Relative(share) => format!("fixed-relative:{share}"),
                FixedSigma::PerPoint => "fixed:table".to_owned(),
            };
            vec![(noise.clone(), words)]
        }
        Noise::EssTarget { share } => vec![(noise.clone(), format!("ess-target:{share}"))],
    }
}

/// A noise model as the options name it; one whose scale a table has decided as if it were open.
pub(crate) fn noise_option(noise: &Noise) -> String {
    let (_, words) = noise_options(noise).swap_remove(0);
    words.strip_suffix(":4,0.05").unwrap_or(&words).to_owned()
}

fn in_words(options: &PairOptions, noise: &str) -> String {
    let default = PairOptions::default();
    let mut words = vec!["calibrate".to_owned()];
    let mut option = |name: &str, value: Option<String>| {
        words.extend(value.map(|value| format!("--{name} {}", shell_word(&value))));
    };
    let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    option("material", options.material.map(|material| material.name().to_owned()));
    option("experiment", path(&options.experiment));
    for other in &options.others {
        option("experiment", Some(other.display().to_string()));
    }
    option("prior", path(&options.prior));
    option("window", options.window_s.map(|[from, to]| format!("{from:?}:{to:?}")));
    let other = |same: bool, value: String| (!same).then_some(value);
    let kinetics = options.kinetics.to_string();
    option("kinetics", other(options.kinetics == default.kinetics, kinetics));
    option("solver", options.solver.map(|solver| solver.to_string()));
    let tolerance = options.tolerance;
    option("tolerance", other(tolerance == SolverPlan::DEFAULT_TOLERANCE, tolerance.to_string()));
    let noise = noise.strip_suffix(":4,0.05").unwrap_or(noise).to_owned();
    option("noise", other(options.noise == default.noise, noise));
    let samples = options.samples;
    option("samples", other(samples == default.samples, samples.to_string()));
    option("iterations", options.iterations.map(|iterations| iterations.to_string()));
    option("proposal", path(&options.proposal));
    option("ess", options.ess.map(|ess| ess.to_string()));
    option("seed", Some(options.seed.to_string()));
    words.join(" ")
}

/// A word for a shell: in quotes where it has more than letters, digits and the marks of paths.
pub(crate) fn shell_word(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "._-/:,+=%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else if word.contains(char::is_control) {
        // On one line, as bash, zsh and POSIX 2024 read it.
        let mut quoted = String::from("$'");
        for c in word.chars() {
            match c {
                '\'' | '\\' => quoted.extend(['\\', c]),
                c if c.is_control() => {
                    let mut bytes = [0; 4];
                    for byte in c.encode_utf8(&mut bytes).bytes() {
                        quoted.push_str(&format!("\\{byte:03o}"));
                    }
                }
                c => quoted.push(c),
            }
        }
        quoted + "'"
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use dem_core::{Kinetics, SolverKind};

    fn of(options: &PairOptions) -> Option<String> {
        command_line(&options.plan().expect("a plan").plan)
    }

    #[test]
    fn a_plan_names_the_command_that_makes_it() {
        let ps = PairOptions { material: Some(Material::Ps), ..PairOptions::default() };
        assert_eq!(of(&ps).as_deref(), Some("calibrate --material ps --seed 1"));
        let much = PairOptions {
            kinetics: Kinetics::Frenkel,
            solver: Some(SolverKind::QuasiStatic),
            tolerance: 1e-3,
            noise: Noise::correlated(),
            samples: 512,
            iterations: Some(7),
            ess: Some(100.0),
            seed: 42,
            window_s: Some([0.1, f64::INFINITY]),
            ..ps.clone()
        };
        assert_eq!(
            of(&much).as_deref(),
            Some(
                "calibrate --material ps --window 0.1:1.0651 --kinetics frenkel --solver quasi-static --tolerance 0.001 --noise correlated \
                 --samples 512 --iterations 7 --ess 100 --seed 42"
            )
        );
        // Chosen, though as many as by default: no process places these.
        for (samples, stages) in [(300, 25), (4096, 8)] {
            let plain = PairOptions { samples, iterations: Some(stages), ..ps.clone() };
            let words = format!(
                "calibrate --material ps --samples {samples} --iterations {stages} --seed 1"
            );
            assert_eq!(of(&plain), Some(words));
        }
        let tuned = Noise::EssTarget { share: 0.2 };
        let tuned = PairOptions { samples: 4096, noise: tuned, ..ps.clone() };
        let words = "calibrate --material ps --noise ess-target:0.2 --samples 4096 --seed 1";
        assert_eq!(of(&tuned).as_deref(), Some(words));
        let other = PairOptions {
            material: None,
            experiment: Some("pa12-r30".into()),
            noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.03) },
            ..ps
        };
        let words = "calibrate --experiment pa12-r30 --noise fixed:0.03 --seed 1";
        assert_eq!(of(&other).as_deref(), Some(words));
    }

    #[test]
    fn a_plan_that_options_do_not_make_has_no_command() {
        let ps = PairOptions { material: Some(Material::Ps), ..PairOptions::default() };
        let mut plan = ps.plan().expect("a plan").plan;
        plan.experiments[0].observables[0].values[3] += 0.01;
        assert_eq!(command_line(&plan), None);
    }

    #[test]
    fn words_of_a_shell_are_quoted_where_they_must_be() {
        assert_eq!(shell_word("results/my-run_1.csv"), "results/my-run_1.csv");
        assert_eq!(shell_word("my run"), "'my run'");
        assert_eq!(shell_word("it's"), r"'it'\''s'");
        assert_eq!(shell_word(""), "''");
        assert_eq!(shell_word("a\n'b\u{1b}"), r"$'a\012\'b\033'");
    }

    #[test]
    fn noise_is_named_as_an_option_names_it() {
        assert_eq!(noise_option(&Noise::default()), "inferred");
        assert_eq!(noise_option(&Noise::correlated()), "correlated");
        assert_eq!(noise_option(&Noise::Robust { nu0: 3.0, s0: 0.1 }), "robust:3,0.1");
    }
}
