//! Elements that plotters does not have: dashed lines, many points as one shape, regions with holes.

use plotters::element::{Drawable, PointCollection};
use plotters::prelude::Color;
use plotters::style::RGBAColor;
use plotters_backend::BackendCoord;
use tiny_skia::PathBuilder;

use super::canvas::{Canvas, Marked, push_corners};
use super::length::grid;
use super::palette::{Marker, Pen};

/// A line through points, with the dashes of its pen.
pub(crate) struct Line<C> {
    pub(crate) points: Vec<C>,
    pub(crate) pen: Pen,
}

/// Points of one look. They are one shape, so that they get no darker where they overlap.
pub(crate) struct Points<C> {
    pub(crate) at: Vec<C>,
    pub(crate) look: Look,
}

/// Shape, radius in points, fill and outline of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Look {
    pub(crate) marker: Marker,
    pub(crate) radius: f32,
    pub(crate) fill: RGBAColor,
    pub(crate) outline: Option<Pen>,
    /// Whether it is a measurement, which nothing may cover.
    pub(crate) measured: bool,
}

/// A region within closed outlines; outlines that wind the other way are holes.
pub(crate) struct Region<C> {
    corners: Vec<C>,
    /// Corners of each outline.
    counts: Vec<usize>,
    fill: RGBAColor,
    edge: Pen,
}

impl Look {
    /// Filled, without outline.
    pub(crate) fn filled(marker: Marker, radius: f32, fill: RGBAColor) -> Look {
        Look { marker, radius, fill, outline: None, measured: false }
    }

    /// Filled, with an outline around.
    pub(crate) fn outlined(self, outline: Pen) -> Look {
        Look { outline: Some(outline), ..self }
    }
}

impl<C> Region<C> {
    pub(crate) fn new(outlines: Vec<Vec<C>>, fill: RGBAColor, edge: Pen) -> Region<C> {
        let counts = outlines.iter().map(Vec::len).collect();
        Region { corners: outlines.into_iter().flatten().collect(), counts, fill, edge }
    }
}

macro_rules! points_of {
    ($element:ident, $field:ident) => {
        impl<'a, C: 'a> PointCollection<'a, C> for &'a $element<C> {
            type Point = &'a C;
            type IntoIter = &'a [C];
            fn point_iter(self) -> &'a [C] {
                &self.$field
            }
        }
    };
}

points_of!(Line, points);
points_of!(Points, at);
points_of!(Region, corners);

impl<C> Drawable<Canvas> for Line<C> {
    fn draw<I: Iterator<Item = BackendCoord>>(
        &self,
        points: I,
        canvas: &mut Canvas,
        _: (u32, u32),
    ) -> Marked {
        let mut path = PathBuilder::new();
        push_corners(&mut path, points);
        canvas.traces.curves.push(canvas.marks.len());
        canvas.stroke(path.finish(), &self.pen);
        Ok(())
    }
}

impl<C> Drawable<Canvas> for Points<C> {
    fn draw<I: Iterator<Item = BackendCoord>>(
        &self,
        points: I,
        canvas: &mut Canvas,
        _: (u32, u32),
    ) -> Marked {
        let mut path = PathBuilder::new();
        let radius = grid(self.look.radius) as f32;
        for (x, y) in points {
            self.look.marker.push(&mut path, (x as f32, y as f32), radius);
        }
        let path = path.finish();
        let mark = canvas.marks.len();
        canvas.traces.points.push(mark);
        if self.look.measured {
            canvas.traces.measured.push(mark);
        }
        canvas.fill(path.clone(), self.look.fill.to_backend_color());
        if let Some(pen) = &self.look.outline {
            canvas.stroke(path, pen);
        }
        Ok(())
    }
}

impl<C> Drawable<Canvas> for Region<C> {
    fn draw<I: Iterator<Item = BackendCoord>>(
        &self,
        mut corners: I,
        canvas: &mut Canvas,
        _: (u32, u32),
    ) -> Marked {
        let mut path = PathBuilder::new();
        for &count in &self.counts {
            push_corners(&mut path, corners.by_ref().take(count));
            path.close();
        }
        let path = path.finish();
        canvas.fill(path.clone(), self.fill.to_backend_color());
        canvas.stroke(path, &self.edge);
        Ok(())
    }
}

impl Marker {
    /// Appends the marker's outline.
    fn push(self, path: &mut PathBuilder, (x, y): (f32, f32), radius: f32) {
        let corners: &[(f32, f32)] = match self {
            Marker::Circle => return path.push_circle(x, y, radius),
            Marker::Dot => {
                &[(-0.5, -0.87), (0.5, -0.87), (1.0, 0.0), (0.5, 0.87), (-0.5, 0.87), (-1.0, 0.0)]
            }
            Marker::Square => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
            Marker::Triangle => &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
            Marker::Down => &[(0.0, 1.2), (-1.1, -0.8), (1.1, -0.8)],
            Marker::Left => &[(-1.2, 0.0), (0.8, -1.1), (0.8, 1.1)],
            Marker::Right => &[(1.2, 0.0), (-0.8, -1.1), (-0.8, 1.1)],
            Marker::Diamond => &[(0.0, -1.35), (1.1, 0.0), (0.0, 1.35), (-1.1, 0.0)],
            Marker::Cross => &[
                (-0.35, -1.2),
                (0.35, -1.2),
                (0.35, -0.35),
                (1.2, -0.35),
                (1.2, 0.35),
                (0.35, 0.35),
                (0.35, 1.2),
                (-0.35, 1.2),
                (-0.35, 0.35),
                (-1.2, 0.35),
                (-1.2, -0.35),
                (-0.35, -0.35),
            ],
        };
        for (i, (dx, dy)) in corners.iter().enumerate() {
            let (x, y) = (x + dx * radius, y + dy * radius);
            if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        path.close();
    }
}
