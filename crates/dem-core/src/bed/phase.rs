//! Phases of a scene.

use serde::{Deserialize, Serialize};

use super::error::{BedError, field, within};

/// Equations of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Newton's law.
    #[default]
    Dynamic,
    /// Force balance at every instant.
    QuasiStatic,
}

/// `[[phases]]`
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// A name for outputs.
    pub name: String,
    /// Duration \[s\].
    pub duration_s: f64,
    /// Whether contacts grow.
    pub heated: bool,
    /// Equations.
    #[serde(default)]
    pub mode: Mode,
    /// Number of observations, evenly spread over the phase.
    #[serde(default = "outputs")]
    pub outputs: usize,
    /// Step over collision time (dynamic).
    #[serde(default = "step")]
    pub step_over_collision_time: f64,
    /// Factor on inertia (dynamic).
    #[serde(default = "one")]
    pub mass_scaling: f64,
    /// Largest inertial number at an observation of a heated phase (dynamic); left out, it is only recorded.
    pub inertial_number_limit: Option<f64>,
    /// K1 of this phase in place of the material's \[N/m\]: a bed may settle with a softer one. A heated quasi-static phase of a scene with
    /// `[adhesion]` takes `1e3 fa/R` without it: its contacts then start with the neck of the pair.
    pub k1_n_per_m: Option<f64>,
    /// Error of a/R that one step may make (quasi-static).
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Largest number of steps.
    #[serde(default = "max_work")]
    pub max_work: u64,
}

fn outputs() -> usize {
    100
}
fn step() -> f64 {
    0.02
}
fn one() -> f64 {
    1.0
}
fn tolerance() -> f64 {
    1e-4
}
fn max_work() -> u64 {
    1_000_000_000
}

impl Phase {
    /// A field of the phase at `index`, as a reader of the scene file finds it.
    pub(super) fn field_name(&self, index: usize, name: &str) -> String {
        format!("[[phases]] {} ({}): {name}", index + 1, self.name)
    }

    /// Checks the fields of the phase at `index`.
    pub(super) fn check(&self, index: usize, can_heat: bool) -> Result<(), BedError> {
        let name = |name: &str| self.field_name(index, name);
        let duration = self.duration_s;
        within(
            &name("duration_s"),
            duration,
            1e-12,
            1e9,
            "give the time in seconds, 1e-12 to 1e9",
        )?;
        if !(1..=1_000_000).contains(&self.outputs) {
            return Err(field(name("outputs"), self.outputs, "use 1 to 1e6"));
        }
        if self.heated && !can_heat {
            return Err(field(name("heated"), "true", "give the [sintering] table"));
        }
        let step = self.step_over_collision_time;
        within(&name("step_over_collision_time"), step, 1e-9, 1.0, "use 1e-9 to 1; 0.02 is usual")?;
        within(&name("mass_scaling"), self.mass_scaling, 1.0, 1e18, "use 1 to 1e18")?;
        within(&name("tolerance"), self.tolerance, 1e-9, 0.1, "use 1e-9 to 0.1")?;
        if let Some(k1) = self.k1_n_per_m {
            within(&name("k1_n_per_m"), k1, 1e-15, 1e15, "give it in N/m, 1e-15 to 1e15")?;
        }
        if let Some(limit) = self.inertial_number_limit {
            within(&name("inertial_number_limit"), limit, 1e-12, 1e3, "use 1e-12 to 1e3")?;
        }
        Ok(())
    }
}
