//! The corner plot: marginal densities on the diagonal, densities of the pairs below it.
use plotters::style::Color as _;
use tiny_skia::Rect;

use super::axis::{Axis, Scale};
use super::density::{self, Bins};
use super::elements::{Look, Region};
use super::header::{Swatch, header};
use super::layout::{OVERHANG, Spec, layout};
use super::page::Page;
use super::palette::{Marker, Pen, WHITE};
use super::panel::Panel;
use super::text::{self, anchor};
use super::{Columns, PlotError, Role};

/// One parameter of a [`CornerFigure`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CornerParameter {
    /// Symbol, for example `C_{1}`.
    pub symbol: String,
    /// Unit, for example `Pa^{-1} s^{-1}`; empty for a pure number.
    pub unit: String,
    /// True if the draws are log10 of the parameter: ticks are then labelled with the parameter itself.
    pub log10: bool,
    /// Draws in the coordinate of the axis (log10 of the parameter where `log10`).
    pub draws: Vec<f64>,
    /// Prior density as (coordinate, density per unit of the coordinate), increasing in the coordinate; empty for none.
    pub prior: Vec<(f64, f64)>,
    /// The paper's value, in the coordinate.
    pub paper: Option<f64>,
    /// The maximum a posteriori, in the coordinate.
    pub map: Option<f64>,
}

/// Posterior of up to five parameters: marginals with 50 % and 95 % intervals, pairs with 50 % and 90 % regions.
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
/// Size of the numbers above the marginals, and their distance from line to line.
const SUMMARY_SIZE: f32 = 6.0;
const SUMMARY_LINE: f32 = 8.0;

/// What the panels of one parameter share.
struct Prepared {
    axis: Axis,
    bins: Bins,
    pair_bins: Bins,
    density: Vec<f64>,
    bandwidth: f64,
    /// 2.5, 25, 50, 75 and 97.5 %.
    quantiles: [f64; 5],
}

impl CornerFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("corner");
        columns.at_most("parameters", self.parameters.len(), MOST_PARAMETERS)?;
        let n = self.parameters.first().map_or(0, |p| p.draws.len());
        for p in &self.parameters {
            columns.need(&format!("draws of {}", p.symbol), &p.draws, n, "draw")?;
        }
        columns.allow("weights", &self.weights, n, "draw")?;
        let weight = |i: usize| {
            self.weights.get(i).map_or(1.0, |w| if w.is_finite() { w.max(0.0) } else { 0.0 })
        };

        let ink = Role::Posterior.ink();
        let mut entries = vec![("50 % of the posterior".to_owned(), Swatch::Band(ink.mix(0.55)))];
        if self.parameters.len() > 1 {
            entries.push(("95 % (90 % in pairs)".to_owned(), Swatch::Band(ink.mix(0.22))));
        } else {
            entries.push(("95 %".to_owned(), Swatch::Band(ink.mix(0.22))));
        }
        if self.parameters.iter().any(|p| !p.prior.is_empty()) {
            entries.push(("prior".to_owned(), Swatch::Line(Role::Prior.pen())));
        }
        if self.parameters.iter().any(|p| p.map.is_some()) {
            entries.push(("MAP".to_owned(), Swatch::Point(map_look())));
        }
        if self.parameters.iter().any(|p| p.paper.is_some()) {
            entries.push(("paper".to_owned(), Swatch::Line(Role::Paper.pen())));
        }
        let top = header(page, &self.title, &entries)?;

        let prepared: Vec<Prepared> = self.parameters.iter().map(|p| prepare(p, weight)).collect();
        let count = prepared.len();
        let gap = if count > 3 { 7.0 } else { 10.0 };
        let panel = ((page.width - 50.0 - gap * count.saturating_sub(1) as f32)
            / count.max(1) as f32)
            .min(page.of_width(130.0, 180.0));
        let summarised = panel > 45.0;
        let rows: Vec<(f32, Vec<Option<Spec>>)> = (0..count)
            .map(|row| {
                let cells = (0..count)
                    .map(|column| {
                        let x = prepared[column].axis.clone();
                        let bottom = row + 1 == count;
                        match column.cmp(&row) {
                            std::cmp::Ordering::Less => {
                                let y = prepared[row].axis.clone();
                                Some(Spec::new(x, y).x_labels(bottom).y_labels(column == 0))
                            }
                            std::cmp::Ordering::Equal => {
                                let p = &self.parameters[column];
                                let prior =
                                    p.prior.iter().map(|(_, d)| *d).filter(|d| d.is_finite());
                                let highest =
                                    prepared[column].density.iter().copied().fold(0.0, f64::max);
                                // A prior far above the posterior's height cannot be: both integrate to one.
                                let tallest = prior.fold(highest, f64::max);
                                let y = Axis::holding(
                                    "",
                                    "",
                                    Scale::Linear,
                                    [0.0, tallest * 1.06],
                                    0.0,
                                );
                                Some(Spec::new(x, y).x_labels(bottom).bare())
                            }
                            std::cmp::Ordering::Greater => None,
                        }
                    })
                    .collect();
                (panel, cells)
            })
            .collect();
        let panels =
            layout(page, top + if summarised { 2.0 * SUMMARY_LINE } else { 0.0 }, gap, &rows)?;
        for (row, cells) in panels.iter().enumerate() {
            for (column, panel) in cells.iter().enumerate() {
                let Some(panel) = panel else { continue };
                if row == column {
                    marginal(page, panel, &prepared[row], &self.parameters[row])?;
                } else {
                    let parameters = (&self.parameters[column], &self.parameters[row]);
                    pair(panel, (&prepared[column], &prepared[row]), parameters, weight)?;
                }
            }
        }
        if !summarised {
            return Ok(());
        }
        let diagonal: Vec<&Panel> =
            panels.iter().enumerate().filter_map(|(row, cells)| cells[row].as_ref()).collect();
        summaries(page, &diagonal, gap, &prepared, &self.parameters)
    }
}

fn prepare(p: &CornerParameter, weight: impl Fn(usize) -> f64 + Copy) -> Prepared {
    let scale = if p.log10 { Scale::Exponent } else { Scale::Linear };
    let mut sorted: Vec<(f64, f64)> = p
        .draws
        .iter()
        .enumerate()
        .map(|(i, &x)| (x, weight(i)))
        .filter(|(x, w)| x.abs() <= 1e300 && *w > 0.0)
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let quantiles = [0.025, 0.25, 0.5, 0.75, 0.975].map(|q| density::quantile_sorted(&sorted, q));
    let (low, high) =
        (density::quantile_sorted(&sorted, 0.001), density::quantile_sorted(&sorted, 0.999));
    let mut values = vec![low, high];
    // A mark far away would squeeze the posterior into nothing; then it is left out of the range and not drawn.
    let reach = 1.5 * (high - low);
    let marks = [p.paper, p.map];
    values.extend(marks.into_iter().flatten().filter(|m| (low - reach..=high + reach).contains(m)));
    let axis = Axis::holding(&p.symbol, &p.unit, scale, values, 0.06);
    let support = match (p.prior.first(), p.prior.last()) {
        (Some(first), Some(last)) if first.0 <= low && high <= last.0 && first.0 < last.0 => {
            (first.0, last.0)
        }
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    let bins = |count| Bins { low: axis.low, high: axis.high, count, support };
    let bandwidth = density::bandwidth(&p.draws, weight, 1.0);
    let density = density::marginal(&bins(BINS), &p.draws, weight, bandwidth);
    Prepared { bins: bins(BINS), pair_bins: bins(PAIR_BINS), density, bandwidth, quantiles, axis }
}

fn marginal(
    page: &Page,
    panel: &Panel,
    prepared: &Prepared,
    p: &CornerParameter,
) -> Result<(), PlotError> {
    let ink = Role::Posterior.ink();
    let xs: Vec<f64> = (0..prepared.bins.count).map(|i| prepared.bins.centre(i)).collect();
    let [q025, q25, q50, q75, q975] = prepared.quantiles;
    for (low, high, opacity) in [(q025, q975, 0.22), (q25, q75, 0.42)] {
        if let Some((xs, ys)) = between(&xs, &prepared.density, low, high) {
            panel.band(&xs, &vec![0.0; xs.len()], &ys, ink.mix(opacity))?;
        }
    }
    let (prior_x, prior_y): (Vec<f64>, Vec<f64>) = p.prior.iter().copied().unzip();
    panel.line(&prior_x, &prior_y, Role::Prior.pen())?;
    panel.line(&xs, &prepared.density, Pen::solid(ink, 1.0))?;
    if let Some((_, height)) = between(&xs, &prepared.density, q50, q50) {
        panel.line(&[q50, q50], &[0.0, height[0]], Pen::solid(ink, 1.0))?;
    }
    if let Some(paper) = p.paper.filter(|paper| paper.is_finite()) {
        if (panel.x.low..=panel.x.high).contains(&paper) {
            panel.upright(paper, Role::Paper.pen())?;
        } else {
            far_away(page, panel, prepared, paper, p.log10)?;
        }
    }
    if let Some(map) = p.map {
        panel.markers(&[map], &[0.0], map_look())?;
    }
    Ok(())
}

/// An arrow at the edge of a marginal, and the value it points to where there is room for it.
fn far_away(
    page: &Page,
    panel: &Panel,
    prepared: &Prepared,
    paper: f64,
    log10: bool,
) -> Result<(), PlotError> {
    let below = paper < panel.x.low;
    let edge = if below { panel.x.low } else { panel.x.high };
    let height = panel.y.low + 0.9 * (panel.y.high - panel.y.low);
    let marker = if below { Marker::Left } else { Marker::Right };
    panel.markers(&[edge], &[height], Look::filled(marker, 2.2, Role::Paper.ink()))?;
    let Some((x, y)) = panel.on_page(edge, height) else { return Ok(()) };
    // The label must end before the density rises to its height.
    let tall = |bin: &usize| prepared.density[*bin] > 0.6 * panel.y.high;
    let mut bins = 0..prepared.bins.count;
    let first = if below { bins.find(tall) } else { bins.rfind(tall) };
    let limit = first.map_or(x, |bin| panel.along(prepared.bins.centre(bin)));
    let (x, anchor) = if below { (x + 4.5, anchor::LEFT) } else { (x - 4.5, anchor::RIGHT) };
    let (left, right) = if below { (x - 0.5, limit - 2.0) } else { (limit + 2.0, x + 0.5) };
    let Some(room) = Rect::from_ltrb(left, panel.top, right, panel.bottom) else { return Ok(()) };
    let value = written(paper, log10, 3);
    for label in [&format!("paper {value}"), &value, "paper"] {
        if page.text_where_free(label, SUMMARY_SIZE, (x, y), anchor, &room)? {
            break;
        }
    }
    Ok(())
}

/// Median and 95 % interval above each marginal: above every one, or above none if one does not fit.
fn summaries(
    page: &Page,
    diagonal: &[&Panel],
    gap: f32,
    prepared: &[Prepared],
    parameters: &[CornerParameter],
) -> Result<(), PlotError> {
    let mut texts = Vec::new();
    for ((panel, prepared), p) in diagonal.iter().zip(prepared).zip(parameters) {
        let [low, _, median, _, high] = prepared.quantiles;
        if !(low.is_finite() && median.is_finite() && high.is_finite()) {
            return Ok(());
        }
        // As many digits as tell the ends of the interval apart.
        let value = |q: f64| if p.log10 { 10_f64.powf(q) } else { q };
        let narrow = (value(median) / (value(high) - value(low))).abs().log10();
        let digits = (2.0 + narrow.floor()).clamp(3.0, 6.0) as usize;
        let [low, median, high] = [low, median, high].map(|q| written(q, p.log10, digits));
        let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
        // The last one ends with its panel; the others may reach into the empty half.
        let last = texts.len() / 2 + 1 == diagonal.len();
        let (x, from) = if last && diagonal.len() > 1 {
            (panel.right, panel.left - gap / 2.0)
        } else {
            (panel.left, panel.left)
        };
        let to = if last { page.width - 2.0 } else { panel.right + panel.right - panel.left };
        let anchors = if last && diagonal.len() > 1 {
            (anchor::BOTTOM_RIGHT, to.min(panel.right + OVERHANG))
        } else {
            (anchor::BOTTOM_LEFT, x)
        };
        for (line, y) in [
            (format!("{} = {median}{unit}", p.symbol), panel.top - 2.0 - SUMMARY_LINE),
            (format!("{low} … {high}"), panel.top - 2.0),
        ] {
            if text::length(&line, SUMMARY_SIZE) > to - from {
                return Ok(());
            }
            texts.push((line, (anchors.1, y), anchors.0));
        }
    }
    for (line, at, anchor) in texts {
        page.text(&line, SUMMARY_SIZE, at, anchor)?;
    }
    Ok(())
}

/// A value of a coordinate to so many digits, or to one less and a power of ten where it is large or small.
fn written(coordinate: f64, log10: bool, digits: usize) -> String {
    let (mut mantissa, mut exponent) = if log10 {
        (10_f64.powf(coordinate - coordinate.floor()), coordinate.floor())
    } else {
        let exponent = coordinate.abs().max(1e-300).log10().floor();
        (coordinate / 10_f64.powf(exponent), exponent)
    };
    // What rounds up to ten is one of the next power.
    let scale = 10_f64.powi(digits as i32 - 1);
    if (mantissa * scale).round().abs() >= 10.0 * scale {
        mantissa /= 10.0;
        exponent += 1.0;
    }
    if mantissa == 0.0 {
        return "0".to_owned();
    }
    let text = if (-2.0..3.0).contains(&exponent) {
        format!(
            "{:.*}",
            (digits as f64 - 1.0 - exponent) as usize,
            mantissa * 10_f64.powf(exponent)
        )
    } else {
        format!("{mantissa:.*}×10^{{{exponent}}}", digits.saturating_sub(2))
    };
    text.replace('-', "−")
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

fn pair(
    panel: &Panel,
    (x, y): (&Prepared, &Prepared),
    (px, py): (&CornerParameter, &CornerParameter),
    weight: impl Fn(usize) -> f64 + Copy,
) -> Result<(), PlotError> {
    let ink = Role::Posterior.ink();
    // Two coordinates need a wider kernel than one, and correlated ones a narrower: the rule of one is kept.
    let mass = density::pair(
        (&x.pair_bins, &y.pair_bins),
        (&px.draws, &py.draws),
        weight,
        (x.bandwidth * 1.2, y.bandwidth * 1.2),
    );
    let at =
        |bins: &Bins, cell: f64| (bins.centre(0) + cell * bins.width()).clamp(bins.low, bins.high);
    for (share, opacity) in [(0.9, 0.22), (0.5, 0.42)] {
        let level = density::level_holding(&mass, share);
        let outlines = density::contours(&mass, PAIR_BINS, level)
            .into_iter()
            .map(|outline| {
                let place = |(column, row)| (at(&x.pair_bins, column), at(&y.pair_bins, row));
                outline.into_iter().map(place).collect()
            })
            .collect();
        panel.draw(&Region::new(outlines, ink.mix(opacity), Pen::solid(ink, 0.7)))?;
    }
    if let Some(paper) = px.paper {
        panel.upright(paper, Role::Paper.pen())?;
    }
    if let Some(paper) = py.paper {
        panel.across(paper, Role::Paper.pen())?;
    }
    if let (Some(map_x), Some(map_y)) = (px.map, py.map) {
        panel.markers(&[map_x], &[map_y], map_look())?;
    }
    Ok(())
}
