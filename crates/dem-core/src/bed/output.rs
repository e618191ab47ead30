//! Files for other programs: tables and pictures' data.

use std::io::{self, Write};

use super::engine::Bed;
use super::measure::Sample;
use super::run::Series;

/// Columns of [`write_csv`].
pub const CSV_HEADER: &str = "phase,time_s,relative_density,coordination,mean_contact_ratio,contact_ratio_10,\
contact_ratio_50,contact_ratio_90,mean_driving,largest_driving,inertial_number,necks_meet,translation_j,\
rotation_j,elastic_j,springs_j,adhesion_j,gravity_j,law";

/// Writes a time series as CSV, one row for each observation, numbers in full precision; `law` is `pairs`, `cell` or `pores`.
///
/// # Errors
///
/// Errors of the writer.
pub fn write_csv(series: &Series, to: &mut impl Write) -> io::Result<()> {
    writeln!(to, "{CSV_HEADER}")?;
    for (sample, phase) in series.samples.iter().zip(&series.phase) {
        let Sample { energies: e, contact_ratio_deciles: d, .. } = sample;
        write!(to, "{phase}")?;
        for value in [
            sample.time_s,
            sample.relative_density,
            sample.coordination,
            sample.mean_contact_ratio,
            d[0],
            d[1],
            d[2],
            sample.mean_driving,
            sample.largest_driving,
            sample.inertial_number,
            sample.necks_meet,
            e.translation_j,
            e.rotation_j,
            e.elastic_j,
            e.springs_j,
            e.adhesion_j,
            e.gravity_j,
        ] {
            write!(to, ",{value:e}")?;
        }
        writeln!(to, ",{}", sample.law.name())?;
    }
    Ok(())
}

/// Writes the particles as a VTK file (legacy format, text) that ParaView opens: points with radius,
/// velocity, place in the scene, number of contacts and largest contact ratio. Show them as Point Gaussian or with the
/// Glyph filter (sphere, scaled by `diameter`).
///
/// # Errors
///
/// Errors of the writer.
pub fn write_vtk(bed: &Bed, to: &mut impl Write) -> io::Result<()> {
    let particles = bed.particles();
    let n = particles.len();
    let mut contacts = vec![0u32; n];
    let mut ratio = vec![0.0f64; n];
    for contact in bed.contacts() {
        for i in contact.particles {
            contacts[i] += 1;
            ratio[i] = ratio[i].max(contact.contact_ratio());
        }
    }
    writeln!(to, "# vtk DataFile Version 3.0")?;
    writeln!(to, "particles at {:e} s", bed.time_s())?;
    writeln!(to, "ASCII\nDATASET POLYDATA")?;
    writeln!(to, "POINTS {n} double")?;
    for [x, y, z] in &particles.position_m {
        writeln!(to, "{x:e} {y:e} {z:e}")?;
    }
    writeln!(to, "VERTICES {n} {}", 2 * n)?;
    for i in 0..n {
        writeln!(to, "1 {i}")?;
    }
    writeln!(to, "POINT_DATA {n}")?;
    scalars(to, "diameter", "double", particles.radius_m.iter().map(|r| format!("{:e}", 2.0 * r)))?;
    scalars(to, "id", "int", particles.id.iter().map(u32::to_string))?;
    scalars(to, "contacts", "int", contacts.iter().map(u32::to_string))?;
    scalars(to, "contact_ratio", "double", ratio.iter().map(|a| format!("{a:e}")))?;
    writeln!(to, "VECTORS velocity double")?;
    for [x, y, z] in &particles.velocity_m_per_s {
        writeln!(to, "{x:e} {y:e} {z:e}")?;
    }
    Ok(())
}

fn scalars(
    to: &mut impl Write,
    name: &str,
    kind: &str,
    values: impl Iterator<Item = String>,
) -> io::Result<()> {
    writeln!(to, "SCALARS {name} {kind} 1\nLOOKUP_TABLE default")?;
    for value in values {
        writeln!(to, "{value}")?;
    }
    Ok(())
}
