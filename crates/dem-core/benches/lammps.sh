#!/bin/sh
# The same jammed packing in LAMMPS (Debian: apt-get install lammps) and here: particle steps per second
# of both, and their ratio, on one core and on two. LAMMPS has no sintering: granular pair style hooke without
# friction, the same stiffness, dissipation, step and skin; here the contact law without growth.
# From the repository: crates/dem-core/benches/lammps.sh [PARTICLES] [STEPS]
set -eu
particles=${1:-10000}
steps=${2:-2000}
cargo build --release -p dem-core --example bed_cost --example bed_for_lammps
examples=${CARGO_TARGET_DIR:-target}/release/examples
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$examples/bed_for_lammps" "$particles" "$steps" "$work"
cd "$work"
for cores in 1 2; do
    export OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    mpirun --oversubscribe -np $cores lmp -in in.bed -log log.$cores -screen none
    # "Loop time of T on P procs for S steps with N atoms"
    theirs=$(awk '/^Loop time/ { rate = $9 * $12 / $4 } END { print rate }' log.$cores)
    ours=$("$examples/bed_cost" normal "$particles" "$steps" $cores |
        sed 's/.*threads [0-9]*: \([0-9.e+]*\) particle.*/\1/')
    awk -v c=$cores -v a="$ours" -v b="$theirs" 'BEGIN {
        printf "%d core(s): here %.3g, LAMMPS %.3g particle steps/s, ratio %.2f\n", c, a, b, a / b }'
done
