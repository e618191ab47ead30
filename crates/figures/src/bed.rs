//! A bed of spheres, shaded and coloured by contact ratio.
//!
//! Parallel projection from a little above, with light from the upper left. Every pixel shows the nearest sphere. The
//! circle in which two spheres meet, their neck, is drawn darker; a dark disc is a neck with a particle beyond a periodic
//! side.

use plotters::element::Rectangle;
use plotters::style::{Color as _, RGBAColor};
use rayon::prelude::*;

use crate::columns::Columns;
use crate::drawing::{Axis, Look, Marker, Page, Panel, Scale, Spec, Swatch, header, layout, row};
use crate::error::{Drawn, PlotError};
use crate::picture::Width;

type Vec3 = [f64; 3];

/// A bed at one time. It is drawn as pixels, so there is a PNG only.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BedFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Centres \[m\]; the third axis points up.
    pub position_m: Vec<[f64; 3]>,
    /// Radii \[m\].
    pub radius_m: Vec<f64>,
    /// Mean contact ratio a/R of each particle's contacts; NaN for a particle without one.
    pub contact_ratio: Vec<f64>,
    /// Contacts: first particle, vector from its centre to that of the nearest image of the second \[m\], second particle.
    /// A contact of a particle that does not exist is left out.
    pub contacts: Vec<(usize, [f64; 3], usize)>,
    /// Lower and upper corner of a box to draw around \[m\].
    pub frame_m: Option<[[f64; 3]; 2]>,
    /// Ends of the colour scale.
    pub range: [f64; 2],
}

/// Pixels rendered for one pixel of the picture, along each axis.
const SAMPLES: usize = 2;
const NO_CONTACT: [f64; 3] = [0.62, 0.62, 0.62];
const FRAME: [f64; 3] = [0.45, 0.45, 0.45];
/// Half the width of the line of a neck, as an angle seen from the centre.
const NECK_LINE: f64 = 0.045;

impl BedFigure {
    /// Draws the bed with its colour scale as a PNG file.
    ///
    /// # Errors
    ///
    /// [`PlotError::Length`] if columns do not match.
    pub fn png(&self, width: Width) -> Result<Vec<u8>, PlotError> {
        let page = Page::new(width);
        self.draw(&page)?;
        Ok(page.picture()?.png)
    }

    pub(crate) fn draw(&self, page: &Page) -> Drawn {
        let columns = Columns("bed");
        let each = (self.position_m.len(), "particle");
        columns.need("radius_m", &self.radius_m, each)?;
        columns.need("contact_ratio", &self.contact_ratio, each)?;
        let top = header(page, &self.title, &self.entries())?;
        const EDGE: f32 = 4.0;
        let [left, right, low, high] = self.bounds(&Camera::eye());
        let room = page.width - 2.0 * EDGE;
        // Neither a strip nor much taller than wide.
        let height = room * ((high - low) / (right - left)) as f32;
        let height = height.max(0.3 * room).min(1.15 * room);
        page.set_backdrop((EDGE, top), (room, height), SAMPLES, |across, down| {
            self.raster(across, down)
        });
        let [low, high] = self.range;
        let ends = [low, if high > low { high } else { low + 1.0 }];
        let name = "contact ratio a/R, mean of the particle’s contacts";
        let x = Axis::holding(name, "", Scale::Linear, ends, 0.0);
        let y = Axis::holding("", "", Scale::Linear, [0.0, 1.0], 0.0);
        let bar = [row(7.0, [Spec::new(x, y).bare()])];
        layout(page, top + height + 6.0, 8.0, &bar)?.iter().try_for_each(colour_bar)
    }

    /// What is neither a sphere in the colour of its contacts nor their shadow.
    fn entries(&self) -> Vec<(&'static str, Swatch)> {
        let disc = |[r, g, b]: Vec3| {
            let [r, g, b] = [r, g, b].map(|part| (255.0 * part) as u8);
            Swatch::Point(Look::filled(Marker::Circle, 2.0, RGBAColor(r, g, b, 1.0)))
        };
        let mut entries = Vec::new();
        // An image beyond a periodic side is not drawn: of its neck only the disc is.
        let beyond = |&(i, to, j): &(usize, Vec3, usize)| {
            let (Some(from), Some(other)) = (self.position_m.get(i), self.position_m.get(j)) else {
                return false;
            };
            let off = sub(add(*from, to), *other);
            dot(off, off) > 1e-12 * dot(to, to)
        };
        if self.contacts.iter().any(beyond) {
            entries.push(("dark disc: neck across a periodic side", disc([0.25; 3])));
        }
        if self.contact_ratio.iter().any(|ratio| ratio.is_nan()) {
            entries.push(("no contact", disc(NO_CONTACT)));
        }
        entries
    }

    fn colour(&self, particle: usize) -> Vec3 {
        let ratio = self.contact_ratio[particle];
        if ratio.is_nan() {
            return NO_CONTACT;
        }
        let [low, high] = self.range;
        viridis(if high > low { (ratio - low) / (high - low) } else { 0.0 })
    }

    /// Left, right, lower and upper end of spheres and frame as a camera sees them.
    fn bounds(&self, camera: &Camera) -> [f64; 4] {
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        let mut hold = |at: Vec3, by: f64| {
            let [x, y, _] = camera.seen(at);
            let [left, right, low, high] = bounds;
            bounds = [left.min(x - by), right.max(x + by), low.min(y - by), high.max(y + by)];
        };
        let spheres = self.position_m.iter().zip(&self.radius_m);
        spheres.for_each(|(&position, &radius)| hold(position, radius));
        self.frame_m.iter().flat_map(corners).for_each(|corner| hold(corner, 0.0));
        bounds
    }

    /// Necks of each particle.
    fn necks(&self) -> Vec<Vec<Neck>> {
        let mut necks = vec![Vec::new(); self.position_m.len()];
        for &(i, to, j) in &self.contacts {
            let (Some(a), Some(b)) = (self.radius_m.get(i), self.radius_m.get(j)) else { continue };
            let d = dot(to, to).sqrt();
            let toward = scale(to, 1.0 / d);
            // Where the two spheres meet, from each centre.
            necks[i].push(Neck::new(toward, (d * d + a * a - b * b) / (2.0 * d * a)));
            necks[j].push(Neck::new(scale(toward, -1.0), (d * d + b * b - a * a) / (2.0 * d * b)));
        }
        necks
    }

    /// Colours of `across` by `down` pixels, row by row, from 0 to 1.
    fn raster(&self, across: usize, down: usize) -> Vec<[f32; 3]> {
        let (eye, light) = (Camera::eye(), Camera::light());
        let seen = Depths::of(self, &Screen::showing(self, eye, across, down));
        let lit = Depths::of(self, &Screen::showing(self, light, 800, 800));
        let necks = self.necks();
        let colours: Vec<Vec3> = (0..self.position_m.len()).map(|i| self.colour(i)).collect();
        let mean = self.radius_m.iter().sum::<f64>() / self.radius_m.len().max(1) as f64;
        let (near, far) = seen.range();
        let half = normalised(add(light.toward, eye.toward));
        let mut pixels = vec![[1.0f32; 3]; across * down];
        let paint = |row: usize, column: usize, pixel: &mut [f32; 3]| {
            let Some((particle, depth)) = seen.at(column, row) else { return };
            let point = seen.screen.point(column, row, depth);
            let normal =
                scale(sub(point, self.position_m[particle]), 1.0 / self.radius_m[particle]);
            let facing = dot(normal, light.toward).max(0.0);
            // Where light grazes, a pixel seen from the light spans much depth.
            let slack = (0.03 * mean + 1.5 * lit.screen.pixel) / facing.max(0.1);
            let shade = if facing > 0.0 { lit.lit(point, slack) } else { 0.0 };
            let sky = 0.5 + 0.5 * normal[2];
            let gloss = dot(normal, half).max(0.0).powi(40) * shade;
            let away = (near - depth) / (near - far).max(1e-300);
            // Weak shadows: the colour is what is read.
            let mut light = 0.58 + 0.14 * sky + 0.32 * facing * shade;
            for neck in &necks[particle] {
                let along = dot(normal, neck.toward);
                if along > neck.outer_cosine {
                    let beyond = along.min(1.0).acos() - neck.angle;
                    light *= 0.45 + 0.55 * (beyond / NECK_LINE).clamp(0.0, 1.0);
                }
            }
            let colour = colours[particle];
            for (pixel, part) in pixel.iter_mut().zip(colour) {
                let bright = (part * light + 0.22 * gloss).min(1.0);
                // The distance makes paler.
                *pixel = (bright + 0.18 * away * (1.0 - bright)) as f32;
            }
        };
        pixels.par_chunks_mut(across.max(1)).enumerate().for_each(|(row, line)| {
            line.iter_mut().enumerate().for_each(|(column, pixel)| paint(row, column, pixel));
        });
        if let Some(frame) = self.frame_m {
            draw_frame(&mut pixels, &seen, frame, 0.02 * mean);
        }
        pixels
    }
}

/// Fills a panel with the colours of its horizontal axis.
fn colour_bar(panel: &Panel) -> Drawn {
    const STRIPES: usize = 128;
    let (from, span) = (panel.x.low, panel.x.high - panel.x.low);
    for k in 0..STRIPES {
        let ink = viridis((k as f64 + 0.5) / STRIPES as f64);
        let [r, g, b] = ink.map(|part| (255.0 * part).round() as u8);
        // Up to the end: seams would show between stripes.
        let left = from + span * k as f64 / STRIPES as f64;
        let corners = [(left, 0.0), (panel.x.high, 1.0)];
        panel.draw(&Rectangle::new(corners, RGBAColor(r, g, b, 1.0).filled()))?;
    }
    Ok(())
}

/// The circle in which a sphere meets another, as seen from its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Neck {
    toward: Vec3,
    /// Angle between the circle and the direction of the other sphere.
    angle: f64,
    /// Cosine of the angle up to which the circle is drawn.
    outer_cosine: f64,
}

impl Neck {
    fn new(toward: Vec3, cosine: f64) -> Neck {
        let angle = cosine.clamp(-1.0, 1.0).acos();
        Neck { toward, angle, outer_cosine: (angle + NECK_LINE).min(std::f64::consts::PI).cos() }
    }
}

/// Direction of view as an orthonormal basis.
#[derive(Debug, Clone, Copy)]
struct Camera {
    right: Vec3,
    up: Vec3,
    toward: Vec3,
}

impl Camera {
    fn new(azimuth_deg: f64, elevation_deg: f64) -> Camera {
        let (s, c) = azimuth_deg.to_radians().sin_cos();
        let (se, ce) = elevation_deg.to_radians().sin_cos();
        // In front (at negative y), then turned about the third axis.
        Camera { right: [c, s, 0.0], up: [-s * se, c * se, ce], toward: [s * ce, -c * ce, se] }
    }

    /// From the front (negative y), a little from the right and from above.
    fn eye() -> Camera {
        Camera::new(28.0, 18.0)
    }

    /// From the upper left.
    fn light() -> Camera {
        Camera::new(-20.0, 52.0)
    }

    fn seen(&self, point: Vec3) -> Vec3 {
        [dot(point, self.right), dot(point, self.up), dot(point, self.toward)]
    }
}

/// Pixels in front of a camera.
#[derive(Debug, Clone, Copy)]
struct Screen {
    camera: Camera,
    /// The middle, as the camera sees it.
    middle: [f64; 2],
    /// Length of a pixel \[m\].
    pixel: f64,
    across: usize,
    down: usize,
}

impl Screen {
    /// A screen with the whole bed on it.
    fn showing(figure: &BedFigure, camera: Camera, across: usize, down: usize) -> Screen {
        let [left, right, low, high] = figure.bounds(&camera);
        let pixel =
            ((right - left) / (across as f64 - 4.0)).max((high - low) / (down as f64 - 4.0));
        let middle = [0.5 * (left + right), 0.5 * (low + high)];
        Screen { camera, middle, pixel, across, down }
    }

    /// Column and row of a place as the camera sees it.
    fn place(&self, [x, y, _]: Vec3) -> [f64; 2] {
        [
            (x - self.middle[0]) / self.pixel + 0.5 * self.across as f64,
            (self.middle[1] - y) / self.pixel + 0.5 * self.down as f64,
        ]
    }

    /// Point behind the middle of a pixel at a depth.
    fn point(&self, column: usize, row: usize, depth: f64) -> Vec3 {
        let x = self.middle[0] + (column as f64 + 0.5 - 0.5 * self.across as f64) * self.pixel;
        let y = self.middle[1] - (row as f64 + 0.5 - 0.5 * self.down as f64) * self.pixel;
        let Camera { right, up, toward } = self.camera;
        add(add(scale(right, x), scale(up, y)), scale(toward, depth))
    }
}

/// The nearest sphere of each pixel.
struct Depths {
    screen: Screen,
    depth: Vec<f32>,
    particle: Vec<u32>,
}

impl Depths {
    fn of(figure: &BedFigure, screen: &Screen) -> Depths {
        let pixels = screen.across * screen.down;
        let mut depth = vec![f32::NEG_INFINITY; pixels];
        let mut particle = vec![u32::MAX; pixels];
        for (index, (&position, &radius)) in
            figure.position_m.iter().zip(&figure.radius_m).enumerate()
        {
            let centre = screen.camera.seen(position);
            let [column, row] = screen.place(centre);
            let reach = radius / screen.pixel;
            let ends = |at: f64, most: usize| {
                let first = (at - reach - 0.5).ceil().max(0.0) as usize;
                let last = (at + reach + 0.5).floor().min(most as f64).max(0.0) as usize;
                first..last
            };
            for y in ends(row, screen.down) {
                let dy = y as f64 + 0.5 - row;
                for x in ends(column, screen.across) {
                    let dx = x as f64 + 0.5 - column;
                    let inside = reach * reach - dx * dx - dy * dy;
                    if inside > 0.0 {
                        let z = (centre[2] + inside.sqrt() * screen.pixel) as f32;
                        let at = y * screen.across + x;
                        if z > depth[at] {
                            depth[at] = z;
                            particle[at] = index as u32;
                        }
                    }
                }
            }
        }
        Depths { screen: *screen, depth, particle }
    }

    fn at(&self, column: usize, row: usize) -> Option<(usize, f64)> {
        let at = row * self.screen.across + column;
        (self.particle[at] != u32::MAX)
            .then(|| (self.particle[at] as usize, f64::from(self.depth[at])))
    }

    /// Nearest and furthest depth.
    fn range(&self) -> (f64, f64) {
        let seen = || self.depth.iter().filter(|depth| depth.is_finite()).map(|&d| f64::from(d));
        (seen().fold(f64::NEG_INFINITY, f64::max), seen().fold(f64::INFINITY, f64::min))
    }

    /// Share of the light that reaches a point, with this camera at the light.
    fn lit(&self, point: Vec3, bias: f64) -> f64 {
        let seen = self.screen.camera.seen(point);
        let [column, row] = self.screen.place(seen);
        let mut light = 0.0;
        for dy in [-0.75, 0.75] {
            for dx in [-0.75, 0.75] {
                let (x, y) = ((column + dx).floor(), (row + dy).floor());
                let inside = (0.0..self.screen.across as f64).contains(&x)
                    && (0.0..self.screen.down as f64).contains(&y);
                let before = inside.then(|| self.at(x as usize, y as usize)).flatten();
                if before.is_none_or(|(_, depth)| seen[2] > depth - bias) {
                    light += 0.25;
                }
            }
        }
        light
    }
}

fn corners([low, high]: &[Vec3; 2]) -> [Vec3; 8] {
    std::array::from_fn(|code| {
        std::array::from_fn(|axis| if code >> axis & 1 == 0 { low[axis] } else { high[axis] })
    })
}

/// Draws the twelve edges of a box where no sphere hides them.
fn draw_frame(pixels: &mut [[f32; 3]], seen: &Depths, frame: [Vec3; 2], slack: f64) {
    let screen = &seen.screen;
    let corners = corners(&frame);
    for code in 0..8usize {
        for axis in 0..3 {
            if code >> axis & 1 == 1 {
                continue;
            }
            let ends = [corners[code], corners[code | 1 << axis]];
            let [from, to] = ends.map(|end| screen.place(screen.camera.seen(end)));
            let steps = (to[0] - from[0]).hypot(to[1] - from[1]).ceil().max(1.0) as usize;
            for step in 0..=steps {
                let share = step as f64 / steps as f64;
                let point = add(ends[0], scale(sub(ends[1], ends[0]), share));
                let place = screen.camera.seen(point);
                let [column, row] = screen.place(place);
                for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                    let (x, y) = ((column + dx - 0.5).floor(), (row + dy - 0.5).floor());
                    let inside = (0.0..screen.across as f64).contains(&x)
                        && (0.0..screen.down as f64).contains(&y);
                    if !inside {
                        continue;
                    }
                    let (x, y) = (x as usize, y as usize);
                    if seen.at(x, y).is_none_or(|(_, depth)| place[2] > depth - slack) {
                        pixels[y * screen.across + x] = FRAME.map(|part| part as f32);
                    }
                }
            }
        }
    }
}

/// Colour map viridis of matplotlib from ten colours: evenly brighter, and readable by the colour-blind.
fn viridis(share: f64) -> Vec3 {
    const STOPS: [u32; 10] = [
        0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b,
        0xfde725,
    ];
    let along = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let below = (along.floor() as usize).min(STOPS.len() - 2);
    let part = along - below as f64;
    let rgb = |stop: u32| {
        let [_, r, g, b] = stop.to_be_bytes();
        [r, g, b].map(|part| f64::from(part) / 255.0)
    };
    let (a, b) = (rgb(STOPS[below]), rgb(STOPS[below + 1]));
    add(scale(a, 1.0 - part), scale(b, part))
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn scale(a: Vec3, by: f64) -> Vec3 {
    a.map(|part| part * by)
}
fn normalised(a: Vec3) -> Vec3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(gap: f64) -> BedFigure {
        BedFigure {
            position_m: vec![[0.0; 3], [gap, 0.0, 0.0]],
            radius_m: vec![1.0; 2],
            contact_ratio: vec![0.5, f64::NAN],
            contacts: vec![(0, [gap, 0.0, 0.0], 1)],
            range: [0.0, 1.0],
            ..BedFigure::default()
        }
    }

    #[test]
    fn every_pixel_shows_the_nearest_sphere_and_the_area_is_that_of_a_disc() {
        // The second sphere right behind the first, as the eye sees it.
        let behind = scale(Camera::eye().toward, -3.0);
        let figure =
            BedFigure { position_m: vec![[0.0; 3], behind], contacts: vec![], ..pair(1.0) };
        let screen = Screen::showing(&figure, Camera::eye(), 400, 400);
        let seen = Depths::of(&figure, &screen);
        assert_eq!(seen.particle.iter().filter(|&&particle| particle == 1).count(), 0);
        let area = seen.particle.iter().filter(|&&particle| particle == 0).count() as f64;
        let disc = std::f64::consts::PI / (screen.pixel * screen.pixel);
        assert!((area / disc - 1.0).abs() < 0.01, "{area} {disc}");
        let (particle, depth) = seen.at(200, 200).expect("a sphere");
        assert!(particle == 0 && (depth - 1.0).abs() < 1e-3, "{particle} {depth}");
    }

    #[test]
    fn a_neck_lies_where_the_spheres_meet() {
        let figure = pair(1.6);
        let necks = figure.necks();
        assert_eq!((necks[0].len(), necks[1].len()), (1, 1));
        for (neck, sign) in [(necks[0][0], 1.0), (necks[1][0], -1.0)] {
            assert_eq!(neck.toward[0], sign);
            // The circle is 0.8 of a radius away, in the middle between the centres.
            assert!((neck.angle.cos() - 0.8).abs() < 1e-15, "{neck:?}");
        }
    }

    #[test]
    fn the_picture_is_a_png_and_the_same_every_time() {
        let png = pair(1.6).png(Width::Column).expect("drawn");
        assert_eq!(&png[1..4], b"PNG");
        assert_eq!(png, pair(1.6).png(Width::Column).expect("drawn"));
        let short = BedFigure { radius_m: vec![1.0], ..pair(1.6) };
        assert!(matches!(short.png(Width::Column), Err(PlotError::Length { .. })));
    }

    #[test]
    fn a_bed_without_particles_and_a_contact_of_a_missing_one_are_drawn() {
        assert!(BedFigure::default().png(Width::Column).is_ok());
        let missing = BedFigure { contacts: vec![(0, [1.6, 0.0, 0.0], 2)], ..pair(1.6) };
        assert!(missing.png(Width::Column).is_ok());
    }
}
