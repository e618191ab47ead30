//! The noise models that the study compares.

use smc_calib::Noise;

/// Noise models by name.
pub(super) fn models() -> [(&'static str, Noise); 3] {
    [
        ("independent", Noise::default()),
        ("correlated", Noise::correlated()),
        ("robust", Noise::robust()),
    ]
}
