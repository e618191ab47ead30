//! A panel: plotters' Cartesian coordinates over a rectangle of the page, and what is drawn into it.
//!
//! Values become coordinates of the axes (decimal logarithms where these are logarithmic), and plotters maps coordinates
//! to whole numbers on the page. It moves points outside the panel onto its edge, so curves are cut there first.

use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingArea;
use plotters::element::{Drawable, PointCollection, Polygon};
use plotters::style::{Color as _, RGBAColor};
use tiny_skia::Rect;

use super::axis::Axis;
use super::canvas::Canvas;
use super::elements::{Line, Look, Points};
use super::length::{grid, points};
use super::page::{At, Page};
use super::palette::{Marker, Pen, Role, WHITE};
use crate::columns::Band;
use crate::error::Drawn;

/// Up to so many measurements get a marker with an outline each.
const FEW: usize = 120;

/// A place in the coordinates of both axes.
pub(crate) type Place = (f64, f64);

/// A rectangle on the page with its axes; edges in points.
pub(crate) struct Panel {
    pub(crate) left: f32,
    pub(crate) top: f32,
    pub(crate) right: f32,
    pub(crate) bottom: f32,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    area: DrawingArea<Canvas, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
}

impl Panel {
    pub(crate) fn new(
        page: &Page,
        (left, top): At,
        (width, height): (f32, f32),
        x: &Axis,
        y: &Axis,
    ) -> Panel {
        let area = page.area.clone().shrink((grid(left), grid(top)), (grid(width), grid(height)));
        let (across, down) = area.get_pixel_range();
        let coordinates =
            Cartesian2d::new(x.low..x.high, y.low..y.high, (across, down.end..down.start));
        Panel {
            left,
            top,
            right: left + width,
            bottom: top + height,
            x: x.clone(),
            y: y.clone(),
            area: area.apply_coord_spec(coordinates),
        }
    }

    /// Draws an element in the coordinates of the axes.
    pub(crate) fn draw<E>(&self, element: &E) -> Drawn
    where
        for<'a> &'a E: PointCollection<'a, Place>,
        E: Drawable<Canvas>,
    {
        Ok(self.area.draw(element)?)
    }

    /// Where a coordinate of the horizontal axis lies on the page.
    pub(crate) fn along(&self, coordinate: f64) -> f32 {
        points(self.area.map_coordinate(&(coordinate, self.y.low)).0)
    }

    /// Where a coordinate of the vertical axis lies on the page.
    pub(crate) fn up(&self, coordinate: f64) -> f32 {
        points(self.area.map_coordinate(&(self.x.low, coordinate)).1)
    }

    /// Where a point that lies within the panel is on the page.
    pub(crate) fn on_page(&self, x: f64, y: f64) -> Option<At> {
        let (x, y) = self.place(x, y).filter(|&at| self.holds(at))?;
        Some((self.along(x), self.up(y)))
    }

    /// The rectangle on the page, less a margin.
    pub(crate) fn inner(&self, by: f32) -> Option<Rect> {
        Rect::from_ltrb(self.left + by, self.top + by, self.right - by, self.bottom - by)
    }

    /// Coordinates of a point, if it has any; they may lie outside the panel.
    fn place(&self, x: f64, y: f64) -> Option<Place> {
        Some((self.x.near(x)?, self.y.near(y)?))
    }

    fn holds(&self, (x, y): Place) -> bool {
        self.x.holds(x) && self.y.holds(y)
    }

    /// A curve through the points, broken where one is missing and cut off at the edges.
    pub(crate) fn line(&self, xs: &[f64], ys: &[f64], pen: Pen) -> Drawn {
        let mut piece: Vec<Place> = Vec::new();
        let mut last: Option<Place> = None;
        for (&x, &y) in xs.iter().zip(ys) {
            let here = self.place(x, y);
            if let (Some(from), Some(to)) = (last, here)
                && let Some((a, b)) = self.cut(from, to)
            {
                if piece.last() != Some(&a) {
                    self.draw(&Line { points: std::mem::take(&mut piece), pen })?;
                    piece.push(a);
                }
                piece.push(b);
            }
            last = here;
        }
        self.draw(&Line { points: piece, pen })
    }

    /// The part of a segment inside the panel (Liang and Barsky).
    fn cut(&self, from: Place, to: Place) -> Option<(Place, Place)> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for (towards, room) in [
            (-dx, from.0 - self.x.low),
            (dx, self.x.high - from.0),
            (-dy, from.1 - self.y.low),
            (dy, self.y.high - from.1),
        ] {
            if towards == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if towards < 0.0 {
                enter = enter.max(room / towards);
            } else {
                leave = leave.min(room / towards);
            }
        }
        if enter > leave {
            return None;
        }
        let point = |s: f64| {
            // Ends stay exactly where they are, so that the next segment joins.
            if s <= 0.0 {
                from
            } else if s >= 1.0 {
                to
            } else {
                (from.0 + s * dx, from.1 + s * dy)
            }
        };
        Some((point(enter), point(leave)))
    }

    /// A band, cut off at the edges; a lone point between gaps becomes a bar.
    pub(crate) fn band(&self, xs: &[f64], band: &Band, ink: RGBAColor) -> Drawn {
        self.between(xs, &band.lower, &band.upper, ink)
    }

    /// As [`Panel::band`], for the area between two curves.
    pub(crate) fn between(
        &self,
        xs: &[f64],
        lower: &[f64],
        upper: &[f64],
        ink: RGBAColor,
    ) -> Drawn {
        // A bound with no place on a logarithmic axis lies below it.
        let bound = |v: f64| self.y.near(v).or((v <= 0.0).then_some(self.y.low));
        let mut run: Vec<(f64, f64, f64)> = Vec::new();
        for ((&x, &low), &high) in xs.iter().zip(lower).zip(upper) {
            match (self.x.near(x).filter(|&x| self.x.holds(x)), bound(low), bound(high)) {
                (Some(x), Some(low), Some(high)) => run.push((x, low, high)),
                _ => self.filled(std::mem::take(&mut run), ink)?,
            }
        }
        self.filled(run, ink)
    }

    /// Fills the area within points (x, lower, upper).
    fn filled(&self, mut run: Vec<(f64, f64, f64)>, ink: RGBAColor) -> Drawn {
        if let [(x, low, high)] = run[..] {
            let half = 1.5 * (self.x.high - self.x.low) / f64::from(self.right - self.left);
            run = vec![(x - half, low, high), (x + half, low, high)];
        }
        let below = run.iter().map(|&(x, low, _)| (x, low));
        let above = run.iter().rev().map(|&(x, _, high)| (x, high));
        let corners: Vec<Place> =
            below.chain(above).map(|(x, y)| (self.x.within(x), self.y.within(y))).collect();
        self.draw(&Polygon::new(corners, ink.filled()))
    }

    /// Points that lie within the panel.
    pub(crate) fn markers(&self, xs: &[f64], ys: &[f64], look: Look) -> Drawn {
        let places = xs.iter().zip(ys).filter_map(|(&x, &y)| self.place(x, y));
        self.draw(&Points { at: places.filter(|&at| self.holds(at)).collect(), look })
    }

    /// A single point, if it lies within the panel.
    pub(crate) fn mark(&self, x: f64, y: f64, look: Look) -> Drawn {
        self.markers(&[x], &[y], look)
    }

    /// Whether so many measurements are drawn small, and below the curves rather than above.
    pub(crate) fn dense(xs: &[f64]) -> bool {
        Self::crowded(xs.len())
    }

    /// The same of their number.
    pub(crate) fn crowded(measurements: usize) -> bool {
        measurements > FEW
    }

    /// Measurements: open circles, smaller and without outline where there are many.
    pub(crate) fn data(&self, xs: &[f64], ys: &[f64]) -> Drawn {
        let ink = Role::Data.ink();
        let look = if !Panel::dense(xs) {
            Look::filled(Marker::Circle, 1.7, WHITE.mix(0.85)).outlined(Pen::solid(ink, 0.65))
        } else if xs.len() <= 600 {
            Look::filled(Marker::Circle, 1.0, ink.mix(0.6))
        } else {
            Look::filled(Marker::Dot, 0.6, ink.mix(0.45))
        };
        self.markers(xs, ys, Look { measured: true, ..look })
    }

    /// Vertical bars with the given ends.
    pub(crate) fn bars(&self, xs: &[f64], lower: &[f64], upper: &[f64], pen: Pen) -> Drawn {
        for ((&x, &low), &high) in xs.iter().zip(lower).zip(upper) {
            self.line(&[x, x], &[low, high], pen)?;
        }
        Ok(())
    }

    /// An upright interval: a bar with a stroke at its lower end, its middle and its upper end.
    pub(crate) fn interval(&self, x: f64, heights: [f64; 3], pen: Pen) -> Drawn {
        let [lower, _, upper] = heights;
        self.line(&[x, x], &[lower, upper], pen)?;
        for (y, half) in heights.into_iter().zip([1.6, 2.6, 1.6]) {
            let Some((x, y)) = self.place(x, y).filter(|&at| self.holds(at)) else { continue };
            let half = half * (self.x.high - self.x.low) / f64::from(self.right - self.left);
            let ends = [x - half, x + half].map(|x| (self.x.within(x), y));
            self.draw(&Line { points: ends.to_vec(), pen })?;
        }
        Ok(())
    }

    /// A line across the whole panel at a value.
    pub(crate) fn across(&self, y: f64, pen: Pen) -> Drawn {
        let Some(y) = self.y.coordinate(y).filter(|&y| self.y.holds(y)) else { return Ok(()) };
        self.draw(&Line { points: vec![(self.x.low, y), (self.x.high, y)], pen })
    }

    /// A line up the whole panel at a value.
    pub(crate) fn upright(&self, x: f64, pen: Pen) -> Drawn {
        let Some(x) = self.x.coordinate(x).filter(|&x| self.x.holds(x)) else { return Ok(()) };
        self.draw(&Line { points: vec![(x, self.y.low), (x, self.y.high)], pen })
    }
}
