//! A picture as a list of fills and strokes in points, written as PNG and as SVG.

use std::fmt::Write as _;

use tiny_skia::{
    FillRule, LineCap, LineJoin, Path, PathSegment, Pixmap, Rect, Stroke, StrokeDash, Transform,
};

use super::text::{self, Anchor};
use super::{Picture, PlotError, Width};

/// Points (1/72 inch) per millimetre.
const POINTS_PER_MM: f32 = 72.0 / 25.4;
/// Pixels per point at 300 dots per inch.
const PIXELS_PER_POINT: f32 = 300.0 / 72.0;

impl Width {
    /// Width in points.
    pub(super) fn points(self) -> f32 {
        match self {
            Width::Column => 85.0 * POINTS_PER_MM,
            Width::Full => 170.0 * POINTS_PER_MM,
        }
    }
}

/// Colour and opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ink {
    pub(super) rgb: [u8; 3],
    pub(super) opacity: f32,
}

impl Ink {
    pub(super) const BLACK: Ink = Ink::of(0x1a1a1a);
    pub(super) const WHITE: Ink = Ink::of(0xffffff);
    pub(super) const GREY: Ink = Ink::of(0x8c8c8c);

    /// An opaque colour from 0xRRGGBB.
    pub(super) const fn of(rgb: u32) -> Ink {
        let [_, r, g, b] = rgb.to_be_bytes();
        Ink { rgb: [r, g, b], opacity: 1.0 }
    }

    pub(super) const fn with_opacity(self, opacity: f32) -> Ink {
        Ink { rgb: self.rgb, opacity }
    }

    fn paint(self) -> tiny_skia::Paint<'static> {
        let [r, g, b] = self.rgb;
        let mut paint = tiny_skia::Paint { anti_alias: true, ..Default::default() };
        paint.set_color_rgba8(r, g, b, (self.opacity * 255.0).round() as u8);
        paint
    }
}

/// A pen: colour, width in points and dash pattern in points (empty: solid).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pen {
    pub(super) ink: Ink,
    pub(super) width: f32,
    pub(super) dash: &'static [f32],
}

impl Pen {
    pub(super) const fn solid(ink: Ink, width: f32) -> Pen {
        Pen { ink, width, dash: &[] }
    }

    pub(super) const fn dashed(ink: Ink, width: f32, dash: &'static [f32]) -> Pen {
        Pen { ink, width, dash }
    }
}

enum Mark {
    Fill(Path, Ink),
    Stroke(Path, Pen),
    Text(Path, Ink, String),
}

/// A text as it was drawn, with the bounds of its outlines.
#[derive(Debug, Clone)]
pub(super) struct TextBox {
    #[cfg_attr(
        not(test),
        expect(dead_code, reason = "tests hold texts apart by their bounds and name the culprit")
    )]
    pub(super) text: String,
    pub(super) bounds: Rect,
}

/// A picture under construction. The origin is the upper left corner, y points down.
pub(super) struct Drawing {
    pub(super) width: f32,
    pub(super) height: f32,
    marks: Vec<Mark>,
    pub(super) texts: Vec<TextBox>,
}

impl Drawing {
    /// An empty picture; its height is set when its panels have been laid out.
    pub(super) fn new(width: Width) -> Drawing {
        Drawing { width: width.points(), height: 10.0, marks: Vec::new(), texts: Vec::new() }
    }

    pub(super) fn fill(&mut self, path: Option<Path>, ink: Ink) {
        if let Some(path) = path {
            self.marks.push(Mark::Fill(path, ink));
        }
    }

    pub(super) fn stroke(&mut self, path: Option<Path>, pen: Pen) {
        if let Some(path) = path {
            self.marks.push(Mark::Stroke(path, pen));
        }
    }

    pub(super) fn segment(&mut self, from: (f32, f32), to: (f32, f32), pen: Pen) {
        let mut path = tiny_skia::PathBuilder::new();
        path.move_to(from.0, from.1);
        path.line_to(to.0, to.1);
        self.stroke(path.finish(), pen);
    }

    /// Draws a text with its anchor at a point.
    pub(super) fn text(&mut self, text: &str, size: f32, at: (f32, f32), anchor: Anchor, ink: Ink) {
        if let Some(path) = text::outline(text, size, at, anchor) {
            self.texts.push(TextBox { text: text.to_owned(), bounds: path.bounds() });
            self.marks.push(Mark::Text(path, ink, text.to_owned()));
        }
    }

    /// Writes both formats.
    pub(super) fn finish(&self) -> Result<Picture, PlotError> {
        Ok(Picture { png: self.png()?, svg: self.svg() })
    }

    fn png(&self) -> Result<Vec<u8>, PlotError> {
        let (width, height) = (
            (self.width * PIXELS_PER_POINT).round() as u32,
            (self.height * PIXELS_PER_POINT).round() as u32,
        );
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PlotError::Encode(format!("no memory for {width} x {height} pixels")))?;
        pixmap.fill(tiny_skia::Color::WHITE);
        let scale = Transform::from_scale(PIXELS_PER_POINT, PIXELS_PER_POINT);
        for mark in &self.marks {
            match mark {
                Mark::Fill(path, ink) | Mark::Text(path, ink, _) => {
                    pixmap.fill_path(path, &ink.paint(), FillRule::Winding, scale, None);
                }
                Mark::Stroke(path, pen) => {
                    let stroke = Stroke {
                        width: pen.width,
                        line_cap: LineCap::Butt,
                        line_join: LineJoin::Round,
                        dash: StrokeDash::new(pen.dash.to_vec(), 0.0),
                        ..Stroke::default()
                    };
                    pixmap.stroke_path(path, &pen.ink.paint(), &stroke, scale, None);
                }
            }
        }
        // Every pixel is opaque, so dropping alpha loses nothing.
        let rgb: Vec<u8> = pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mut bytes = Vec::with_capacity(rgb.len() / 16);
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        // Flat areas compress best when a row is compared with the one above.
        encoder.set_filter(png::Filter::Up);
        let dots_per_metre = (300.0 / 0.0254_f64).round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions {
            xppu: dots_per_metre,
            yppu: dots_per_metre,
            unit: png::Unit::Meter,
        }));
        let encode = |e: png::EncodingError| PlotError::Encode(e.to_string());
        let mut writer = encoder.write_header().map_err(encode)?;
        writer.write_image_data(&rgb).map_err(encode)?;
        writer.finish().map_err(encode)?;
        Ok(bytes)
    }

    pub(super) fn svg(&self) -> String {
        let mut svg = String::with_capacity(64 * 1024);
        let (width_mm, height_mm) = (self.width / POINTS_PER_MM, self.height / POINTS_PER_MM);
        let _ = write!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width_mm:.2}mm\" height=\"{height_mm:.2}mm\" \
             viewBox=\"0 0 {:.2} {:.2}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
            self.width, self.height
        );
        for mark in &self.marks {
            let (path, ink) = match mark {
                Mark::Fill(path, ink) | Mark::Text(path, ink, _) => (path, *ink),
                Mark::Stroke(path, pen) => (path, pen.ink),
            };
            svg.push_str("<path d=\"");
            push_path(&mut svg, path);
            let [r, g, b] = ink.rgb;
            match mark {
                Mark::Fill(..) | Mark::Text(..) => {
                    let _ = write!(svg, "\" fill=\"#{r:02x}{g:02x}{b:02x}\"");
                    if ink.opacity < 1.0 {
                        let _ = write!(svg, " fill-opacity=\"{:.2}\"", ink.opacity);
                    }
                }
                Mark::Stroke(_, pen) => {
                    let _ = write!(
                        svg,
                        "\" fill=\"none\" stroke=\"#{r:02x}{g:02x}{b:02x}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
                        pen.width
                    );
                    if ink.opacity < 1.0 {
                        let _ = write!(svg, " stroke-opacity=\"{:.2}\"", ink.opacity);
                    }
                    if !pen.dash.is_empty() {
                        let dash: Vec<String> = pen.dash.iter().map(f32::to_string).collect();
                        let _ = write!(svg, " stroke-dasharray=\"{}\"", dash.join(" "));
                    }
                }
            }
            if let Mark::Text(_, _, text) = mark {
                svg.push_str(" aria-label=\"");
                push_escaped(&mut svg, text);
                svg.push('"');
            }
            svg.push_str("/>\n");
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// Appends path data with two decimals (0.004 mm).
fn push_path(svg: &mut String, path: &Path) {
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(p) => push_command(svg, 'M', &[p]),
            PathSegment::LineTo(p) => push_command(svg, 'L', &[p]),
            PathSegment::QuadTo(a, p) => push_command(svg, 'Q', &[a, p]),
            PathSegment::CubicTo(a, b, p) => push_command(svg, 'C', &[a, b, p]),
            PathSegment::Close => svg.push('Z'),
        }
    }
}

fn push_command(svg: &mut String, command: char, points: &[tiny_skia::Point]) {
    svg.push(command);
    for (i, p) in points.iter().enumerate() {
        if i > 0 {
            svg.push(' ');
        }
        push_hundredths(svg, p.x);
        svg.push(' ');
        push_hundredths(svg, p.y);
    }
}

/// Appends a coordinate; formatting floats is what an SVG costs, so it is done on integers.
fn push_hundredths(svg: &mut String, value: f32) {
    let hundredths = (value * 100.0).round() as i32;
    if hundredths < 0 {
        svg.push('-');
    }
    let (whole, rest) = (hundredths.unsigned_abs() / 100, hundredths.unsigned_abs() % 100);
    let mut digits = [0_u8; 10];
    let mut at = digits.len();
    let mut left = whole;
    loop {
        at -= 1;
        digits[at] = b'0' + (left % 10) as u8;
        left /= 10;
        if left == 0 {
            break;
        }
    }
    svg.extend(digits[at..].iter().map(|&d| char::from(d)));
    if rest > 0 {
        svg.push('.');
        svg.push(char::from(b'0' + (rest / 10) as u8));
        if rest % 10 > 0 {
            svg.push(char::from(b'0' + (rest % 10) as u8));
        }
    }
}

fn push_escaped(svg: &mut String, text: &str) {
    for c in text.chars() {
        match c {
            '&' => svg.push_str("&amp;"),
            '<' => svg.push_str("&lt;"),
            '>' => svg.push_str("&gt;"),
            '"' => svg.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => svg.push(' '),
            c => svg.push(c),
        }
    }
}
