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

/// Share of a linear control axis within which values that make half their way leave the rest of it empty.
const EARLY: f64 = 0.1;

impl Axes {
    /// Whether measured values change so early that a linear control axis would press what they show into its
    /// beginning: half of the way that they make lies within its first tenth, and all control values are positive.
    pub fn change_early(control: &[f64], value: &[f64]) -> bool {
        let mut rows: Vec<(f64, f64)> =
            control.iter().copied().zip(value.iter().copied()).collect();
        rows.retain(|(at, value)| at.is_finite() && value.is_finite());
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return false };
        let way = |row: &(f64, f64)| (row.1 - first.1).abs();
        let most = rows.iter().map(way).fold(0.0, f64::max);
        let half = rows.iter().find(|row| way(row) >= 0.5 * most);
        first.0 > 0.0 && most > 0.0 && half.is_some_and(|half| half.0 < EARLY * last.0)
    }

    /// Horizontal axis of measurements at control values and of curves at a grid; of a logarithmic one the measurements set
    /// the range, as curves go on towards zero for ever.
    pub(crate) fn control_of(&self, measured: &[f64], grid: &[f64]) -> Axis {
        let first = measured.iter().copied().filter(|at| *at > 0.0).fold(f64::INFINITY, f64::min);
        let shown = |at: &f64| !self.log_control || first == f64::INFINITY || *at >= 0.5 * first;
        self.control(measured.iter().chain(grid.iter().filter(|at| shown(at))).copied())
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_change_in_the_first_tenth_of_the_time_are_said_to_change_early() {
        let times: Vec<f64> = (1..=50).map(f64::from).collect();
        let curve =
            |tau: f64| -> Vec<f64> { times.iter().map(|t| 1.0 - (-t / tau).exp()).collect() };
        assert!(Axes::change_early(&times, &curve(2.0)));
        assert!(!Axes::change_early(&times, &curve(15.0)));
        // A logarithmic axis would leave out what lies at zero.
        let from_zero: Vec<f64> = times.iter().map(|t| t - 1.0).collect();
        assert!(!Axes::change_early(&from_zero, &curve(2.0)));
        assert!(!Axes::change_early(&times, &[1.0; 50]) && !Axes::change_early(&[], &[]));
    }
}
