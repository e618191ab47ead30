//! Pixels below all marks of a PNG, for what no outline can show.

/// Pixels below all marks of the PNG; the SVG does not have them.
pub(crate) struct Backdrop {
    rgb: Vec<u8>,
    across: usize,
    /// Pixels from the left and from the top at which it begins.
    corner: (usize, usize),
}

impl Backdrop {
    /// Averages `samples` by `samples` colours (from 0 to 1, row by row) for each pixel of rows of `across`.
    pub(super) fn averaged(
        colours: &[[f32; 3]],
        across: usize,
        samples: usize,
        corner: (usize, usize),
    ) -> Backdrop {
        let down = colours.len() / (across * samples * samples).max(1);
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
        Backdrop { rgb, across, corner }
    }

    /// Copies the colours into RGBA pixels in rows of `width`; what lies outside them is left out.
    pub(super) fn copy_to(&self, rgba: &mut [u8], width: usize) {
        let (left, top) = self.corner;
        let shown = self.across.min(width.saturating_sub(left));
        for (row, colours) in self.rgb.chunks_exact(3 * self.across).enumerate() {
            let from = 4 * ((top + row) * width + left);
            let to = rgba.get_mut(from..).unwrap_or_default().chunks_exact_mut(4);
            for (pixel, colour) in to.zip(colours.chunks_exact(3)).take(shown) {
                pixel[..3].copy_from_slice(colour);
            }
        }
    }
}
