//! Axes: quantity, scale and range.

/// Values beyond this are not drawn: their range would overflow.
const LARGEST: f64 = 1e300;
/// A range or value below this counts as zero.
const SMALLEST: f64 = 1e-290;
/// Least width of a range relative to its values, so that ticks differ in double precision.
const LEAST_SPAN: f64 = 1e-12;

/// How values become coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Coordinates are the values.
    Linear,
    /// Coordinates are log10 of the values; values <= 0 are not drawn.
    Log,
    /// The values are log10 of the quantity, and the labels name the quantity.
    Exponent,
    /// Linear, with ticks at whole numbers only.
    Count,
}

/// One axis: quantity, scale and range in coordinates (log10 of the value where `Log`).
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) scale: Scale,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Axis {
    /// An axis that holds all values, with a margin as a share of the range.
    pub(crate) fn holding(
        name: &str,
        unit: &str,
        scale: Scale,
        values: impl IntoIterator<Item = f64>,
        margin: f64,
    ) -> Axis {
        let mut axis = Axis {
            name: name.to_owned(),
            unit: unit.to_owned(),
            scale,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        };
        for value in values {
            if let Some(c) = axis.coordinate(value) {
                axis.low = axis.low.min(c);
                axis.high = axis.high.max(c);
            }
        }
        if axis.low > axis.high {
            (axis.low, axis.high) = (0.0, 1.0);
        }
        let size = axis.low.abs().max(axis.high.abs());
        let span = axis.high - axis.low;
        let least = match scale {
            Scale::Linear => size * LEAST_SPAN,
            Scale::Log | Scale::Exponent => size.max(1.0) * LEAST_SPAN,
            Scale::Count => 1.0,
        };
        let pad = if span > least.max(SMALLEST) {
            span * margin
        } else {
            match scale {
                Scale::Linear if size > SMALLEST => size * 0.05,
                Scale::Linear => 0.5,
                Scale::Log | Scale::Exponent => (size * 1e-3).max(0.3),
                Scale::Count => (size * 1e-3).max(0.6),
            }
        };
        axis.low -= pad;
        axis.high += pad;
        axis
    }

    /// The same axis, starting at a value if that is below the upper end.
    pub(crate) fn starting_at(mut self, value: f64) -> Axis {
        if let Some(c) = self.coordinate(value).filter(|&c| c < self.high) {
            self.low = c;
        }
        self
    }

    /// Coordinate of a value, if it has one.
    pub(crate) fn coordinate(&self, value: f64) -> Option<f64> {
        match self.scale {
            Scale::Linear | Scale::Exponent | Scale::Count => {
                Some(value).filter(|v| v.abs() <= LARGEST)
            }
            Scale::Log => (value > 0.0 && value.is_finite()).then(|| value.log10()),
        }
    }

    /// As [`Axis::coordinate`], but moved nearer where it lies so far outside the range that rounding would harm.
    pub(crate) fn near(&self, value: f64) -> Option<f64> {
        let far = 1e9 * (self.high - self.low);
        self.coordinate(value).map(|c| c.clamp(self.low - far, self.high + far))
    }

    /// Whether a coordinate lies on the axis, up to rounding.
    pub(crate) fn holds(&self, coordinate: f64) -> bool {
        let slack = 1e-3 * (self.high - self.low);
        (self.low - slack..=self.high + slack).contains(&coordinate)
    }

    /// Nearest coordinate on the axis.
    pub(crate) fn within(&self, coordinate: f64) -> f64 {
        coordinate.clamp(self.low, self.high)
    }
}
