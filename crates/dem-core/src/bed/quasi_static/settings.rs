//! Settings and report of the quasi-static mode.

/// Tolerances and limits of the quasi-static mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuasiStaticSettings {
    /// Error of a/R (root mean square over the contacts) that one step may make.
    pub tolerance: f64,
    /// Largest net force on a particle that counts as balanced, over fa.
    pub balance: f64,
    /// Whether a box that is periodic on all sides shrinks so that it carries no pressure.
    pub free_box: bool,
    /// Whether to end, before the time that was asked for, where the necks of the particles meet or their pores close.
    pub ends_where_necks_meet: bool,
    /// Largest number of steps.
    pub max_work: u64,
}

impl Default for QuasiStaticSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-4,
            balance: 1e-4,
            free_box: false,
            ends_where_necks_meet: false,
            max_work: 100_000,
        }
    }
}

/// Work and error of a quasi-static run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuasiStaticReport {
    /// Steps taken.
    pub steps: u64,
    /// Steps repeated with a shorter length.
    pub rejected: u64,
    /// Newton iterations.
    pub newton: u64,
    /// Iterations of conjugate gradients; each costs about a step of the engine.
    pub conjugate_gradients: u64,
    /// Error of the mean contact ratio so far: the sum of the mean errors of the steps, which is systematic, plus the root
    /// of the sum of their mean squares, which is random (a contact made or broken shifts the load of all).
    pub error_estimate: f64,
    /// Sum over the steps of the signed mean error of a/R.
    pub mean_error: f64,
    /// Sum over the steps of the mean squared error of a/R.
    pub squared_error: f64,
    /// Time up to which the bed is in balance \[s\].
    pub balanced_at_s: Option<f64>,
    /// Next step \[s\], where there was one before.
    pub next_step_s: Option<f64>,
}
