//! Does validation find mistakes? Each of [`MISTAKES`] is planted in turn in a copy of the crate and looked for.
//!
//! `cargo test -p smc-calib --test planted_bugs -- --ignored --nocapture every_planted_mistake` prints the table.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod checks;
mod patched_copy;

use checks::{Found, look};
use patched_copy::{PatchedCopy, patch_all};

/// Names of the mistakes in `mistakes.rs`, and what was done wrong.
const MISTAKES: [(&str, &str); 12] = [
    ("frozen-weights", "weights frozen at their stage"),
    ("missing-jacobian", "determinant of the scale matrix missing from the density"),
    ("flipped-sign", "sign of the off-diagonal inverse factor flipped in the density"),
    ("sigma-ten-percent", "sigma drawn 10 % too large"),
    ("defensive-share-left-out", "defensive share left out of the density"),
    ("stale-covariance", "covariance before widening in the density only"),
    ("normal-draws", "normal draws for Student-t components"),
    ("last-observation-forgotten", "last observation left out of the likelihood"),
    ("tempered", "final weights at likelihood^0.9"),
    ("equal-stages", "stages mixed in equal parts, whatever their sizes"),
    ("errors-too-small", "standard errors divided by sqrt(replicates) twice"),
    ("same-scrambling", "all sub-nets scrambled alike"),
];

#[test]
fn every_patch_fits_the_sources_in_exactly_one_place() {
    patch_all();
}

/// Run by the check below in the patched copy, where `PLANTED` names a mistake.
#[test]
#[ignore = "says nothing by itself"]
fn what_the_checks_find() {
    let Found { references, honesty, ranks, coverage } = look();
    println!("found {references} {honesty} {ranks} {coverage}");
}

fn found(printed: &str) -> Found {
    let line = printed.lines().find_map(|line| line.split_once("found ")).unwrap().1;
    let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
    let [references, honesty, ranks, coverage] = numbers[..] else { panic!("{line}") };
    Found { references, honesty, ranks, coverage }
}

/// Prints what is found of the shipped sampler and of every planted mistake of those.
///
/// # Panics
/// Where a mistake is not found, or something where there is none.
fn look_for<'a>(mistakes: impl Iterator<Item = &'a (&'a str, &'a str)>) {
    let copy = PatchedCopy::write();
    println!("| planted | references | error bars | ranks | coverage | caught by |");
    println!("|---|---:|---:|---:|---:|---|");
    let mut missed = Vec::new();
    for (name, description) in std::iter::once(&("none", "none")).chain(mistakes) {
        let found = found(&copy.run("what_the_checks_find", name));
        let caught = found.caught();
        println!(
            "| {description} | {:.2} | {:.2} | {:.2} | {:.2} | {} |",
            found.references,
            found.honesty,
            found.ranks,
            found.coverage,
            if caught.is_empty() { "-".to_owned() } else { caught.join(", ") }
        );
        if caught.is_empty() != (*name == "none") {
            missed.push(*name);
        }
    }
    assert!(missed.is_empty(), "not as it should be: {missed:?}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_wrong_density_a_wrong_sigma_and_wrong_error_bars_are_found() {
    let few = ["missing-jacobian", "sigma-ten-percent", "errors-too-small"];
    look_for(MISTAKES.iter().filter(|(name, _)| few.contains(name)));
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn every_planted_mistake_is_found_and_the_shipped_sampler_passes() {
    look_for(MISTAKES.iter());
}
