//! Pages, panels, axes, legends and marks: what all figures are drawn with.

mod axis;
mod backdrop;
mod canvas;
mod elements;
mod header;
mod layout;
mod length;
mod numbers;
mod page;
mod palette;
mod panel;
mod png;
mod svg;
mod text;
mod ticks;

pub(crate) use page::Page;
pub use palette::Role;

pub(crate) use axis::{Axis, Scale};
pub(crate) use canvas::{Canvas, Mark};
pub(crate) use elements::{Look, Region};
pub(crate) use header::{Swatch, header};
pub(crate) use layout::{OVERHANG, Row, Spec, TITLE_SIZE, grid_of, layout, one_panel, row};
pub(crate) use numbers::written;
pub(crate) use palette::{BLACK, GREY, Marker, Pen, WHITE, opaque};
pub(crate) use panel::Panel;
#[cfg(test)]
pub(crate) use text::shortened;
pub(crate) use text::{anchor, length};
#[cfg(test)]
pub(crate) use ticks::{Direction, TICK_SIZE, Ticks};
