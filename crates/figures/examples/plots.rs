//! Draws every figure from made-up numbers, to be looked at: `cargo run --release --example plots -- DIRECTORY`.

use std::path::PathBuf;
use std::time::Instant;

use figures::*;

#[path = "../src/synthetic.rs"]
mod synthetic;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".to_owned()));
    std::fs::create_dir_all(&directory)?;
    std::fs::write(directory.join("bed.png"), synthetic::bed().png(Width::Column)?)?;
    for (n, end_s, long_names) in [(5, 0.13, true), (50, 6.1, false), (5000, 82.0, false)] {
        for (name, figure) in synthetic::figures(n, end_s, long_names) {
            for (suffix, width) in [("column", Width::Column), ("full", Width::Full)] {
                let start = Instant::now();
                let picture = figure.render(width)?;
                let milliseconds = start.elapsed().as_secs_f64() * 1e3;
                let (png, svg) = (picture.png.len() / 1024, picture.svg.len() / 1024);
                eprintln!(
                    "{name:16} {suffix:7} n = {n:5}: {milliseconds:6.1} ms, PNG {png:4} KiB, SVG {svg:4} KiB"
                );
                std::fs::write(directory.join(format!("{name}-{n}-{suffix}.png")), picture.png)?;
                std::fs::write(directory.join(format!("{name}-{n}-{suffix}.svg")), picture.svg)?;
            }
        }
    }
    Ok(())
}
