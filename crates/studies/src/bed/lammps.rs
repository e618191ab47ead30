//! The packing of a scene as input of LAMMPS, for the same speed test there.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use dem_core::{PairSpec, paper};
use workbench::error::RunError;

use super::packing::Scene;
use crate::args::BedCostArgs;

/// Writes `data.bed` and `in.bed`: lengths in diameters, masses in particles, time so that K1 = 1.
pub(super) fn write(args: &BedCostArgs, folder: &Path) -> Result<(), RunError> {
    let diameter = 2.0 * paper::PA12.radius_m;
    let (region, start) = Scene(&args.scene).start(args.particles).map_err(RunError::new)?;
    let mut data = format!("packing\n\n{} atoms\n1 atom types\n\n", start.position_m.len());
    for (axis, size) in ["x", "y", "z"].into_iter().zip(region.size_m) {
        let _ = writeln!(data, "0 {} {axis}lo {axis}hi", size / diameter);
    }
    // id, type, diameter, density, place
    data.push_str("\nAtoms # sphere\n\n");
    let density = 6.0 / std::f64::consts::PI;
    for (place, position) in start.position_m.iter().enumerate() {
        let [x, y, z] = position.map(|at| at / diameter);
        let _ = writeln!(data, "{} 1 1 {density} {x} {y} {z}", place + 1);
    }
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build().map_err(RunError::new)?;
    let unit_s = (scene.powder().mass_kg() / scene.k1_n_per_m()).sqrt();
    let step = 0.02 * scene.collision_time_s() / unit_s;
    // LAMMPS multiplies gamma_n by the effective mass, 1/2.
    let gamma = 2.0 * scene.dissipation_kg_per_s() * unit_s / scene.powder().mass_kg();
    let steps = args.steps;
    let input = format!(
        "units lj\natom_style sphere\nboundary p p p\nnewton on\ncomm_modify vel yes\nread_data data.bed\n\
         pair_style gran/hooke 1.0 0.0 {gamma} 0.0 0.0 0\npair_coeff * *\n\
         neighbor 0.1 bin\nneigh_modify delay 0 every 1 check yes\n\
         fix 1 all nve/sphere\ntimestep {step}\nthermo {steps}\nrun {steps}\n"
    );
    for (name, text) in [("data.bed", data), ("in.bed", input)] {
        let path = folder.join(name);
        fs::write(&path, text)
            .map_err(|error| RunError::new(format_args!("{}: {error}", path.display())))?;
    }
    Ok(())
}
