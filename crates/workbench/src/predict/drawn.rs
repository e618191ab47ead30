//! The draws that a prediction is made of, and quantities over them.

use dem_core::heat::Heat;
use dem_core::{Kinetics, PairScene, Sintering};
use serde::Serialize;
use smc_calib::Weighted;

/// A quantity over the posterior draws that have it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Predicted {
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
}

impl Predicted {
    /// Of values with their weights.
    pub(super) fn of(values: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let draws = Weighted::new(values);
        let median = draws.quantile(0.5);
        median.is_finite().then(|| Self {
            median,
            eti50: draws.interval(0.5),
            eti90: draws.interval(0.9),
            eti95: draws.interval(0.95),
        })
    }
}

/// A draw at the radius that is predicted for.
pub(super) struct Drawn {
    pub(super) scene: PairScene,
    pub(super) sintering: Sintering,
    pub(super) kinetics: Kinetics,
    pub(super) weight: f64,
    /// None for the one temperature of the calibration.
    pub(super) heat: Option<Heat>,
    /// None where the noise is not known at other times than the observed ones.
    pub(super) scatter: Option<Scatter>,
}

/// How measurements scatter around the curve of a draw.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatter {
    pub(super) sigma: f64,
    /// Share of outliers, and how much wider they scatter.
    pub(super) outliers: Option<[f64; 2]>,
}

impl Scatter {
    /// The error of draw number `k`: by golden-ratio sequences, the same for every time.
    pub(super) fn error(&self, k: usize) -> f64 {
        let u = |step: f64| ((k as f64 + 0.5) * step).fract();
        let widening = match self.outliers {
            Some([share, width]) if u(0.754_877_666_246_692_8) < share => width,
            _ => 1.0,
        };
        self.sigma * widening * smc_calib::normal::quantile(u(0.618_033_988_749_894_9))
    }
}
