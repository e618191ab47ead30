//! Names and scales of the axes of a measured curve.

use crate::drawing::{Axis, Scale};

/// Names and scales of the axes of a measured curve: an observable over its control variable.
///
/// By default these are the axes of neck growth: the contact ratio a/R (a pure number) over the time t in seconds, both
/// linear and beginning at zero.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axes {
    /// Name of the control variable, for example `time t`.
    pub control_name: String,
    /// Its unit; empty for a pure number.
    pub control_unit: String,
    /// Name of the measured quantity, for example `contact ratio a/R`.
    pub value_name: String,
    /// Its unit; empty for a pure number.
    pub value_unit: String,
    /// Whether both axes begin at zero (the control axis only where it is linear).
    pub from_zero: bool,
    /// Whether the control axis is logarithmic; points at or below zero are then left out.
    pub log_control: bool,
}

impl Default for Axes {
    /// Neck growth: contact ratio over time in seconds, linear, both from zero.
    fn default() -> Self {
        Self {
            control_name: "time t".to_owned(),
            control_unit: "s".to_owned(),
            value_name: "contact ratio a/R".to_owned(),
            value_unit: String::new(),
            from_zero: true,
            log_control: false,
        }
    }
}

impl Axes {
    /// Horizontal axis that holds all control values.
    pub(crate) fn control(&self, values: impl IntoIterator<Item = f64>) -> Axis {
        let scale = if self.log_control { Scale::Log } else { Scale::Linear };
        let axis = Axis::holding(&self.control_name, &self.control_unit, scale, values, 0.02);
        if self.from_zero && !self.log_control { axis.starting_at(0.0) } else { axis }
    }

    /// Vertical axis that holds all measured and modelled values.
    pub(crate) fn value(&self, values: impl IntoIterator<Item = f64>) -> Axis {
        let zero = self.from_zero.then_some(0.0);
        let values = values.into_iter().chain(zero);
        let axis = Axis::holding(&self.value_name, &self.value_unit, Scale::Linear, values, 0.04);
        if self.from_zero { axis.starting_at(0.0) } else { axis }
    }

    /// Name of the difference between measurement and model.
    pub(crate) fn residual_name(&self) -> String {
        let symbol = self.value_name.strip_prefix("contact ratio ");
        format!("residual of {}", symbol.unwrap_or(&self.value_name))
    }
}
