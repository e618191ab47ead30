//! The ways of a scene file to place particles: lattices and packings.

use super::error::{BedError, field, within};
use super::packing::{Radii, jammed_packing, random_packing};
use super::region::{Region, Side};
use super::start::Start;
use crate::paper;

/// Number of particles of a lattice.
pub(super) fn lattice_count(counts: &[usize; 3]) -> Result<usize, BedError> {
    let total = counts.iter().try_fold(1usize, |total, &count| total.checked_mul(count));
    total.filter(|total| (1..=10_000_000).contains(total)).ok_or_else(|| {
        let remedy = "use 1 to 1e7 particles in all";
        field("particles.lattice.counts", format!("{counts:?}"), remedy)
    })
}

/// A simple cubic lattice whose neighbours overlap by `overlap` radii.
pub(super) fn lattice(
    counts: &[usize; 3],
    radius_m: f64,
    overlap: f64,
    origin_m: [f64; 3],
) -> Result<Start, BedError> {
    let total = lattice_count(counts)?;
    let spacing = (2.0 - overlap) * radius_m;
    let mut start = Start { radius_m: vec![radius_m; total], ..Start::default() };
    for i in 0..total {
        let at = [i % counts[0], i / counts[0] % counts[1], i / counts[0] / counts[1]];
        start.position_m.push([0, 1, 2].map(|axis| origin_m[axis] + at[axis] as f64 * spacing));
    }
    Ok(start)
}

/// Radii of a packing.
pub(super) fn packing_radii(count: usize, radii: &Radii, seed: u64) -> Result<Vec<f64>, BedError> {
    if !(1..=10_000_000).contains(&count) {
        return Err(field("particles.packing.count", count, "use 1 to 1e7"));
    }
    radii.draw(count, seed)
}

/// Volume of the particles \[m3\].
pub(super) fn solid_m3(radius_m: &[f64]) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius_m.iter().map(|r| r.powi(3)).sum::<f64>()
}

/// A cube in which particles have a relative density.
fn cube(radius_m: &[f64], density: f64, sides: [Side; 3]) -> Region {
    Region { size_m: [(solid_m3(radius_m) / density).cbrt(); 3], sides }
}

/// A jammed packing, which makes its box.
pub(super) fn packed_jammed(
    radius_m: Vec<f64>,
    size_m: Option<[f64; 3]>,
    sides: [Side; 3],
    seed: u64,
) -> Result<(Start, Region), BedError> {
    if size_m.is_some() {
        let remedy = "leave it out, or give particles.packing.relative_density";
        return Err(field("box.size_m", "given for a jammed packing", remedy));
    }
    let overlap = 0.3 * paper::ADHESION_OVER_K1_RADIUS;
    let (packed, position_m) =
        jammed_packing(&cube(&radius_m, 0.58, sides), &radius_m, overlap, seed)?;
    Ok((Start { position_m, radius_m, ..Start::default() }, Region { sides, ..packed }))
}

/// A random packing of a relative density, which makes its box or fills a part of the height of a given one.
pub(super) fn packed_to(
    density: f64,
    radius_m: Vec<f64>,
    size_m: Option<[f64; 3]>,
    sides: [Side; 3],
    seed: u64,
) -> Result<(Start, Region), BedError> {
    let name = "particles.packing.relative_density";
    within(name, density, 1e-6, 1.0, "use 1e-6 to 1; random packings reach 0.6")?;
    let mut filled = cube(&radius_m, density, sides);
    if let Some(size_m) = size_m {
        let solid = solid_m3(&radius_m);
        let height = solid / (density * size_m[0] * size_m[1]);
        if height > size_m[2] {
            let reached = solid / (size_m[0] * size_m[1] * size_m[2]);
            let value = format!("{density} (full box: {reached})");
            let remedy = "the particles need more than the box: enlarge it or take fewer";
            return Err(field(name, value, remedy));
        }
        filled.size_m = [size_m[0], size_m[1], height];
        if height < size_m[2] && sides[2] == Side::Periodic {
            let remedy = "a periodic box must be filled: leave box.size_m out";
            return Err(field("box.size_m", format!("{size_m:?}"), remedy));
        }
    }
    let position_m = random_packing(&filled, &radius_m, seed)?;
    let region = size_m.map_or(filled, |size_m| Region { size_m, sides });
    Ok((Start { position_m, radius_m, ..Start::default() }, region))
}
