//! The corner plot: marginal densities on the diagonal, densities of the pairs below it.

use std::cmp::Ordering;

use plotters::style::Color as _;
use tiny_skia::Rect;

use crate::columns::Columns;
use crate::density::{self, Bins};
use crate::drawing::{
    Axis, Look, Marker, Page, Panel, Pen, Region, Role, Row, Scale, Spec, Swatch,
};
use crate::drawing::{GREY, OVERHANG, WHITE, anchor, header, layout, length, written};
use crate::error::{Drawn, PlotError};
use crate::figure::Figure;

/// One parameter of a [`CornerFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerParameter {
    /// Symbol, for example `C_{1}`.
    pub symbol: String,
    /// Unit, for example `Pa^{-1} s^{-1}`; empty for a pure number.
    pub unit: String,
    /// Whether the draws are log10 of the parameter; ticks are then labelled with the parameter itself.
    pub log10: bool,
    /// Draws in the coordinate of the axis (log10 of the parameter where `log10`).
    pub draws: Vec<f64>,
    /// Quantiles at 2.5, 25, 50, 75 and 97.5 % in the coordinate; none for those of the draws.
    pub quantiles: Option<[f64; 5]>,
    /// Prior density as (coordinate, density per unit of the coordinate), increasing in the coordinate; empty for none.
    pub prior: Vec<(f64, f64)>,
    /// The paper's value, in the coordinate.
    pub paper: Option<f64>,
    /// The maximum a posteriori, in the coordinate.
    pub map: Option<f64>,
}

/// Posterior of up to five parameters: marginals with 50 % and 95 % intervals, pairs with 50 % and 95 % regions.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerFigure {
    /// Heading; empty for none.
    pub title: String,
    /// The parameters, one to five.
    pub parameters: Vec<CornerParameter>,
    /// One weight per draw (any scale); empty for equal weights.
    pub weights: Vec<f64>,
}

/// More parameters than this do not fit on a page.
const MOST_PARAMETERS: usize = 5;
/// Bins of a marginal.
const BINS: usize = 160;
/// Bins per coordinate of a pair.
const PAIR_BINS: usize = 72;
/// Share of a pair's mass below which a part of a region apart from the others is left out: chance draws it.
const LEAST_PART: f64 = 0.02;
/// The end of a prior: values beyond it were excluded, not found improbable.
const BOUND: Pen = Pen::solid(GREY, 1.3);
/// Size of the numbers above the marginals, and the distance between their lines.
const SUMMARY_SIZE: f32 = 6.0;
const SUMMARY_LINE: f32 = 8.0;

/// Axis, density and quantiles of one parameter, for all its panels.
struct Prepared<'a> {
    parameter: &'a CornerParameter,
    axis: Axis,
    bins: Bins,
    pair_bins: Bins,
    density: Vec<f64>,
    pair_bandwidth: f64,
    /// 2.5, 25, 50, 75 and 97.5 %.
    quantiles: [f64; 5],
}

impl Figure for CornerFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("corner");
        columns.at_most("parameters", self.parameters.len(), MOST_PARAMETERS)?;
        let n = self.parameters.first().map_or(0, |p| p.draws.len());
        for p in &self.parameters {
            columns.need(&format!("draws of {}", p.symbol), &p.draws, (n, "draw"))?;
        }
        columns.allow("weights", &self.weights, (n, "draw"))?;
        let weight = |i: usize| {
            self.weights.get(i).map_or(1.0, |w| if w.is_finite() { w.max(0.0) } else { 0.0 })
        };
        let prepared: Vec<Prepared> =
            self.parameters.iter().map(|p| Prepared::new(p, weight)).collect();
        let bounded = prepared.iter().any(|one| one.ends_of_prior().next().is_some());
        let top = header(page, &self.title, &self.entries(bounded))?;
        let count = prepared.len();
        let gap = if count > 3 { 7.0 } else { 10.0 };
        let room = page.width - 50.0 - gap * count.saturating_sub(1) as f32;
        let height = (room / count.max(1) as f32).min(page.of_width(130.0, 180.0));
        let summarised = height > 45.0;
        let top = top + if summarised { 2.0 * SUMMARY_LINE } else { 0.0 };
        let rows: Vec<Row> = (0..count).map(|row| (height, cells(&prepared, row))).collect();
        let panels = layout(page, top, gap, &rows)?;
        let places = (0..count).flat_map(|row| (0..=row).map(move |column| (column, row)));
        let mut diagonal = Vec::new();
        for (panel, (column, row)) in panels.iter().zip(places) {
            if row == column {
                marginal(page, panel, &prepared[row])?;
                diagonal.push(panel);
            } else {
                pair(panel, &prepared[column], &prepared[row], weight)?;
            }
        }
        if summarised { summaries(page, &diagonal, gap, &prepared) } else { Ok(()) }
    }
}

impl CornerFigure {
    fn entries(&self, bounded: bool) -> Vec<(&'static str, Swatch)> {
        let ink = Role::Posterior.ink();
        let mut entries = vec![
            ("50 % of the posterior", Swatch::Band(ink.mix(0.55))),
            ("95 %", Swatch::Band(ink.mix(0.22))),
        ];
        if self.parameters.iter().any(|p| !p.prior.is_empty()) {
            entries.push(("prior", Swatch::Line(Role::Prior.pen())));
        }
        if bounded {
            entries.push(("end of the prior", Swatch::Line(BOUND)));
        }
        if self.parameters.iter().any(|p| p.map.is_some()) {
            entries.push(("MAP", Swatch::Point(map_look())));
        }
        if self.parameters.iter().any(|p| p.paper.is_some()) {
            entries.push(("paper", Swatch::Line(Role::Paper.pen())));
        }
        entries
    }
}

/// A row of the lower triangle: pairs, the marginal, and empty cells.
fn cells(prepared: &[Prepared], row: usize) -> Vec<Option<Spec>> {
    let bottom = row + 1 == prepared.len();
    let cell = |(column, one): (usize, &Prepared)| {
        let x = one.axis.clone();
        match column.cmp(&row) {
            Ordering::Less => {
                let y = prepared[row].axis.clone();
                Some(Spec::new(x, y).x_labels(bottom).y_labels(column == 0))
            }
            Ordering::Equal => Some(Spec::new(x, one.density_axis()).x_labels(bottom).bare()),
            Ordering::Greater => None,
        }
    };
    prepared.iter().enumerate().map(cell).collect()
}

impl Prepared<'_> {
    fn new(p: &CornerParameter, weight: impl Fn(usize) -> f64 + Copy) -> Prepared<'_> {
        let scale = if p.log10 { Scale::Exponent } else { Scale::Linear };
        let draws = p.draws.iter().enumerate().map(|(i, &x)| (x, weight(i)));
        let mut sorted: Vec<(f64, f64)> =
            draws.filter(|(x, w)| x.abs() <= 1e300 && *w > 0.0).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let quantile = |q| density::quantile_sorted(&sorted, q);
        let (low, high) = (quantile(0.001), quantile(0.999));
        // A mark far away would squeeze the posterior into nothing; it is left out of the range and not drawn.
        let reach = 1.5 * (high - low);
        let marks = [p.paper, p.map].into_iter().flatten();
        let near = marks.filter(|m| (low - reach..=high + reach).contains(m));
        let axis = Axis::holding(&p.symbol, &p.unit, scale, near.chain([low, high]), 0.1);
        let support = match (p.prior.first(), p.prior.last()) {
            (Some(first), Some(last)) if first.0 <= low && high <= last.0 && first.0 < last.0 => {
                (first.0, last.0)
            }
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        let bins = |count| Bins { low: axis.low, high: axis.high, count, support };
        // Wider than what fits a normal density best: a wave that chance drew is taken for a shape.
        let bandwidth = 1.4 * density::bandwidth(&p.draws, weight, 1.0);
        Prepared {
            parameter: p,
            bins: bins(BINS),
            pair_bins: bins(PAIR_BINS),
            density: density::marginal(&bins(BINS), &p.draws, weight, bandwidth),
            // Two coordinates need a wider kernel than one.
            pair_bandwidth: density::bandwidth(&p.draws, weight, 2.0) * 1.2,
            quantiles: p.quantiles.unwrap_or_else(|| [0.025, 0.25, 0.5, 0.75, 0.975].map(quantile)),
            axis,
        }
    }

    /// Ends of the prior that the panels show.
    fn ends_of_prior(&self) -> impl Iterator<Item = f64> {
        let (lower, upper) = self.bins.support;
        let (low, high) = (self.axis.low, self.axis.high);
        [lower, upper].into_iter().filter(move |end| (low..=high).contains(end))
    }

    /// Holds the posterior and the prior, which both integrate to one.
    fn density_axis(&self) -> Axis {
        let prior = self.parameter.prior.iter().map(|(_, d)| *d).filter(|d| d.is_finite());
        let highest = self.density.iter().copied().chain(prior).fold(0.0, f64::max);
        Axis::holding("", "", Scale::Linear, [0.0, highest * 1.06], 0.0)
    }
}

fn marginal(page: &Page, panel: &Panel, prepared: &Prepared) -> Drawn {
    let p = prepared.parameter;
    let ink = Role::Posterior.ink();
    let xs: Vec<f64> = (0..prepared.bins.count).map(|i| prepared.bins.centre(i)).collect();
    let [q025, q25, q50, q75, q975] = prepared.quantiles;
    for (low, high, opacity) in [(q025, q975, 0.22), (q25, q75, 0.42)] {
        if let Some((xs, ys)) = between(&xs, &prepared.density, low, high) {
            panel.between(&xs, &vec![0.0; xs.len()], &ys, ink.mix(opacity))?;
        }
    }
    let (prior_x, prior_y): (Vec<f64>, Vec<f64>) = p.prior.iter().copied().unzip();
    panel.line(&prior_x, &prior_y, Role::Prior.pen())?;
    panel.line(&xs, &prepared.density, Pen::solid(ink, 1.0))?;
    prepared.ends_of_prior().try_for_each(|end| panel.upright(end, BOUND))?;
    if let Some((_, height)) = between(&xs, &prepared.density, q50, q50) {
        panel.line(&[q50, q50], &[0.0, height[0]], Pen::solid(ink, 1.0))?;
    }
    if let Some(paper) = p.paper.filter(|paper| paper.is_finite()) {
        if (panel.x.low..=panel.x.high).contains(&paper) {
            panel.upright(paper, Role::Paper.pen())?;
        } else {
            far_away(page, panel, prepared, paper)?;
        }
    }
    if let Some(map) = p.map {
        panel.mark(map, 0.0, map_look())?;
    }
    Ok(())
}

/// An arrow at the edge of a marginal, and the value it points to where there is room for it.
fn far_away(page: &Page, panel: &Panel, prepared: &Prepared, paper: f64) -> Drawn {
    let below = paper < panel.x.low;
    let edge = if below { panel.x.low } else { panel.x.high };
    let height = panel.y.low + 0.9 * (panel.y.high - panel.y.low);
    let marker = if below { Marker::Left } else { Marker::Right };
    panel.mark(edge, height, Look::filled(marker, 2.2, Role::Paper.ink()))?;
    let Some((x, y)) = panel.on_page(edge, height) else { return Ok(()) };
    // The label must end before the density rises to its height.
    let tall = |bin: &usize| prepared.density[*bin] > 0.6 * panel.y.high;
    let mut bins = 0..prepared.bins.count;
    let first = if below { bins.find(tall) } else { bins.rfind(tall) };
    let limit = first.map_or(x, |bin| panel.along(prepared.bins.centre(bin)));
    let (x, anchor) = if below { (x + 4.5, anchor::LEFT) } else { (x - 4.5, anchor::RIGHT) };
    let (left, right) = if below { (x - 0.5, limit - 2.0) } else { (limit + 2.0, x + 0.5) };
    let Some(room) = Rect::from_ltrb(left, panel.top, right, panel.bottom) else { return Ok(()) };
    let value = written(paper, prepared.parameter.log10, 3);
    for label in [&format!("paper {value}"), &value, "paper"] {
        if page.text_where_free(label, SUMMARY_SIZE, (x, y), anchor, &room)? {
            break;
        }
    }
    Ok(())
}

/// Median and 95 % interval above each marginal: above every one, or above none if one does not fit.
fn summaries(page: &Page, diagonal: &[&Panel], gap: f32, prepared: &[Prepared]) -> Drawn {
    let mut texts = Vec::new();
    for (panel, prepared) in diagonal.iter().zip(prepared) {
        let p = prepared.parameter;
        let [low, _, median, _, high] = prepared.quantiles;
        if !(low.is_finite() && median.is_finite() && high.is_finite()) {
            return Ok(());
        }
        // In the unit of the axis, with as many digits as tell the ends of the interval apart.
        let value = |q: f64| if p.log10 { 10_f64.powf(q) } else { q };
        let narrow = (value(median) / (value(high) - value(low))).abs().log10();
        let digits = (2.0 + narrow.floor()).clamp(3.0, 6.0) as usize;
        let (unit, power) = prepared.axis.prefixed_unit(panel.right - panel.left);
        let in_unit = |q: f64| {
            let power = f64::from(power);
            if p.log10 { q - power } else { q * 10_f64.powf(-power) }
        };
        let [low, median, high] = [low, median, high].map(|q| written(in_unit(q), p.log10, digits));
        let unit = if unit.is_empty() { unit } else { format!(" {unit}") };
        // The last one ends with its panel; the others may reach into the empty half.
        let last = texts.len() / 2 + 1 == diagonal.len();
        let to = if last { page.width - 2.0 } else { panel.right + panel.right - panel.left };
        let (from, x, anchor) = if last && diagonal.len() > 1 {
            (panel.left - gap / 2.0, to.min(panel.right + OVERHANG), anchor::BOTTOM_RIGHT)
        } else {
            (panel.left, panel.left, anchor::BOTTOM_LEFT)
        };
        for (line, y) in [
            (format!("{} = {median}{unit}", p.symbol), panel.top - 2.0 - SUMMARY_LINE),
            (format!("{low} … {high}"), panel.top - 2.0),
        ] {
            if length(&line, SUMMARY_SIZE) > to - from {
                return Ok(());
            }
            texts.push((line, (x, y), anchor));
        }
    }
    for (line, at, anchor) in texts {
        page.text(&line, SUMMARY_SIZE, at, anchor)?;
    }
    Ok(())
}

fn map_look() -> Look {
    Look::filled(Marker::Diamond, 2.4, Role::Map.ink()).outlined(Pen::solid(WHITE, 0.4))
}

/// The part of a curve between two abscissae, ends interpolated.
fn between(xs: &[f64], ys: &[f64], low: f64, high: f64) -> Option<(Vec<f64>, Vec<f64>)> {
    let (first, last) = (*xs.first()?, *xs.last()?);
    if low.is_nan() || high < first || low > last {
        return None;
    }
    let (low, high) = (low.max(first), high.min(last));
    let height = |x: f64| {
        let i = xs.partition_point(|v| *v < x).clamp(1, xs.len() - 1);
        let s = (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
        ys[i - 1] + s * (ys[i] - ys[i - 1])
    };
    let mut part = vec![(low, height(low))];
    part.extend(xs.iter().copied().zip(ys.iter().copied()).filter(|(x, _)| low < *x && *x < high));
    part.push((high, height(high)));
    Some(part.into_iter().unzip())
}

fn pair(panel: &Panel, x: &Prepared, y: &Prepared, weight: impl Fn(usize) -> f64) -> Drawn {
    let (px, py) = (x.parameter, y.parameter);
    let ink = Role::Posterior.ink();
    let mass = density::pair(
        (&x.pair_bins, &y.pair_bins),
        (&px.draws, &py.draws),
        weight,
        (x.pair_bandwidth, y.pair_bandwidth),
    );
    let at =
        |bins: &Bins, cell: f64| (bins.centre(0) + cell * bins.width()).clamp(bins.low, bins.high);
    for (share, opacity) in [(0.95, 0.22), (0.5, 0.42)] {
        let level = density::level_holding(&mass, share);
        let kept = density::without_specks(&mass, PAIR_BINS, level, LEAST_PART);
        let outlines = density::contours(&kept, PAIR_BINS, level)
            .into_iter()
            .map(|outline| {
                let place = |(column, row)| (at(&x.pair_bins, column), at(&y.pair_bins, row));
                outline.into_iter().map(place).collect()
            })
            .collect();
        panel.draw(&Region::new(outlines, ink.mix(opacity), Pen::solid(ink, 0.7)))?;
    }
    x.ends_of_prior().try_for_each(|end| panel.upright(end, BOUND))?;
    y.ends_of_prior().try_for_each(|end| panel.across(end, BOUND))?;
    if let Some(paper) = px.paper {
        panel.upright(paper, Role::Paper.pen())?;
    }
    if let Some(paper) = py.paper {
        panel.across(paper, Role::Paper.pen())?;
    }
    if let (Some(map_x), Some(map_y)) = (px.map, py.map) {
        panel.mark(map_x, map_y, map_look())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Width;

    #[test]
    fn the_unit_above_a_marginal_is_that_of_its_axis() {
        for (scale, unit) in [(1e-9, "m"), (1e-3, "s"), (3e4, "Pa")] {
            let draws: Vec<f64> = (0..=200).map(|i| scale * (146.0 + f64::from(i))).collect();
            let parameter = CornerParameter {
                symbol: "q".to_owned(),
                unit: unit.to_owned(),
                draws,
                ..CornerParameter::default()
            };
            let figure = CornerFigure { parameters: vec![parameter; 2], ..CornerFigure::default() };
            let page = Page::new(Width::Full);
            figure.draw(&page).expect("the columns match");
            let texts: Vec<String> = page.canvas().texts.iter().map(|t| t.text.clone()).collect();
            let of_axis = texts
                .iter()
                .find_map(|t| t.strip_prefix("q (")?.strip_suffix(')'))
                .expect("an axis");
            let above = texts.iter().find(|t| t.starts_with("q = ")).expect("a median");
            assert!(above.ends_with(&format!(" {of_axis}")), "{above} over an axis in {of_axis}");
        }
    }

    #[test]
    fn quantiles_that_are_given_stand_before_those_of_the_draws() {
        let draws = (0..=1000).map(f64::from).collect();
        let mut parameter = CornerParameter { draws, ..CornerParameter::default() };
        let of = |parameter: &CornerParameter| Prepared::new(parameter, |_| 1.0).quantiles;
        assert_eq!(of(&parameter), [25.0, 250.0, 500.0, 750.0, 975.0]);
        parameter.quantiles = Some([1.0, 3.0, 4.0, 6.0, 8.0]);
        assert_eq!(of(&parameter), [1.0, 3.0, 4.0, 6.0, 8.0]);
    }
}
