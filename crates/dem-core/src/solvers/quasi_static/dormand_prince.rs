//! One step of the Dormand-Prince pair, with its continuous extension.
//!
//! J.R. Dormand, P.J. Prince, J. Comput. Appl. Math. 6 (1980) 19; continuous extension of fourth
//! order after E. Hairer, S.P. Norsett, G. Wanner, *Solving Ordinary Differential Equations I*,
//! section II.6.

/// A step of `dy/dt = f(t, y)`, t since its start.
pub(super) struct Step {
    start: f64,
    /// Coefficients of the continuous extension.
    extension: [f64; 4],
    end_slope: f64,
    /// Magnitude of the embedded error estimate.
    pub(super) error: f64,
}

impl Step {
    #[inline]
    pub(super) fn take(f: &impl Fn(f64, f64) -> f64, y: f64, k1: f64, h: f64) -> Self {
        let k2 = f(0.2 * h, y + h * (0.2 * k1));
        let k3 = f(0.3 * h, y + h * (3.0 / 40.0 * k1 + 9.0 / 40.0 * k2));
        let k4 = f(0.8 * h, y + h * (44.0 / 45.0 * k1 - 56.0 / 15.0 * k2 + 32.0 / 9.0 * k3));
        let k5 = f(
            8.0 / 9.0 * h,
            y + h
                * (19372.0 / 6561.0 * k1 - 25360.0 / 2187.0 * k2 + 64448.0 / 6561.0 * k3
                    - 212.0 / 729.0 * k4),
        );
        let k6 = f(
            h,
            y + h
                * (9017.0 / 3168.0 * k1 - 355.0 / 33.0 * k2
                    + 46732.0 / 5247.0 * k3
                    + 49.0 / 176.0 * k4
                    - 5103.0 / 18656.0 * k5),
        );
        let change = h
            * (35.0 / 384.0 * k1 + 500.0 / 1113.0 * k3 + 125.0 / 192.0 * k4 - 2187.0 / 6784.0 * k5
                + 11.0 / 84.0 * k6);
        let k7 = f(h, y + change);
        let error = h
            * (71.0 / 57600.0 * k1 - 71.0 / 16695.0 * k3 + 71.0 / 1920.0 * k4
                - 17253.0 / 339_200.0 * k5
                + 22.0 / 525.0 * k6
                - 0.025 * k7);
        let bend = h * k1 - change;
        Self {
            start: y,
            extension: [
                change,
                bend,
                change - h * k7 - bend,
                h * (-12_715_105_075.0 / 11_282_082_432.0 * k1
                    + 87_487_479_700.0 / 32_700_410_799.0 * k3
                    - 10_690_763_975.0 / 1_880_347_072.0 * k4
                    + 701_980_252_875.0 / 199_316_789_632.0 * k5
                    - 1_453_857_185.0 / 822_651_844.0 * k6
                    + 69_997_945.0 / 29_380_423.0 * k7),
            ],
            end_slope: k7,
            error: error.abs(),
        }
    }

    /// `y` at a fraction of the step.
    #[inline]
    pub(super) fn at(&self, fraction: f64) -> f64 {
        let rest = 1.0 - fraction;
        let [c1, c2, c3, c4] = self.extension;
        self.start + fraction * (c1 + rest * (c2 + fraction * (c3 + rest * c4)))
    }

    /// Error estimate of the continuous extension: what its highest term contributes at most, which
    /// is the error of the extension of one order less.
    #[inline]
    pub(super) fn dense_error(&self) -> f64 {
        self.extension[3].abs() / 16.0
    }

    /// `y` at the end of the step.
    #[inline]
    pub(super) fn end(&self) -> f64 {
        self.start + self.extension[0]
    }

    /// Slope at the end of the step.
    #[inline]
    pub(super) fn end_slope(&self) -> f64 {
        self.end_slope
    }

    /// Fraction of the step at which the growing `y` reaches `level`, which lies inside it.
    pub(super) fn crossing(&self, level: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.at(middle) < level { low = middle } else { high = middle }
        }
        high
    }
}
