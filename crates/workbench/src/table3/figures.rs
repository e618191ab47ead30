//! Figures 2, 4, 5 and 6 of the paper, redone.

use dem_core::kinetics::Regimes;

use super::calibrated::Calibrated;
use crate::error::Failure;
use crate::input::material::Material;
use crate::pair::model::NeckGrowth;
use crate::report;
use figures::{FitFigure, RegimeMapFigure};

/// Points of the regime map.
const POINTS: usize = 241;

/// Figure 2: eqs. 3 to 5 at the MAP of the `regime-map` kinetics, with p1 and p2, and the measurements.
pub(crate) fn regime_map(one: &Calibrated) -> Result<RegimeMapFigure, Failure> {
    let pair = one.calibration.record.pair()?;
    let map = NeckGrowth::of(&one.calibration.record.plan)?
        .sintering(&one.calibration.posterior.map.theta);
    let lines = Regimes::new(pair.plan.scene()?.powder(), &map);
    let (p1_s, p2_s) = (lines.p1_s(), lines.p2_s());
    let measured = pair.measured;
    let last = measured.control.last().copied().unwrap_or(1.0);
    let first = 0.03 * p1_s;
    let ratio = (3.0 * last / first).ln();
    let grid_s: Vec<f64> =
        (0..POINTS).map(|k| first * (ratio * k as f64 / (POINTS - 1) as f64).exp()).collect();
    let (data_time_s, data_ratio) = measured
        .control
        .iter()
        .zip(&measured.values)
        .filter(|(time, value)| **time > 0.0 && **value > 0.0)
        .unzip();
    Ok(RegimeMapFigure {
        title: format!("Regime map, {}", one.material.title()),
        a0: lines.adhesive,
        a1: grid_s.iter().map(|time| lines.zipping(*time)).collect(),
        a2: grid_s.iter().map(|time| lines.stretching(*time)).collect(),
        p1: Some((p1_s, lines.adhesive)),
        p2: Some((p2_s, lines.stretching(p2_s))),
        final_ratio: Some(pair.plan.final_contact_ratio),
        data_time_s,
        data_ratio,
        grid_s,
    })
}

/// Figures 4, 5 and 6: measurements, posterior bands, MAP, the paper's curve and the best Frenkel curve.
pub(crate) fn sintering_curve(one: &Calibrated) -> Option<(&'static str, FitFigure)> {
    let name = match one.material {
        Material::Ps => "figure4",
        Material::Pa12 => "figure5",
        Material::Peek => "figure6",
    };
    Some((name, report::fit(&one.calibration.record, report::TimeScale::ByData)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::Unwatched;

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn p1_and_p2_are_where_the_lines_of_the_regime_map_meet() {
        let one = Calibrated::new(
            Material::Peek,
            dem_core::Kinetics::RegimeMap,
            1024,
            1,
            &Unwatched::default(),
        )
        .expect("a run");
        let figure = regime_map(&one).expect("a figure");
        let at = |line: &[f64], time_s: f64| {
            let k = figure.grid_s.partition_point(|t| *t < time_s);
            let (t0, t1) = (figure.grid_s[k - 1], figure.grid_s[k]);
            let share = (time_s / t0).ln() / (t1 / t0).ln();
            (line[k - 1].ln() + share * (line[k] / line[k - 1]).ln()).exp()
        };
        let (p1, p2) = (figure.p1.expect("p1"), figure.p2.expect("p2"));
        assert!((at(&figure.a1, p1.0) / figure.a0 - 1.0).abs() < 1e-9);
        assert!((at(&figure.a1, p2.0) / p2.1 - 1.0).abs() < 1e-9);
        assert!((at(&figure.a2, p2.0) / p2.1 - 1.0).abs() < 1e-9);
        assert!(p1.0 < p2.0 && p1.1 == figure.a0);
        assert!((figure.a0 / 0.022 - 1.0).abs() < 0.05, "eq. 3: {}", figure.a0);
    }
}
