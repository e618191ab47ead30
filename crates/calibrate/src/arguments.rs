//! Parsers of command-line values: numbers, names, windows, noise models.

use std::str::FromStr as _;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use dem_core::{Kinetics, SolverKind};
use figures::Width;
use smc_calib::{DistanceScale, FixedSigma, Noise};
use workbench::error::nearest;
use workbench::input::experiment::{Constant, checked_phi};
use workbench::input::heat::PULSE_ENERGIES;
use workbench::input::material::Material;
use workbench::input::observation_table::{LARGEST_CONTACT_RATIO, TIMES_S};
use workbench::plan::{SAMPLES, SolverPlan};
use workbench::report::TimeScale;

use crate::terminal::OnInterrupt;

/// The name of a built-in material.
pub(crate) fn material() -> impl TypedValueParser<Value = Material> {
    PossibleValuesParser::new(Material::NAMES)
        .try_map(|name| Material::from_name(&name).ok_or("unknown material"))
}

/// A value by its name.
pub(crate) fn named<T, const N: usize>(
    names: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let of =
        move |name: &str| names.iter().find(|(other, _)| *other == name).map(|(_, value)| *value);
    PossibleValuesParser::new(names.map(|(name, _)| name))
        .try_map(move |name| of(&name).ok_or("unknown name"))
}

/// Width of the figures.
pub(crate) fn width() -> impl TypedValueParser<Value = Width> {
    named([("column", Width::Column), ("full", Width::Full)])
}

/// Effect of Ctrl-C on jobs on a cluster.
pub(crate) fn on_interrupt() -> impl TypedValueParser<Value = OnInterrupt> {
    named([("detach", OnInterrupt::Detach), ("cancel", OnInterrupt::Cancel)])
}

/// The name of kinetics.
pub(crate) fn kinetics() -> impl TypedValueParser<Value = Kinetics> {
    PossibleValuesParser::new(Kinetics::ALL.map(Kinetics::name))
        .try_map(|name| Kinetics::from_str(&name))
}

/// A solver, or none where the program is to choose.
pub(crate) type SolverChoice = Option<SolverKind>;

/// The name of a solver, or `auto`.
pub(crate) fn solver() -> impl TypedValueParser<Value = SolverChoice> {
    let names = std::iter::once("auto").chain(SolverKind::ALL.map(SolverKind::name));
    PossibleValuesParser::new(names.collect::<Vec<_>>()).try_map(|name| match name.as_str() {
        "auto" => Ok(None),
        name => SolverKind::from_str(name).map(Some),
    })
}

/// A finite number.
fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err("expected a finite number".to_owned()),
        Err(_) if text.contains(',') => {
            Err(format!("write decimals with a point: {}", text.replace(',', ".")))
        }
        Err(_) => Err("expected a number, as in 1.5e-3, without unit".to_owned()),
    }
}

/// A number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 { Ok(value) } else { Err("expected a number > 0".to_owned()) }
}

/// A constant of a powder, in SI and in the range of experiment files.
fn constant(constant: Constant, text: &str) -> Result<f64, String> {
    constant.checked(positive(text)?).map_err(|(expected, meant)| match meant {
        Some(meant) => format!("expected {expected}; {meant}"),
        None => format!("expected {expected}"),
    })
}

/// A particle radius \[m\].
pub(crate) fn radius(text: &str) -> Result<f64, String> {
    constant(Constant::Radius, text)
}

/// Young's modulus \[Pa\].
pub(crate) fn youngs_modulus(text: &str) -> Result<f64, String> {
    constant(Constant::YoungsModulus, text)
}

/// Surface tension \[N/m\].
pub(crate) fn surface_tension(text: &str) -> Result<f64, String> {
    constant(Constant::SurfaceTension, text)
}

/// A prior of a spread in decades, or NAME=VALUE.
pub(crate) fn spread(text: &str) -> Result<(Option<String>, f64), String> {
    let (name, value) = match text.split_once('=') {
        Some((name, value)) => (Some(name.trim().to_owned()), value),
        None => (None, text),
    };
    // Of a parameter that is not logarithmic it is in the unit of that.
    let most = if name.is_some() { f64::INFINITY } else { 10.0 };
    let value = positive(value)?;
    if value <= most { Ok((name, value)) } else { Err("expected at most 10 decades".to_owned()) }
}

/// The parameter of an LKJ prior.
pub(crate) fn eta(text: &str) -> Result<f64, String> {
    let value = positive(text)?;
    if value <= 1000.0 { Ok(value) } else { Err("expected at most 1000".to_owned()) }
}

/// Density \[kg/m3\].
pub(crate) fn solid_density(text: &str) -> Result<f64, String> {
    constant(Constant::Density, text)
}

/// A time \[s\] after first contact that is computed with.
pub(crate) fn time(text: &str) -> Result<f64, String> {
    let value = positive(text)?;
    if TIMES_S.contains(&value) {
        Ok(value)
    } else {
        Err("expected a time between 1e-15 and 1e15 s".to_owned())
    }
}

/// A contact ratio a/R that can be reached.
pub(crate) fn contact_ratio(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 && value <= LARGEST_CONTACT_RATIO {
        Ok(value)
    } else {
        Err("expected a contact ratio above 0, at most 2".to_owned())
    }
}

/// Coalescence in percent of a/R = 1.
pub(crate) fn percent(text: &str) -> Result<f64, String> {
    let value = number(text.trim_end_matches('%'))?;
    contact_ratio(&(value / 100.0).to_string())
        .map(|_| value)
        .map_err(|_| "expected percent of a/R = 1, above 0, at most 200".to_owned())
}

/// Energy of a pulse, in the unit of the calibrated ones.
pub(crate) fn pulse_energy(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    let known = PULSE_ENERGIES.contains(&value);
    known.then_some(value).ok_or_else(|| "expected an energy from 1e-12 to 1e12".to_owned())
}

/// A probability that is neither nothing nor certainty.
pub(crate) fn probability(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    let open = value > 0.0 && value < 1.0;
    open.then_some(value).ok_or_else(|| "expected a probability above 0 and below 1".to_owned())
}

/// A relative density.
pub(crate) fn density(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        Ok(value) if value > 1.0 && value <= 100.0 => Err(format!(
            "expected a share of the solid density; is that in percent? write {}",
            value / 100.0
        )),
        _ => Err("expected a relative density above 0, at most 1".to_owned()),
    }
}

/// A final contact ratio phi.
pub(crate) fn final_contact_ratio(text: &str) -> Result<f64, String> {
    checked_phi(number(text)?).map_err(|(expected, help)| format!("expected {expected}; {help}"))
}

/// The largest error of a/R that a solver may make.
pub(crate) fn tolerance(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if SolverPlan::TOLERANCES.contains(&value) {
        Ok(value)
    } else {
        Err("expected an error of a/R between 1e-12 and 0.1".to_owned())
    }
}

/// A whole number within a range; 1e5 and `100_000` are numbers too.
fn count(text: &str, range: std::ops::RangeInclusive<usize>) -> Result<usize, String> {
    let plain = text.replace('_', "");
    let value = plain.parse::<usize>().ok().or_else(|| {
        let value = plain.parse::<f64>().ok()?;
        (value.fract() == 0.0 && (0.0..9e15).contains(&value)).then_some(value as usize)
    });
    match value {
        Some(value) if range.contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from {} to {}", range.start(), range.end())),
    }
}

/// A number of simulations: at least two sub-nets of eight points each, as fewer have no standard error.
pub(crate) fn samples(text: &str) -> Result<usize, String> {
    count(text, SAMPLES)
}

/// The seed of random numbers.
pub(crate) fn seed(text: &str) -> Result<u64, String> {
    text.trim().parse().map_err(|_| format!("expected a whole number from 0 to {}", u64::MAX))
}

/// A number of adaptive stages.
pub(crate) fn iterations(text: &str) -> Result<usize, String> {
    count(text, 1..=1000)
}

/// A number of threads.
pub(crate) fn threads(text: &str) -> Result<usize, String> {
    count(text, 1..=1024)
}

/// A number of posterior draws.
pub(crate) fn draws(text: &str) -> Result<usize, String> {
    count(text, 2..=100_000)
}

/// A number of made data sets.
pub(crate) fn data_sets(text: &str) -> Result<usize, String> {
    count(text, 100..=1_000_000)
}

/// A number of simulations of each of many calibrations.
pub(crate) fn samples_of_many(text: &str) -> Result<usize, String> {
    count(text, 256..=1_000_000)
}

/// A number of points of a curve.
pub(crate) fn points(text: &str) -> Result<usize, String> {
    count(text, 2..=1_000_000)
}

/// An effective sample size.
pub(crate) fn effective_samples(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value >= 1.0 { Ok(value) } else { Err("expected a number of at least 1".to_owned()) }
}

/// A window `T0:T1` \[s\]; an end that is left out is infinite.
pub(crate) fn window(text: &str) -> Result<[f64; 2], String> {
    let Some((start, end)) = text.split_once(':') else {
        return Err("expected two times with a colon between, as in 0.0:1.5".to_owned());
    };
    let bound = |text: &str, open: f64| match text.trim() {
        "" => Ok(open),
        text => number(text),
    };
    let window = [bound(start, 0.0)?, bound(end, f64::INFINITY)?];
    if window[0] < window[1] {
        Ok(window)
    } else {
        Err(match window[0] > window[1] {
            true => format!("expected a start before its end; did you mean {end}:{start}?"),
            false => "expected a start before its end, as in 0.0:1.5".to_owned(),
        })
    }
}

/// A noise model: `inferred`, `correlated` or `robust`, each with `:NU0,S0` or without, `correlated:log` and
/// `correlated:linear`, `fixed:SIGMA`, `fixed:table`, `fixed-relative:SHARE` or `ess-target:SHARE`.
pub(crate) fn noise(text: &str) -> Result<Noise, String> {
    let (kind, value) = match text.split_once(':') {
        Some((kind, value)) => (kind.trim(), Some(value.trim())),
        None => (text.trim(), None),
    };
    let share = |value: &str| {
        let share = positive(value)?;
        if share < 1.0 { Ok(share) } else { Err("expected a share between 0 and 1".to_owned()) }
    };
    let prior = |value: &str| {
        let (nu0, s0) = value
            .split_once(',')
            .ok_or_else(|| format!("expected {kind}:NU0,S0, as in {kind}:4,0.05"))?;
        Ok::<_, String>((positive(nu0)?, positive(s0)?))
    };
    match (kind, value) {
        ("inferred", None) => Ok(Noise::default()),
        ("inferred", Some(value)) => prior(value).map(|(nu0, s0)| Noise::Inferred { nu0, s0 }),
        ("correlated", None) => Ok(Noise::correlated()),
        ("correlated", Some("log")) => Ok(scaled(DistanceScale::Log)),
        ("correlated", Some("linear")) => Ok(scaled(DistanceScale::Linear)),
        ("correlated", Some("robust")) | ("robust", Some("correlated")) => Err(
            "outliers among correlated errors are not available: every set of rows could be the outliers; use correlated or \
             robust"
                .to_owned(),
        ),
        ("correlated", Some(value)) if value.contains("log") || value.contains("linear") => Err(
            "a scale and a prior of sigma are not combined here; use correlated:log, correlated:linear or correlated:NU0,S0, \
             or a plan file, which takes nu0, s0 and scale"
                .to_owned(),
        ),
        ("correlated", Some(value)) => {
            let of = |(nu0, s0)| Noise::Correlated { nu0, s0, scale: None, nodes: None };
            prior(value)
                .map(of)
                .map_err(|error| format!("{error}, or correlated:log or correlated:linear"))
        }
        ("robust", None) => Ok(Noise::robust()),
        ("robust", Some(value)) => prior(value).map(|(nu0, s0)| Noise::Robust { nu0, s0 }),
        ("fixed", Some("table")) => Ok(Noise::Fixed { sigma: FixedSigma::PerPoint }),
        ("fixed", Some(value)) => {
            Ok(Noise::Fixed { sigma: FixedSigma::Absolute(positive(value)?) })
        }
        ("fixed-relative", Some(value)) => {
            Ok(Noise::Fixed { sigma: FixedSigma::Relative(positive(value)?) })
        }
        ("ess-target", Some(value)) => Ok(Noise::EssTarget { share: share(value)? }),
        ("fixed", None) => Err("expected a standard deviation of a/R, as in fixed:0.03".to_owned()),
        ("fixed-relative", None) => {
            Err("expected a share of the value, as in fixed-relative:0.05".to_owned())
        }
        ("ess-target", None) => {
            Err("expected a share of the samples, as in ess-target:0.2".to_owned())
        }
        _ => {
            let kinds =
                ["inferred", "correlated", "robust", "fixed", "fixed-relative", "ess-target"];
            Err(match nearest(kind, kinds) {
                Some(near) => format!("unknown noise model; did you mean {near}?"),
                None => format!("unknown noise model; use one of {}", kinds.join(", ")),
            })
        }
    }
}

/// Noise models to compare.
pub(crate) type NoiseList = Vec<Noise>;

/// Noise models separated by commas, as in `inferred:4,0.05,robust`: a number belongs to the model before it.
pub(crate) fn noises(text: &str) -> Result<NoiseList, String> {
    let mut names: Vec<String> = Vec::new();
    for piece in text.split(',') {
        match names.last_mut() {
            Some(last) if piece.trim().parse::<f64>().is_ok() => {
                last.push(',');
                last.push_str(piece);
            }
            _ => names.push(piece.to_owned()),
        }
    }
    names.iter().map(|name| noise(name).map_err(|error| format!("{name}: {error}"))).collect()
}

/// Correlated noise with a given scale of distances.
fn scaled(scale: DistanceScale) -> Noise {
    Noise::Correlated { nu0: 4.0, s0: 0.05, scale: Some(scale), nodes: None }
}

/// Scale of the time axes by two options, of which at most one is given.
pub(crate) fn time_scale(log: bool, linear: bool) -> TimeScale {
    match (log, linear) {
        (true, _) => TimeScale::Log,
        (_, true) => TimeScale::Linear,
        _ => TimeScale::ByData,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_models_are_read_as_typed() {
        let fixed = |sigma| Ok(Noise::Fixed { sigma });
        assert_eq!(noise("inferred:6,0.02"), Ok(Noise::Inferred { nu0: 6.0, s0: 0.02 }));
        assert_eq!(noise("fixed:0.03"), fixed(FixedSigma::Absolute(0.03)));
        assert_eq!(noise("fixed:table"), fixed(FixedSigma::PerPoint));
        assert_eq!(noise("fixed-relative:0.05"), fixed(FixedSigma::Relative(0.05)));
        assert_eq!(noise("correlated"), Ok(Noise::correlated()));
        assert_eq!(noise("correlated:linear"), Ok(scaled(DistanceScale::Linear)));
        assert_eq!(noise("robust:3,0.1"), Ok(Noise::Robust { nu0: 3.0, s0: 0.1 }));
        assert_eq!(noise("ess-target:0.2"), Ok(Noise::EssTarget { share: 0.2 }));
        for wrong in [
            "fixed",
            "fixed:",
            "fixed:-1",
            "fixed:nan",
            "ess-target:2",
            "infered",
            "",
            ":",
            "correlated:",
            "correlated:4",
            "correlated:robust",
            "robust:log",
            "robust:4,0",
        ] {
            assert!(noise(wrong).is_err(), "{wrong}");
        }
        assert!(noise("infered").expect_err("misspelt").contains("mean inferred?"));
    }

    #[test]
    fn a_list_of_noise_models_keeps_their_numbers_with_them() {
        let list = noises("inferred:6,0.02,correlated:linear,robust").expect("three");
        let six = Noise::Inferred { nu0: 6.0, s0: 0.02 };
        assert_eq!(list, [six, scaled(DistanceScale::Linear), Noise::robust()]);
        assert!(noises("inferred,robus").expect_err("misspelt").contains("robus: unknown"));
        assert!(noises("").is_err());
        assert!(noises("4,0.05").is_err());
    }

    #[test]
    fn windows_may_be_open_and_never_backwards() {
        assert_eq!(window("0.5:2"), Ok([0.5, 2.0]));
        assert_eq!(window("0.5:"), Ok([0.5, f64::INFINITY]));
        assert_eq!(window(":2"), Ok([0.0, 2.0]));
        assert!(window("2:1").expect_err("backwards").contains("mean 1:2?"));
        assert!(!window("0:0").expect_err("empty").contains("mean"));
        for wrong in ["", "1", "a:b", "nan:1", "1:1", "1-2"] {
            assert!(window(wrong).is_err(), "{wrong}");
        }
    }
}
