//! Where plotters draws: a list of fills and strokes, written as PNG and as SVG.
//!
//! plotters counts in whole pixels. A pixel of this backend is a hundredth of a point, far below what is printed, so
//! curves stay smooth, and the picture is rasterised once, from outlines.

use std::convert::Infallible;
use std::fmt::Write as _;

use plotters::prelude::{Color as _, DrawingBackend, FontTransform};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind,
};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Path, PathBuilder, PathSegment, Pixmap, Rect, Stroke, StrokeDash,
    Transform,
};

use super::palette::Pen;
use super::{Picture, PlotError, text};

/// plotters' pixels per point.
const PER_POINT: f32 = 100.0;
/// Points (1/72 inch) per millimetre.
pub(super) const POINTS_PER_MM: f32 = 72.0 / 25.4;
/// Dots per inch of the PNG.
const DOTS_PER_INCH: f32 = 300.0;

/// A length in points as plotters counts it.
pub(super) fn grid(points: f32) -> i32 {
    (points * PER_POINT).round() as i32
}

/// A length of plotters in points.
pub(super) fn points(grid: i32) -> f32 {
    grid as f32 / PER_POINT
}

enum Mark {
    Fill(Path, BackendColor),
    Stroke { path: Path, color: BackendColor, width: u32, dash: &'static [f32] },
    Text(Path, BackendColor, String),
}

/// A text as it was drawn, with the bounds of its outlines in points.
#[derive(Debug, Clone)]
pub(super) struct TextBox {
    #[cfg_attr(
        not(test),
        expect(dead_code, reason = "tests hold texts apart by their bounds and name the culprit")
    )]
    pub(super) text: String,
    pub(super) bounds: Rect,
}

/// Pixels below all marks of the PNG; the SVG does not have them.
pub(super) struct Backdrop {
    rgb: Vec<u8>,
    across: usize,
}

impl Backdrop {
    /// Averages `samples` by `samples` colours (from 0 to 1, row by row) for each of the pixels.
    pub(super) fn averaged(
        colours: &[[f32; 3]],
        across: usize,
        down: usize,
        samples: usize,
    ) -> Backdrop {
        let mut rgb = Vec::with_capacity(3 * across * down);
        for row in 0..down {
            for column in 0..across {
                for part in 0..3 {
                    let mut sum = 0.0;
                    for y in 0..samples {
                        let from = (row * samples + y) * across * samples + column * samples;
                        sum += colours[from..from + samples].iter().map(|c| c[part]).sum::<f32>();
                    }
                    let mean = sum / (samples * samples) as f32;
                    rgb.push((255.0 * mean).round() as u8);
                }
            }
        }
        Backdrop { rgb, across }
    }
}

/// A picture under construction, in hundredths of a point. The origin is the upper left corner, y points down.
pub(super) struct Canvas {
    /// Width and height that plotters may draw on; the picture is cut to what is used.
    size: (u32, u32),
    marks: Vec<Mark>,
    pub(super) texts: Vec<TextBox>,
    /// With the pixels from the left and from the top at which it begins.
    backdrop: Option<((usize, usize), Backdrop)>,
}

/// A length in points as pixels of the PNG.
fn pixels(points: f32) -> usize {
    (points * DOTS_PER_INCH / 72.0).round() as usize
}

impl Canvas {
    /// An empty picture of a size in points.
    pub(super) fn new(width: f32, height: f32) -> Canvas {
        let size = (grid(width) as u32, grid(height) as u32);
        Canvas { size, marks: Vec::new(), texts: Vec::new(), backdrop: None }
    }

    /// Width and height in points.
    pub(super) fn size_in_points(&self) -> (f32, f32) {
        (points(self.size.0 as i32), points(self.size.1 as i32))
    }

    /// Leaves out what lies below a height in points.
    pub(super) fn cut(&mut self, height: f32) {
        self.size.1 = grid(height) as u32;
    }

    /// Puts pixels under the marks, in a rectangle given in points; `draw` gets its size in pixels.
    pub(super) fn set_backdrop(
        &mut self,
        (left, top): (f32, f32),
        (width, height): (f32, f32),
        draw: impl FnOnce(usize, usize) -> Backdrop,
    ) {
        let backdrop = draw(pixels(width).max(1), pixels(height).max(1));
        self.backdrop = Some(((pixels(left), pixels(top)), backdrop));
    }

    pub(super) fn fill(&mut self, path: Option<Path>, color: BackendColor) {
        self.marks.extend(path.map(|path| Mark::Fill(path, color)));
    }

    /// plotters' styles know no dashes; a pen does.
    pub(super) fn stroke(&mut self, path: Option<Path>, pen: &Pen) {
        let (color, width) = (pen.ink.to_backend_color(), pen.style().stroke_width);
        self.marks.extend(path.map(|path| Mark::Stroke { path, color, width, dash: pen.dash }));
    }

    /// Writes both formats.
    pub(super) fn picture(&self) -> Result<Picture, PlotError> {
        Ok(Picture { png: self.png()?, svg: self.svg() })
    }

    fn png(&self) -> Result<Vec<u8>, PlotError> {
        let scale = DOTS_PER_INCH / 72.0 / PER_POINT;
        let [width, height] =
            [self.size.0, self.size.1].map(|length| (length as f32 * scale).round() as u32);
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PlotError::Encode(format!("no memory for {width} x {height} pixels")))?;
        pixmap.fill(tiny_skia::Color::WHITE);
        if let Some(((left, top), Backdrop { rgb, across })) = &self.backdrop {
            let wide = width as usize;
            for (row, colours) in rgb.chunks_exact(3 * across).enumerate() {
                let from = 4 * ((top + row) * wide + left);
                let to = pixmap.data_mut().get_mut(from..).unwrap_or_default();
                let room = across.min(&wide.saturating_sub(*left)).to_owned();
                for (pixel, colour) in
                    to.chunks_exact_mut(4).zip(colours.chunks_exact(3)).take(room)
                {
                    pixel[..3].copy_from_slice(colour);
                }
            }
        }
        let scale = Transform::from_scale(scale, scale);
        for mark in &self.marks {
            match mark {
                Mark::Fill(path, color) | Mark::Text(path, color, _) => {
                    pixmap.fill_path(path, &paint(*color), FillRule::Winding, scale, None);
                }
                Mark::Stroke { path, color, width, dash } => {
                    let dash = dash.iter().map(|length| length * PER_POINT).collect();
                    let stroke = Stroke {
                        width: *width as f32,
                        line_cap: LineCap::Butt,
                        line_join: LineJoin::Round,
                        dash: StrokeDash::new(dash, 0.0),
                        ..Stroke::default()
                    };
                    pixmap.stroke_path(path, &paint(*color), &stroke, scale, None);
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
        let dots_per_metre = (DOTS_PER_INCH / 0.0254).round() as u32;
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
        let (width, height) = self.size_in_points();
        let _ = write!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.2}mm\" height=\"{:.2}mm\" \
             viewBox=\"0 0 {} {}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
            width / POINTS_PER_MM,
            height / POINTS_PER_MM,
            self.size.0,
            self.size.1
        );
        for mark in &self.marks {
            let (Mark::Fill(path, color)
            | Mark::Stroke { path, color, .. }
            | Mark::Text(path, color, _)) = mark;
            svg.push_str("<path d=\"");
            push_path(&mut svg, path);
            svg.push('"');
            let (r, g, b) = color.rgb;
            let (fill, stroke) = (format_args!("#{r:02x}{g:02x}{b:02x}"), "stroke-");
            let opacity = |svg: &mut String, of: &str| {
                if color.alpha < 1.0 {
                    let _ = write!(svg, " {of}opacity=\"{:.2}\"", color.alpha);
                }
            };
            match mark {
                Mark::Fill(..) => {
                    let _ = write!(svg, " fill=\"{fill}\"");
                    opacity(&mut svg, "fill-");
                }
                Mark::Text(_, _, text) => {
                    let _ = write!(svg, " fill=\"{fill}\" aria-label=\"");
                    push_escaped(&mut svg, text);
                    svg.push('"');
                }
                Mark::Stroke { width, dash, .. } => {
                    let _ = write!(
                        svg,
                        " fill=\"none\" stroke=\"{fill}\" stroke-width=\"{width}\" stroke-linejoin=\"round\""
                    );
                    opacity(&mut svg, stroke);
                    if !dash.is_empty() {
                        let dash: Vec<String> =
                            dash.iter().map(|length| grid(*length).to_string()).collect();
                        let _ = write!(svg, " stroke-dasharray=\"{}\"", dash.join(" "));
                    }
                }
            }
            svg.push_str("/>\n");
        }
        svg.push_str("</svg>\n");
        svg
    }
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

impl DrawingBackend for Canvas {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.draw_path([from, to], style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        if fill {
            self.fill_polygon(corners, style)
        } else {
            self.draw_path(corners.into_iter().chain([(left, top)]), style)
        }
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        let mut outline = PathBuilder::new();
        push_corners(&mut outline, path);
        self.marks.extend(outline.finish().map(|path| Mark::Stroke {
            path,
            color: style.color(),
            width: style.stroke_width(),
            dash: &[],
        }));
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let path = PathBuilder::from_circle(x as f32, y as f32, radius as f32);
        self.marks.extend(path.map(|path| match fill {
            true => Mark::Fill(path, style.color()),
            false => {
                Mark::Stroke { path, color: style.color(), width: style.stroke_width(), dash: &[] }
            }
        }));
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> Drawn {
        let mut outline = PathBuilder::new();
        push_corners(&mut outline, corners);
        outline.close();
        self.fill(outline.finish(), style.color());
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Drawn {
        let turned = matches!(style.transform(), FontTransform::Rotate270);
        let size = style.size() as f32;
        if let Some(path) = text::outline(text, size, (x as f32, y as f32), style.anchor(), turned)
        {
            let bounds = path.bounds();
            let [left, top, right, bottom] =
                [bounds.left(), bounds.top(), bounds.right(), bounds.bottom()]
                    .map(|at| at / PER_POINT);
            if let Some(bounds) = Rect::from_ltrb(left, top, right, bottom) {
                self.texts.push(TextBox { text: text.to_owned(), bounds });
            }
            self.marks.push(Mark::Text(path, style.color(), text.to_owned()));
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = style.size() as f32;
        Ok((text::length(text, size).ceil() as u32, size.ceil() as u32))
    }
}

/// Appends a line through points of plotters.
pub(super) fn push_corners(
    outline: &mut PathBuilder,
    corners: impl IntoIterator<Item = BackendCoord>,
) {
    for (i, (x, y)) in corners.into_iter().enumerate() {
        let (x, y) = (x as f32, y as f32);
        if i == 0 { outline.move_to(x, y) } else { outline.line_to(x, y) }
    }
}

fn paint(color: BackendColor) -> tiny_skia::Paint<'static> {
    let (r, g, b) = color.rgb;
    let mut paint = tiny_skia::Paint { anti_alias: true, ..Default::default() };
    paint.set_color_rgba8(r, g, b, (color.alpha * 255.0).round() as u8);
    paint
}

/// Appends path data, rounded to the grid (0.004 mm).
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
        push_whole(svg, p.x);
        svg.push(' ');
        push_whole(svg, p.y);
    }
}

/// Appends a whole number; formatting is what an SVG costs, and this is four times as fast as `write!`.
fn push_whole(svg: &mut String, value: f32) {
    let value = value.round() as i32;
    if value < 0 {
        svg.push('-');
    }
    let mut digits = [0_u8; 10];
    let mut at = digits.len();
    let mut left = value.unsigned_abs();
    loop {
        at -= 1;
        digits[at] = b'0' + (left % 10) as u8;
        left /= 10;
        if left == 0 {
            break;
        }
    }
    svg.extend(digits[at..].iter().map(|&d| char::from(d)));
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
