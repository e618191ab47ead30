//! The canvas as a PNG file.

use plotters_backend::BackendColor;
use tiny_skia::{FillRule, LineCap, LineJoin, Pixmap, Stroke, StrokeDash, Transform};

use super::canvas::{Canvas, Mark};
use super::length::PER_POINT;
use crate::error::PlotError;

const DOTS_PER_INCH: f32 = 300.0;

/// A length in points as pixels.
pub(super) fn pixels(points: f32) -> usize {
    (points * DOTS_PER_INCH / 72.0).round() as usize
}

impl Canvas {
    pub(super) fn png(&self) -> Result<Vec<u8>, PlotError> {
        let scale = DOTS_PER_INCH / 72.0 / PER_POINT;
        let [width, height] =
            [self.size.0, self.size.1].map(|length| (length as f32 * scale).round() as u32);
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PlotError::Encode(format!("no memory for {width} x {height} pixels")))?;
        pixmap.fill(tiny_skia::Color::WHITE);
        if let Some(backdrop) = &self.backdrop {
            backdrop.copy_to(pixmap.data_mut(), width as usize);
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
        encoded(&pixmap).map_err(|error| PlotError::Encode(error.to_string()))
    }
}

fn paint(color: BackendColor) -> tiny_skia::Paint<'static> {
    let (r, g, b) = color.rgb;
    let mut paint = tiny_skia::Paint { anti_alias: true, ..Default::default() };
    paint.set_color_rgba8(r, g, b, (color.alpha * 255.0).round() as u8);
    paint
}

fn encoded(pixmap: &Pixmap) -> Result<Vec<u8>, png::EncodingError> {
    // Every pixel is opaque, so dropping alpha loses nothing.
    let rgb: Vec<u8> = pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::with_capacity(rgb.len() / 16);
    let mut encoder = png::Encoder::new(&mut bytes, pixmap.width(), pixmap.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    // Flat areas compress best when a row is compared with the one above.
    encoder.set_filter(png::Filter::Up);
    let per_metre = (DOTS_PER_INCH / 0.0254).round() as u32;
    let unit = png::Unit::Meter;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&rgb)?;
    writer.finish()?;
    Ok(bytes)
}
