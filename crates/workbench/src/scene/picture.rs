//! A bed and its series as pictures.

use dem_core::bed::{Bed, Phase, Sample, Series, Side};
use figures::{BedFigure, SeriesFigure};

use super::record::heated_from_s;
use crate::number::significant;

/// The bed as it is: where its pairs ended, from there on.
pub(super) fn bed_figure(bed: &Bed, name: &str) -> BedFigure {
    let particles = bed.particles();
    let mut figure = BedFigure {
        title: format!("{name}, t = {} s", significant(bed.time_s(), 3)),
        position_m: particles.position_m.clone(),
        radius_m: particles.radius_m.clone(),
        ..BedFigure::default()
    };
    let mut sums = vec![(0.0, 0.0); particles.len()];
    for contact in bed.contacts() {
        let [i, j] = contact.particles;
        let length = particles.radius_m[i] + particles.radius_m[j] - contact.approach_m;
        figure.contacts.push((i, contact.normal.map(|part| -part * length), j));
        for particle in [i, j] {
            sums[particle].0 += contact.contact_ratio();
            sums[particle].1 += 1.0;
        }
    }
    figure.contact_ratio = sums.into_iter().map(|(sum, count)| sum / count).collect();
    let region = &bed.surroundings().region;
    if region.sides != [Side::Open; 3] {
        let mut frame = [[0.0; 3], region.size_m];
        for axis in 0..3 {
            let low = |part: f64, (p, r): (&[f64; 3], &f64)| part.min(p[axis] - r);
            let high = |part: f64, (p, r): (&[f64; 3], &f64)| part.max(p[axis] + r);
            let all = || particles.position_m.iter().zip(&particles.radius_m);
            // A box is drawn up to the bed's surface, not up to the sky.
            if region.sides[axis] != Side::Periodic {
                frame[1][axis] = all().fold(f64::NEG_INFINITY, high);
            }
            if region.sides[axis] == Side::Open {
                frame[0][axis] = all().fold(f64::INFINITY, low);
            }
        }
        figure.frame_m = Some(frame);
    }
    figure
}

/// A scale that holds the contact ratios of a figure, and little else.
pub(super) fn colour_range(figure: &BedFigure) -> [f64; 2] {
    let ratios = figure.contact_ratio.iter().copied();
    let (least, largest) = ratios
        .filter(|ratio| ratio.is_finite())
        .fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), ratio| (l.min(ratio), h.max(ratio)));
    if least > largest {
        return [0.0, 1.0];
    }
    let lower = (least * 20.0).floor() / 20.0;
    [lower, (largest * 20.0).ceil().max(lower * 20.0 + 1.0) / 20.0]
}

/// The curves of a run.
pub(super) fn series_figure(name: &str, series: &Series, phases: &[Phase]) -> SeriesFigure {
    let column =
        |pick: &dyn Fn(&Sample) -> f64| -> Vec<f64> { series.samples.iter().map(pick).collect() };
    SeriesFigure {
        title: name.to_owned(),
        time_s: column(&|sample| sample.time_s),
        relative_density: column(&|sample| sample.relative_density),
        coordination: column(&|sample| sample.coordination),
        mean_contact_ratio: column(&|sample| sample.mean_contact_ratio),
        contact_ratio_10: column(&|sample| sample.contact_ratio_deciles[0]),
        contact_ratio_90: column(&|sample| sample.contact_ratio_deciles[2]),
        heated_from_s: heated_from_s(series, phases).filter(|&time| time > 0.0),
        pairs_end_s: series.hand_over.map(|sample| sample.time_s),
    }
}
