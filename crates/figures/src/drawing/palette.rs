//! One colour, dash and marker per role, the same in every figure.
//!
//! The colours of the roles are those of Okabe and Ito with the luminance spread, the colours of the series those of Tol:
//! colour-blind readers can tell both apart. Colours that lie close in greyscale differ in dash or marker.

use plotters::style::{Color as _, RGBAColor, ShapeStyle};

use super::length::grid;

pub(crate) const BLACK: RGBAColor = opaque(0x1a1a1a);
pub(crate) const WHITE: RGBAColor = opaque(0xffffff);
pub(crate) const GREY: RGBAColor = opaque(0x8c8c8c);

/// An opaque colour from 0xRRGGBB.
pub(crate) const fn opaque(rgb: u32) -> RGBAColor {
    let [_, r, g, b] = rgb.to_be_bytes();
    RGBAColor(r, g, b, 1.0)
}

/// A pen: colour, width in points and dash pattern in points (empty: solid).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pen {
    pub(crate) ink: RGBAColor,
    pub(crate) width: f32,
    pub(crate) dash: &'static [f32],
}

impl Pen {
    pub(crate) const fn solid(ink: RGBAColor, width: f32) -> Pen {
        Pen { ink, width, dash: &[] }
    }

    pub(crate) const fn dashed(ink: RGBAColor, width: f32, dash: &'static [f32]) -> Pen {
        Pen { ink, width, dash }
    }

    /// Colour and width for plotters, which knows no dashes.
    pub(crate) fn style(&self) -> ShapeStyle {
        self.ink.stroke_width(grid(self.width).unsigned_abs())
    }
}

/// Meaning of a curve or a point, which decides its colour, dash and marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// Measurements.
    Data,
    /// The posterior: bands, densities, means.
    Posterior,
    /// The maximum a posteriori.
    Map,
    /// The value or curve of the paper.
    Paper,
    /// The best curve of Frenkel's model, with one parameter.
    Frenkel,
    /// The prior.
    Prior,
    /// The n-th of several named models, samplers or solvers; looks repeat after 8.
    Series(usize),
}

/// Shape of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Marker {
    Circle,
    /// A circle too small to tell from a hexagon, in a quarter of the bytes.
    Dot,
    Square,
    Triangle,
    Diamond,
    Cross,
    Down,
    Left,
    Right,
}

const SERIES: [u32; 8] =
    [0x332288, 0xe69f00, 0x56b4e9, 0x882255, 0x999933, 0x44aa99, 0x661100, 0x777777];
const DASHES: [&[f32]; 8] = [
    &[],
    &[5.0, 1.8],
    &[1.6, 1.4],
    &[6.0, 1.6, 1.4, 1.6],
    &[9.0, 2.0],
    &[3.0, 1.2],
    &[6.0, 1.4, 1.2, 1.4, 1.2, 1.4],
    &[1.0, 2.4],
];
const MARKERS: [Marker; 6] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::Down,
    Marker::Cross,
];

impl Role {
    pub(crate) fn ink(self) -> RGBAColor {
        match self {
            Role::Data => BLACK,
            Role::Posterior => opaque(0x0072b2),
            Role::Map => opaque(0xd55e00),
            Role::Paper => opaque(0x00543f),
            Role::Frenkel => opaque(0xcc79a7),
            Role::Prior => GREY,
            Role::Series(n) => opaque(SERIES[n % SERIES.len()]),
        }
    }

    /// Pen of a curve.
    pub(crate) fn pen(self) -> Pen {
        match self {
            Role::Data => Pen::solid(self.ink(), 0.8),
            Role::Posterior => Pen::solid(self.ink(), 1.3),
            Role::Map => Pen::dashed(self.ink(), 1.1, &[3.0, 1.5]),
            Role::Paper => Pen::dashed(self.ink(), 1.0, &[6.0, 1.6, 1.2, 1.6]),
            Role::Frenkel => Pen::dashed(self.ink(), 1.1, &[7.0, 3.0]),
            Role::Prior => Pen::dashed(self.ink(), 0.8, &[1.2, 1.4]),
            Role::Series(n) => Pen::dashed(self.ink(), 1.1, DASHES[n % DASHES.len()]),
        }
    }

    pub(crate) fn marker(self) -> Marker {
        match self {
            Role::Data | Role::Posterior | Role::Prior => Marker::Circle,
            Role::Map | Role::Paper => Marker::Diamond,
            Role::Frenkel => Marker::Triangle,
            Role::Series(n) => MARKERS[n % MARKERS.len()],
        }
    }
}
