#!/bin/sh
# Instructions per particle step for each scene type, counted by callgrind inside `Bed::advance` alone.
# Jammed packings have about six contacts per particle. Needs valgrind; two minutes.
# From the repository: crates/studies/bed/instructions.sh
set -eu
cargo build --release -p studies
studies=${CARGO_TARGET_DIR:-target}/release/studies
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$@" 2>&1 |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}
echo "| scene | particles | instructions per particle step |"
echo "|---|---|---|"
# The solver for pairs: the difference of two runs.
few=$(count "$studies" bed-cost pair-solver 2 1000 1)
many=$(count "$studies" bed-cost pair-solver 2 21000 1)
echo "| sintering, pair solver | 2 | $(( (many - few) / (20000 * 2) )) |"
row() {
    # The study makes 20 steps before those it times.
    all=$(count --toggle-collect='*engine*Bed*advance*' "$studies" bed-cost "$1" "$2" "$3" 1)
    echo "| $1 | $2 | $(( all / (($3 + 20) * $2) )) |"
}
row normal 2 20000
row sintering 2 20000
row friction 2 20000
row chain+normal 10 5000
row chain+sintering 10 5000
for scene in normal open+normal unequal walls normal+gravity normal+drag friction friction+gravity sintering \
    sintering+unequal sintering+friction sintering+gravity sintering+friction+walls+gravity+drag; do
    row "$scene" 500 300
done
