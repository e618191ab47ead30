//! The noise models of a comparison, and their names.

use smc_calib::{DistanceScale, FixedSigma, Noise};

use crate::error::{InputError, Mistake};

/// Those compared unless others are asked for: independent, correlated, robust.
pub fn default_noises() -> Vec<Noise> {
    vec![Noise::default(), Noise::correlated(), Noise::robust()]
}

/// Name of a noise model in tables: its kind, and what it has that is not the default.
pub(super) fn name(noise: &Noise) -> String {
    let prior = |kind: &str, nu0: f64, s0: f64| match (nu0, s0) {
        (4.0, 0.05) => kind.to_owned(),
        _ => format!("{kind} {nu0},{s0}"),
    };
    match noise {
        Noise::Inferred { nu0, s0 } => prior("independent", *nu0, *s0),
        Noise::Robust { nu0, s0 } => prior("robust", *nu0, *s0),
        Noise::Correlated { nu0, s0, scale, .. } => {
            let scale = match scale {
                None => "",
                Some(DistanceScale::Log) => " log",
                Some(DistanceScale::Linear) => " linear",
            };
            format!("{}{scale}", prior("correlated", *nu0, *s0))
        }
        Noise::Fixed { sigma: FixedSigma::Absolute(sigma) } => format!("fixed {sigma}"),
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => format!("fixed-relative {share}"),
        Noise::Fixed { sigma: FixedSigma::PerPoint } => "fixed table".to_owned(),
        Noise::EssTarget { share } => format!("ess-target {share}"),
    }
}

/// The models with their names.
///
/// # Errors
///
/// [`InputError`] where there is none, one has no evidence, or one is there twice.
pub(super) fn named(noises: &[Noise]) -> Result<Vec<(String, Noise)>, InputError> {
    let refused = |found: String| InputError::new("--noise", Mistake::Conflict).found(found);
    let mut named: Vec<(String, Noise)> = Vec::new();
    for noise in noises {
        let name = name(noise);
        if noise.is_tuned() {
            return Err(refused(format!("{name}, which is tuned and has no evidence"))
                .expected("inferred, correlated, robust or fixed noise")
                .help("leave it out: calibrate compare --noise inferred,correlated,robust"));
        }
        if named.iter().any(|(other, _)| *other == name) {
            return Err(refused(format!("{name} noise twice")).expected("each noise model once"));
        }
        named.push((name, noise.clone()));
    }
    let scale_left_open = |noise: &Noise| matches!(noise, Noise::Correlated { scale: None, .. });
    let correlated = noises.iter().filter(|noise| noise.is_correlated()).count();
    if correlated > 1 && noises.iter().any(scale_left_open) {
        return Err(refused("correlated noise whose scale is left open beside another".to_owned())
            .expected("correlated:log,correlated:linear, or one of them"));
    }
    if named.is_empty() {
        return Err(refused("no noise model".to_owned()).expected("at least one"));
    }
    Ok(named)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_noise_of_a_comparison_has_a_name_of_its_own() {
        let names: Vec<String> =
            named(&default_noises()).expect("three").into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["independent", "correlated", "robust"]);
        let linear = Noise::Correlated {
            nu0: 4.0,
            s0: 0.05,
            scale: Some(DistanceScale::Linear),
            nodes: None,
        };
        assert_eq!(name(&linear), "correlated linear");
        assert_eq!(name(&Noise::Inferred { nu0: 6.0, s0: 0.02 }), "independent 6,0.02");
    }

    #[test]
    fn noise_without_an_evidence_and_the_same_noise_twice_are_refused() {
        let tuned = named(&[Noise::EssTarget { share: 0.2 }]).expect_err("no evidence");
        assert!(tuned.to_string().contains("has no evidence"), "{tuned}");
        let twice = named(&[Noise::robust(), Noise::robust()]).expect_err("twice");
        assert!(twice.to_string().contains("robust noise twice"), "{twice}");
        assert!(named(&[]).is_err());
    }
}
