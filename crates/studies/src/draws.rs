//! Parameter vectors drawn from the priors.

use dem_core::Sintering;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};

use workbench::error::InputError;
use workbench::material::Material;
use workbench::prior_file::PriorFile;

/// As many draws from a material's built-in priors; the same every time.
pub(super) fn from_prior(material: Material, count: usize) -> Result<Vec<Sintering>, InputError> {
    let prior = PriorFile::of_material(material)?;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut draw = |of: Option<&smc_calib::Prior>| {
        let uniform: f64 = random.random();
        of.map_or(1.0, |prior| prior.quantile(uniform))
    };
    Ok((0..count)
        .map(|_| Sintering {
            c1: draw(prior.c1.as_ref()),
            tau_s: draw(Some(&prior.tau_s)),
            delta_c: draw(prior.delta_c.as_ref()),
        })
        .collect())
}
