//! Text as outlines of DejaVu Sans; `_{..}` stands below the line, `^{..}` above it.

use std::sync::LazyLock;

use plotters::style::text_anchor::{HPos, Pos, VPos};
use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, OutlineBuilder};

/// Size of a raised or lowered text relative to the line.
const SCRIPT_SIZE: f32 = 0.72;
/// How far `^{..}` is raised, in ems of the line.
const RAISE: f32 = 0.36;
/// How far `_{..}` is lowered, in ems of the line.
const LOWER: f32 = 0.16;
/// Height of a capital, in ems.
pub(crate) const CAP_HEIGHT: f32 = 0.729;

static FACE: LazyLock<Face<'static>> = LazyLock::new(|| {
    Face::parse(dejavu::sans::regular(), 0).expect("the face is part of the program and parses")
});

/// Points of a text that are placed. Vertically a text reaches from its baseline to the top of its capitals.
pub(crate) mod anchor {
    use plotters::style::text_anchor::{HPos, Pos, VPos};

    pub(crate) const LEFT: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Center };
    pub(crate) const RIGHT: Pos = Pos { h_pos: HPos::Right, v_pos: VPos::Center };
    pub(crate) const TOP: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Top };
    pub(crate) const TOP_LEFT: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Top };
    pub(crate) const BOTTOM_LEFT: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Bottom };
    pub(crate) const BOTTOM_RIGHT: Pos = Pos { h_pos: HPos::Right, v_pos: VPos::Bottom };
}

/// Characters of a text with the size and shift of each, in ems.
fn glyphs(text: &str) -> impl Iterator<Item = (char, f32, f32)> + '_ {
    let mut rest = text;
    let mut script: Option<(f32, f32)> = None;
    std::iter::from_fn(move || {
        loop {
            if script.is_some() && rest.starts_with('}') {
                rest = &rest[1..];
                script = None;
                continue;
            }
            let opens = |open| {
                rest.strip_prefix(open)
                    .filter(|after: &&str| script.is_none() && after.contains('}'))
            };
            let (after, shift) = match (opens("_{"), opens("^{")) {
                (Some(after), _) => (after, -LOWER),
                (_, Some(after)) => (after, RAISE),
                (None, None) => break,
            };
            rest = after;
            script = Some((SCRIPT_SIZE, shift));
        }
        let c = rest.chars().next()?;
        rest = &rest[c.len_utf8()..];
        let (size, shift) = script.unwrap_or((1.0, 0.0));
        Some((if c.is_control() { ' ' } else { c }, size, shift))
    })
}

fn advance_em(c: char) -> f32 {
    let glyph = FACE.glyph_index(c).unwrap_or_default();
    f32::from(FACE.glyph_hor_advance(glyph).unwrap_or(0)) / f32::from(FACE.units_per_em())
}

/// Length of a text along its line.
pub(crate) fn length(text: &str, size: f32) -> f32 {
    glyphs(text).map(|(c, scale, _)| advance_em(c) * scale).sum::<f32>() * size
}

/// The text, or the longest start of it that fits into a length with an ellipsis.
pub(crate) fn shortened(text: &str, size: f32, room: f32) -> String {
    if length(text, size) <= room {
        return text.to_owned();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        // A script that would stay open is left out.
        let mut start: String = kept.iter().collect();
        if let Some(open) = start.rfind(['_', '^'])
            && start[open + 1..].starts_with('{')
            && !start[open..].contains('}')
        {
            start.truncate(open);
        }
        let short = format!("{}…", start.trim_end());
        if length(&short, size) <= room {
            return short;
        }
    }
    String::new()
}

/// Outlines of a text; none for a text of blanks. A turned text reads upwards.
pub(crate) fn outline(
    text: &str,
    size: f32,
    at: (f32, f32),
    anchor: Pos,
    turned: bool,
) -> Option<Path> {
    let along = match anchor.h_pos {
        HPos::Left => 0.0,
        HPos::Center => 0.5,
        HPos::Right => 1.0,
    };
    let up = match anchor.v_pos {
        VPos::Bottom => 0.0,
        VPos::Center => 0.5,
        VPos::Top => 1.0,
    };
    let mut pen = Outlines { path: PathBuilder::new(), scale: 1.0, x: 0.0, y: 0.0 };
    let em = f32::from(FACE.units_per_em());
    let mut x = -along * length(text, size);
    let y = up * CAP_HEIGHT * size;
    for (c, scale, shift) in glyphs(text) {
        pen.scale = size * scale / em;
        pen.x = x;
        pen.y = y - shift * size;
        FACE.outline_glyph(FACE.glyph_index(c).unwrap_or_default(), &mut pen);
        x += advance_em(c) * scale * size;
    }
    let path = pen.path.finish()?;
    let turn = if turned {
        Transform::from_row(0.0, -1.0, 1.0, 0.0, at.0, at.1)
    } else {
        Transform::from_translate(at.0, at.1)
    };
    path.transform(turn)
}

struct Outlines {
    path: PathBuilder,
    scale: f32,
    x: f32,
    y: f32,
}

impl Outlines {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, self.y - y * self.scale)
    }
}

impl OutlineBuilder for Outlines {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.move_to(x, y);
    }
    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.line_to(x, y);
    }
    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(x1, y1, x, y);
    }
    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }
    fn close(&mut self) {
        self.path.close();
    }
}
