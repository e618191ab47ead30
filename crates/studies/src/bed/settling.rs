//! Density and coordination of beds that settle under gravity, by Bond number, friction and numerical stiffness.

use std::ops::ControlFlow;
use std::path::Path;

use dem_core::bed::{BedError, Sample, SceneFile};
use workbench::error::{Failure, RunError};

use crate::report::{Report, Table};

const COUNT: usize = 400;
const BOND_NUMBERS: [f64; 3] = [0.1, 10.0, 100.0];
const FRICTION: [f64; 2] = [0.0, 0.3];
/// Two numerical stiffnesses for the same adhesive force \[N/m\].
const K1_N_PER_M: [f64; 2] = [0.5, 4.0];
const SEEDS: [u64; 3] = [1, 2, 3];

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let report = Report::begin(out, "bed-settling")?;
    let mut table = Table::new(&[
        "Bond number",
        "friction",
        "K1 [N/m]",
        "relative density",
        "standard error",
        "contacts per particle",
        "standard error of it",
    ]);
    let mut furthest: f64 = 0.0;
    for bond_number in BOND_NUMBERS {
        for friction in FRICTION {
            let mut densities = Vec::new();
            for k1 in K1_N_PER_M {
                let beds = SEEDS
                    .map(|seed| settled(bond_number, friction, k1, seed).map_err(RunError::new));
                let beds = beds.into_iter().collect::<Result<Vec<Sample>, RunError>>()?;
                let density = mean(beds.iter().map(|bed| bed.relative_density));
                let coordination = mean(beds.iter().map(|bed| bed.coordination));
                eprintln!("{bond_number} {friction} {k1}: {} {}", density[0], coordination[0]);
                densities.push(density[0]);
                let mut row = vec![bond_number.to_string(), friction.to_string(), k1.to_string()];
                row.push(format!("{:.4}", density[0]));
                row.push(format!("{:.4}", density[1]));
                row.push(format!("{:.2}", coordination[0]));
                row.push(format!("{:.2}", coordination[1]));
                table.push(row);
            }
            furthest = furthest.max((densities[0] - densities[1]).abs());
        }
    }
    report.table(&table)?;
    Ok(report.page("Beds that settle: adhesion, friction, stiffness", &text(&table, furthest))?)
}

/// Mean and its standard error.
fn mean(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let squares = values.map(|value| (value - mean).powi(2)).sum::<f64>();
    [mean, (squares / (count - 1.0) / count).sqrt()]
}

/// A bed after it has fallen from a relative density of 0.35 and come to rest.
fn settled(bond_number: f64, friction: f64, k1: f64, seed: u64) -> Result<Sample, BedError> {
    let friction = if friction > 0.0 {
        format!("[friction]\ncoefficient = {friction}")
    } else {
        String::new()
    };
    let text = format!(
        r#"
        name = "settling"
        [material]
        youngs_modulus_pa = 1.65e9
        surface_tension_n_per_m = 40.7e-3
        density_kg_per_m3 = 1000.0
        k1_n_per_m = {k1}
        [box]
        size_m = [315e-6, 315e-6, 2e-3]
        sides = ["periodic", "periodic", "lower-wall"]
        [particles.packing]
        count = {COUNT}
        relative_density = 0.35
        radii = {{ equal = {{ radius_m = 31.5e-6 }} }}
        seed = {seed}
        [adhesion]
        bond_number = {bond_number}
        [gravity]
        acceleration_m_per_s2 = [0.0, 0.0, -9.81]
        [drag]
        viscosity_pa_s = 1.8e-5
        {friction}
        [[phases]]
        name = "settle"
        duration_s = 0.05
        heated = false
        outputs = 1
        "#
    );
    let scene = SceneFile::parse(&text, "settling")?.build()?;
    let series = scene.run(|_, _| ControlFlow::Continue(()))?;
    series.samples.last().copied().ok_or(BedError::Checkpoint("no observation"))
}

fn text(table: &Table, furthest: f64) -> String {
    format!(
        "{COUNT} PA12 particles fall from a random packing of relative density 0.35 through air onto a wall, in a box with \
         periodic sides, and rest after 0.05 s; means over {} packings. The density is that of a uniform bed with the same centre of \
         mass, wall and surface included. The Bond number is the adhesive force over the weight of a particle; it is stated \
         in the scene, and K1 is a numerical stiffness.\n\n{}\n\
         Stiffness: the same adhesive force with eight times the stiffness moves the density by at most {furthest:.4}, at the largest Bond number. \
         There the force is the same, but not the work that parts two particles, about `fa^2/(2 K1)` in this law: soft contacts lose more of a \
         fall and hold what they catch. A bed of strong adhesion is to be settled with a K1 whose `fa/(K1 R)` is far below 1e-2 (0.008 and 0.001 \
         here).\n\n\
         Published: without adhesion and friction equal spheres jam at 0.639 with six contacts for each that is held (O'Hern et al., \
         Phys. Rev. E 68 (2003) 011306; the packings that this project makes are held to it by a test); friction takes the \
         density towards random loose packing, 0.555 (Onoda and Liniger, Phys. Rev. Lett. 64 (1990) 2727), and the \
         contacts towards four. Layers at the wall and at the surface, a fifth of these beds, lower both numbers. With adhesion \
         beds are looser the larger the Bond number is (Yang, Zou and Yu, Phys. Rev. E 62 (2000) 3900, for fine particles with \
         rolling resistance, which this contact law has not: theirs are looser); how much looser depends on \
         how the bed is poured, and no published table for this way of pouring was found.\n",
        SEEDS.len(),
        table.markdown(),
    )
}
