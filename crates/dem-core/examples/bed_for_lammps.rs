//! Writes the packing of `bed_cost normal` for LAMMPS: `bed_for_lammps PARTICLES STEPS FOLDER`.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use dem_core::bed::{Region, Side, jammed_packing};
use dem_core::{PairSpec, paper};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, particles, steps, folder] = &arguments[..] else {
        return Err("bed_for_lammps PARTICLES STEPS FOLDER".into());
    };
    let (particles, steps): (usize, u64) = (particles.parse()?, steps.parse()?);
    let radius_m = paper::PA12.radius_m;
    let copies = (1..).find(|k| particles <= 2000 * k * k * k).unwrap_or(1);
    let count = particles / (copies * copies * copies);
    let size = (count as f64 * 7.5).cbrt() * radius_m;
    let cube = Region::new([size; 3], Side::Periodic);
    let (region, positions) = jammed_packing(&cube, &vec![radius_m; count], 3e-4, 1)?;

    // Lengths in diameters, masses in particles, time so that K1 = 1.
    let diameter = 2.0 * radius_m;
    let length = region.size_m[0] / diameter;
    let total = copies as f64 * length;
    let atoms = count * copies * copies * copies;
    let mut data = format!("packing\n\n{atoms} atoms\n1 atom types\n\n");
    for axis in ["x", "y", "z"] {
        writeln!(data, "0 {total} {axis}lo {axis}hi")?;
    }
    // id, type, diameter, density, place
    data.push_str("\nAtoms # sphere\n\n");
    let density = 6.0 / std::f64::consts::PI;
    let mut id = 0;
    for x in 0..copies {
        for y in 0..copies {
            for z in 0..copies {
                for position in &positions {
                    id += 1;
                    let at =
                        |axis: usize, copy: usize| position[axis] / diameter + copy as f64 * length;
                    writeln!(data, "{id} 1 1 {density} {} {} {}", at(0, x), at(1, y), at(2, z))?;
                }
            }
        }
    }
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build()?;
    let unit_s = (scene.powder().mass_kg() / scene.k1_n_per_m()).sqrt();
    let step = 0.02 * scene.collision_time_s() / unit_s;
    // LAMMPS multiplies gamma_n by the effective mass, 1/2.
    let gamma = 2.0 * scene.dissipation_kg_per_s() * unit_s / scene.powder().mass_kg();
    let input = format!(
        "units lj\natom_style sphere\nboundary p p p\nnewton on\ncomm_modify vel yes\nread_data data.bed\n\
         pair_style gran/hooke 1.0 0.0 {gamma} 0.0 0.0 0\npair_coeff * *\n\
         neighbor 0.1 bin\nneigh_modify delay 0 every 1 check yes\n\
         fix 1 all nve/sphere\ntimestep {step}\nthermo {steps}\nrun {steps}\n"
    );
    let folder = Path::new(folder);
    std::fs::write(folder.join("data.bed"), data)?;
    std::fs::write(folder.join("in.bed"), input)?;
    Ok(())
}
