//! Figure of the ranks: their empirical distribution function minus the uniform one, a panel per quantity, with the band.

use std::fmt::Write as _;

use super::ranks::Ranks;

/// Size of a panel and of the space around it \[pt\].
const PANEL: [f64; 2] = [140.0, 90.0];
const GAP: [f64; 2] = [34.0, 34.0];
const COLUMNS: usize = 3;

/// The figure as SVG.
pub(super) fn svg(ranks: &Ranks) -> String {
    let n = ranks.data_sets as f64;
    let off = |k: usize, count: usize| count as f64 / n - (k + 1) as f64 / 100.0;
    let reach = ranks
        .band
        .iter()
        .enumerate()
        .flat_map(|(k, (low, high))| [off(k, *low), off(k, *high)])
        .chain(ranks.ranked.iter().flat_map(|r| {
            r.counts.iter().enumerate().map(|(k, c)| off(k, *c)).collect::<Vec<f64>>()
        }))
        .fold(0.0, |most: f64, v| most.max(v.abs()))
        * 1.1;
    let rows = ranks.ranked.len().div_ceil(COLUMNS);
    let width = GAP[0] + COLUMNS as f64 * (PANEL[0] + GAP[0]);
    let height = GAP[1] + rows as f64 * (PANEL[1] + GAP[1]);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"DejaVu Sans, sans-serif\" font-size=\"7.5\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"14\">{}</text>\n",
        GAP[0], ranks.title
    );
    for (place, ranked) in ranks.ranked.iter().enumerate() {
        let left = GAP[0] + (place % COLUMNS) as f64 * (PANEL[0] + GAP[0]);
        let top = GAP[1] + (place / COLUMNS) as f64 * (PANEL[1] + GAP[1]);
        let x = |k: usize| left + PANEL[0] * (k + 1) as f64 / 100.0;
        let y = |v: f64| top + 0.5 * PANEL[1] * (1.0 - v / reach);
        let points = |values: Vec<(usize, f64)>| {
            values.iter().fold(String::new(), |mut text, (k, v)| {
                let _ = write!(text, "{:.2},{:.2} ", x(*k), y(*v));
                text
            })
        };
        let lower: Vec<_> = ranks.band.iter().enumerate().map(|(k, b)| (k, off(k, b.0))).collect();
        let upper =
            ranks.band.iter().enumerate().rev().map(|(k, b)| (k, off(k, b.1))).collect::<Vec<_>>();
        let line = ranked.counts.iter().enumerate().map(|(k, c)| (k, off(k, *c))).collect();
        let _ = write!(
            text,
            "<polygon points=\"{}\" fill=\"#d9e6f2\"/>\n\
             <line x1=\"{left}\" y1=\"{zero:.2}\" x2=\"{right}\" y2=\"{zero:.2}\" stroke=\"#888\" stroke-width=\"0.5\"/>\n\
             <polyline points=\"{}\" fill=\"none\" stroke=\"#0b5394\" stroke-width=\"1\"/>\n\
             <rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"black\" stroke-width=\"0.6\"/>\n\
             <text x=\"{left}\" y=\"{:.2}\">{} (p = {:.2})</text>\n\
             <text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{reach:.3}</text>\n\
             <text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">-{reach:.3}</text>\n\
             <text x=\"{left}\" y=\"{low:.2}\">0</text>\n\
             <text x=\"{right}\" y=\"{low:.2}\" text-anchor=\"end\">1</text>\n",
            points([lower, upper].concat()),
            points(line),
            PANEL[0],
            PANEL[1],
            top - 4.0,
            ranked.name,
            ranked.p_value,
            left - 3.0,
            top + 6.0,
            left - 3.0,
            top + PANEL[1],
            zero = y(0.0),
            right = left + PANEL[0],
            low = top + PANEL[1] + 9.0,
        );
    }
    text + "</svg>\n"
}
