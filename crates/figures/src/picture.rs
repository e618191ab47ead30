//! Output formats of a figure.

/// One figure as the bytes of a PNG and of an SVG file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// PNG file: 8-bit RGB, 300 dots per inch at the chosen width.
    pub png: Vec<u8>,
    /// SVG document; all text is outlines.
    pub svg: String,
}

/// Width of the printed picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// One column of a two-column page, 85 mm.
    Column,
    /// The full width of a page, 170 mm.
    Full,
}
