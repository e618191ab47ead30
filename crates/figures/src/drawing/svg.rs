//! The canvas as an SVG document.

use std::fmt::Write as _;

use tiny_skia::{Path, PathSegment};

use super::canvas::{Canvas, Mark};
use super::length::{POINTS_PER_MM, grid};

impl Canvas {
    pub(crate) fn svg(&self) -> String {
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
            push_mark(&mut svg, mark);
        }
        svg.push_str("</svg>\n");
        svg
    }
}

fn push_mark(svg: &mut String, mark: &Mark) {
    let (Mark::Fill(path, color) | Mark::Stroke { path, color, .. } | Mark::Text(path, color, _)) =
        mark;
    svg.push_str("<path d=\"");
    push_path(svg, path);
    svg.push('"');
    let (r, g, b) = color.rgb;
    let ink = format_args!("#{r:02x}{g:02x}{b:02x}");
    let opacity = |svg: &mut String, of: &str| {
        if color.alpha < 1.0 {
            let _ = write!(svg, " {of}-opacity=\"{:.2}\"", color.alpha);
        }
    };
    match mark {
        Mark::Fill(..) => {
            let _ = write!(svg, " fill=\"{ink}\"");
            opacity(svg, "fill");
        }
        Mark::Text(_, _, text) => {
            let _ = write!(svg, " fill=\"{ink}\" aria-label=\"");
            push_escaped(svg, text);
            svg.push('"');
        }
        Mark::Stroke { width, dash, .. } => {
            let _ = write!(
                svg,
                " fill=\"none\" stroke=\"{ink}\" stroke-width=\"{width}\" stroke-linejoin=\"round\""
            );
            opacity(svg, "stroke");
            if !dash.is_empty() {
                let dash: Vec<String> =
                    dash.iter().map(|length| grid(*length).to_string()).collect();
                let _ = write!(svg, " stroke-dasharray=\"{}\"", dash.join(" "));
            }
        }
    }
    svg.push_str("/>\n");
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
        let _ = write!(svg, "{} {}", p.x.round() as i32, p.y.round() as i32);
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
