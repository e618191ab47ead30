//! Runs a scene file: `bed_run SCENE.toml [K1_FACTOR]` writes its time series as CSV to standard output and
//! what it took to standard error.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::error::Error;
use std::ops::ControlFlow;
use std::time::Instant;

use dem_core::bed::{SceneFile, write_csv};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.get(1).ok_or("bed_run SCENE.toml [K1_FACTOR]")?;
    let mut scene = SceneFile::parse(&std::fs::read_to_string(path)?, path)?.build()?;
    if let Some(factor) = arguments.get(2) {
        let k1 = scene.bed().material().k1_n_per_m() * factor.parse::<f64>()?;
        scene = scene.with_k1(k1)?;
    }
    let before = Instant::now();
    let mut work = Default::default();
    let series = scene.run(|progress, bed| {
        work = bed.work();
        eprintln!(
            "{:5.1} % after {:.1?}: t {:.4} s, density {:.4}, coordination {:.3}, a/R {:.4}, driving {:.4} up to {:.2}",
            100.0 * progress.share,
            before.elapsed(),
            progress.sample.time_s,
            progress.sample.relative_density,
            progress.sample.coordination,
            progress.sample.mean_contact_ratio,
            progress.sample.mean_driving,
            progress.sample.largest_driving,
        );
        ControlFlow::Continue(())
    })?;
    eprintln!("{:?} {work:?} {:?}", before.elapsed(), series.quasi_static);
    write_csv(&series, &mut std::io::stdout().lock())?;
    Ok(())
}
