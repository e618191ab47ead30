#!/usr/bin/env bash
# Makes the pictures of the guide anew, by the program itself: crates/guide/pictures.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
pictures=crates/guide/pages/pictures
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo run --quiet -p guide --example pictures -- "$pictures"
for material in peek pa12; do
    cargo run --quiet -p calibrate -- --material "$material" --quiet --out "$scratch/$material"
done
for figure in fit corner recursion convergence; do
    cp "$scratch/peek/$figure.svg" "$pictures/peek-$figure.svg"
done
cargo run --quiet -p calibrate -- --plan experiments/heat/ps-power.toml --quiet --out "$scratch/ps-power"
cp "$scratch/ps-power/fit-together.svg" "$pictures/ps-pulses.svg"
cp "$scratch/pa12/residuals.svg" "$pictures/pa12-residuals.svg"
for pair in r32 r30 r29-3 r28-9; do
    cargo run --quiet -p calibrate -- -e "pa12-$pair" --noise correlated --quiet --out "$scratch/pa12-$pair"
done
cargo run --quiet -p calibrate -- population "$scratch"/pa12-r{32,30,29-3,28-9} --quiet --out "$scratch/population"
for figure in pairs next; do
    cp "$scratch/population/$figure.svg" "$pictures/population-$figure.svg"
done
