//! What every figure keeps to, checked on the elements that were drawn.

use tiny_skia::{Path, PathSegment, Rect};

use crate::drawing::{Canvas, Mark, Page, Panel};
use crate::error::PlotError;
use crate::figure::Figure;
use crate::picture::Width;

/// Hundredths of a point, in which paths are.
const PER_POINT: f32 = 100.0;
/// How far a curve may reach into a measurement: half the outline of its marker.
const RIM: f32 = 0.3;
/// Axes, zero lines and outlines: black, grey and white.
const PLAIN: [(u8, u8, u8); 3] = [(0x1a, 0x1a, 0x1a), (0x8c, 0x8c, 0x8c), (0xff, 0xff, 0xff)];

/// Where a figure breaks a rule, in words: texts that overlap, labels on data, marks over measurements that can be told apart, curves and points
/// whose colour is not in the legend. Nothing where it keeps them all.
///
/// # Errors
///
/// Those of [`Figure::render`].
pub fn broken_rules(figure: &dyn Figure, width: Width) -> Result<Vec<String>, PlotError> {
    let page = Page::new(width);
    figure.draw(&page)?;
    let canvas = page.canvas();
    Ok(broken(&canvas))
}

fn broken(canvas: &Canvas) -> Vec<String> {
    let mut broken = Vec::new();
    for (place, one) in canvas.texts.iter().enumerate() {
        for other in &canvas.texts[..place] {
            if one.bounds.intersect(&other.bounds).is_some() {
                broken.push(format!("the texts `{}` and `{}` overlap", one.text, other.text));
            }
        }
    }
    let labels = covered_texts(canvas).into_iter();
    broken.extend(labels.map(|text| format!("`{text}` covers data, or data cover it")));
    match covered_measurements(canvas) {
        0 => {}
        covered => broken.push(format!("{covered} measurements are drawn over")),
    }
    let unknown = strange_colours(canvas).into_iter();
    broken.extend(unknown.map(|(r, g, b)| format!("#{r:02x}{g:02x}{b:02x} is not in the legend")));
    broken
}

fn path(mark: &Mark) -> &Path {
    match mark {
        Mark::Fill(path, _) | Mark::Text(path, ..) | Mark::Stroke { path, .. } => path,
    }
}

/// Straight pieces of a path in points, each outline on its own.
fn outlines(path: &Path) -> Vec<Vec<(f32, f32)>> {
    let mut all: Vec<Vec<(f32, f32)>> = Vec::new();
    for segment in path.segments() {
        let to = match segment {
            PathSegment::MoveTo(to) => {
                all.push(Vec::new());
                to
            }
            PathSegment::LineTo(to)
            | PathSegment::QuadTo(_, to)
            | PathSegment::CubicTo(_, _, to) => to,
            PathSegment::Close => continue,
        };
        if let Some(outline) = all.last_mut() {
            outline.push((to.x / PER_POINT, to.y / PER_POINT));
        }
    }
    all
}

/// Whether a segment has a point within a rectangle.
fn crosses(rect: &Rect, (x0, y0): (f32, f32), (x1, y1): (f32, f32)) -> bool {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
    for (towards, room) in [
        (-dx, x0 - rect.left()),
        (dx, rect.right() - x0),
        (-dy, y0 - rect.top()),
        (dy, rect.bottom() - y0),
    ] {
        if towards == 0.0 {
            if room < 0.0 {
                return false;
            }
        } else if towards < 0.0 {
            enter = enter.max(room / towards);
        } else {
            leave = leave.min(room / towards);
        }
    }
    enter <= leave
}

/// Bounds of each outline of a mark.
fn boxes(mark: &Mark) -> Vec<Rect> {
    let bounds = |outline: &Vec<(f32, f32)>| {
        let mut of = (f32::MAX, f32::MAX, f32::MIN, f32::MIN);
        for (x, y) in outline {
            of = (of.0.min(*x), of.1.min(*y), of.2.max(*x), of.3.max(*y));
        }
        Rect::from_ltrb(of.0, of.1, of.2, of.3)
    };
    outlines(path(mark)).iter().filter_map(bounds).collect()
}

/// Whether a curve passes through a rectangle.
fn passes(mark: &Mark, rect: &Rect) -> bool {
    outlines(path(mark))
        .iter()
        .any(|outline| outline.windows(2).any(|ends| crosses(rect, ends[0], ends[1])))
}

fn shrunk(rect: &Rect, by: f32) -> Option<Rect> {
    Rect::from_ltrb(rect.left() + by, rect.top() + by, rect.right() - by, rect.bottom() - by)
}

/// Texts that a curve or a point touches.
fn covered_texts(canvas: &Canvas) -> Vec<String> {
    let touched = |rect: &Rect| {
        let through = |mark: &usize| passes(&canvas.marks[*mark], rect);
        let on = |mark: &usize| {
            boxes(&canvas.marks[*mark]).iter().any(|of| of.intersect(rect).is_some())
        };
        canvas.traces.curves.iter().any(through) || canvas.traces.points.iter().any(on)
    };
    let texts = canvas.texts.iter().filter(|text| touched(&text.bounds));
    texts.map(|text| text.text.clone()).collect()
}

/// Measurements over which a curve or a point was drawn later.
fn covered_measurements(canvas: &Canvas) -> usize {
    let of = &canvas.traces;
    let later = |first: usize, marks: &[usize]| -> Vec<usize> {
        marks.iter().copied().filter(|m| *m > first && !of.measured.contains(m)).collect()
    };
    let covered = |mark: &usize| {
        let (curves, points) = (later(*mark, &of.curves), later(*mark, &of.points));
        let hidden = |place: &Rect| {
            curves.iter().any(|m| passes(&canvas.marks[*m], place))
                || points
                    .iter()
                    .flat_map(|m| boxes(&canvas.marks[*m]))
                    .any(|b| b.intersect(place).is_some())
        };
        boxes(&canvas.marks[*mark]).iter().filter_map(|b| shrunk(b, RIM)).filter(hidden).count()
    };
    // So many that they are drawn small lie below the curves.
    let apart = |mark: &&usize| !Panel::crowded(boxes(&canvas.marks[**mark]).len());
    of.measured.iter().filter(apart).map(covered).sum()
}

/// Colours of curves and points that the legend has not.
fn strange_colours(canvas: &Canvas) -> Vec<(u8, u8, u8)> {
    let colour = |mark: usize| match &canvas.marks[mark] {
        Mark::Fill(_, color) | Mark::Stroke { color, .. } | Mark::Text(_, color, _) => color.rgb,
    };
    let of = &canvas.traces;
    let known: Vec<_> = of.legend.clone().map(colour).collect();
    let drawn = of.curves.iter().chain(&of.points).filter(|mark| **mark >= of.legend.end);
    let mut strange: Vec<_> = drawn
        .map(|mark| colour(*mark))
        .filter(|own| !known.contains(own) && !PLAIN.contains(own))
        .collect();
    strange.sort_unstable();
    strange.dedup();
    strange
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::{Axis, Pen, Role, Scale, Swatch, anchor, header};
    use crate::synthetic;

    #[test]
    fn every_figure_keeps_the_rules() {
        for (n, end_s) in [(2, 3e-12), (5, 0.13), (44, 6.1), (300, 82.0)] {
            for (name, figure) in synthetic::figures(n, end_s, false) {
                for width in [Width::Column, Width::Full] {
                    let broken = broken_rules(figure.as_ref(), width).expect("columns match");
                    assert!(broken.is_empty(), "{name} with {n}, {width:?}: {broken:?}");
                }
            }
        }
    }

    #[test]
    fn a_label_on_a_curve_a_curve_on_a_measurement_and_a_stranger_to_the_legend_are_found() {
        let page = Page::new(Width::Column);
        let (known, strange) = (Role::Map.pen(), Role::Paper.pen());
        header(&page, "", &[("known", Swatch::Line(known))]).expect("drawn");
        let axis = Axis::holding("q", "", Scale::Linear, [0.0, 1.0], 0.0);
        let panel = Panel::new(&page, (10.0, 40.0), (100.0, 100.0), &axis, &axis);
        panel.line(&[0.0, 1.0], &[0.5, 0.5], known).expect("drawn");
        panel.data(&[0.2, 0.5, 0.8], &[0.5, 0.5, 0.9]).expect("drawn");
        assert_eq!(broken(&page.canvas()), Vec::<String>::new());
        panel.line(&[0.5, 0.5], &[0.0, 1.0], Pen { width: 0.5, ..known }).expect("drawn");
        assert_eq!(broken(&page.canvas()), ["1 measurements are drawn over"]);
        page.text("label", 7.0, (20.0, 90.0), anchor::LEFT).expect("drawn");
        panel.line(&[0.0, 1.0], &[0.1, 0.1], strange).expect("drawn");
        let all = broken(&page.canvas());
        assert_eq!(all[0], "`label` covers data, or data cover it");
        assert_eq!(all[2], "#00543f is not in the legend");
        page.text("other", 7.0, (22.0, 91.0), anchor::LEFT).expect("drawn");
        assert_eq!(broken(&page.canvas())[0], "the texts `other` and `label` overlap");
    }
}
