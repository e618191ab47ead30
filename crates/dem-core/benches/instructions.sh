#!/bin/sh
# Instructions per particle step for each scene type: the difference of two runs under callgrind.
# Needs valgrind. From the repository: crates/dem-core/benches/instructions.sh
set -eu
cargo build --release -p dem-core --example bed_cost
bed_cost=${CARGO_TARGET_DIR:-target}/release/examples/bed_cost
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$bed_cost" "$1" "$2" "$3" 1 2>&1 |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}
echo "| scene | particles | instructions per particle step |"
echo "|---|---|---|"
row() {
    few=$(count "$1" "$2" 20)
    many=$(count "$1" "$2" "$3")
    echo "| $1 | $2 | $(( (many - few) / ((${3} - 20) * $2) )) |"
}
row normal 2 20020
row sintering 2 20020
row friction 2 20020
for scene in normal open+normal unequal walls normal+gravity normal+drag friction sintering sintering+unequal \
    sintering+friction+walls+gravity+drag; do
    row "$scene" 500 2020
done
