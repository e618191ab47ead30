#!/bin/sh
# The same jammed packing in LAMMPS (Debian: apt-get install lammps) and here: particle steps per second
# of both, and their ratio, on one core and on two. LAMMPS has no sintering: granular pair style hooke without
# friction, the same stiffness, dissipation, step and skin; here the contact law without growth.
# The best of REPEATS runs each, taken in turn. Prints a table, and writes it to
# results/benchmarks/bed-lammps/report.md.
# From the repository: crates/studies/bed/lammps.sh [PARTICLES] [STEPS] [REPEATS]
set -eu
particles=${1:-10000}
steps=${2:-1000}
repeats=${3:-5}
cargo build --release -p studies
repository=$(pwd)
target=${CARGO_TARGET_DIR:-target}
case $target in /*) ;; *) target=$repository/$target ;; esac
studies=$target/release/studies
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$studies" bed-cost normal "$particles" "$steps" --lammps "$work"
cd "$work"
export OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
# The larger of two numbers.
larger() { awk -v a="$1" -v b="$2" 'BEGIN { print (a + 0 > b + 0) ? a : b }'; }
busy=$(cut -d' ' -f1 /proc/loadavg)
{
    echo "# The same packing in LAMMPS"
    echo
    echo "$particles jammed particles, $steps steps, best of $repeats runs; $(lmp -h | sed -n 's/.*Simulator - *//p' | head -n 1),"
    echo "\`gran/hooke\` under MPI, on $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)."
    echo "Load average when it began: $busy on $(getconf _NPROCESSORS_ONLN) cores; where it is not near zero the row of two cores says nothing,"
    echo "because MPI processes wait for each other."
    echo
    echo "| cores | here, particle steps/s | LAMMPS, particle steps/s | ratio |"
    echo "|---|---|---|---|"
} >table
for cores in 1 2; do
    ours=0
    theirs=0
    for run in $(seq "$repeats"); do
        mpirun --oversubscribe --bind-to none -np $cores lmp -in in.bed -log log -screen none
        # "Loop time of T on P procs for S steps with N atoms"
        theirs=$(larger "$theirs" "$(awk '/^Loop time/ { rate = $9 * $12 / $4 } END { print rate }' log)")
        ours=$(larger "$ours" "$("$studies" bed-cost normal "$particles" "$steps" $cores |
            sed 's/.*threads [0-9]*: \([0-9.e+]*\) particle.*/\1/')")
    done
    awk -v c=$cores -v a="$ours" -v b="$theirs" 'BEGIN {
        printf "| %d | %.3g | %.3g | %.2f |\n", c, a, b, a / b }' >>table
done
out=$repository/results/benchmarks/bed-lammps
mkdir -p "$out"
cp table "$out/report.md"
cat table
