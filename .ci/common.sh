# What the scripts of this folder share.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export CARGO_TERM_COLOR=never
# Everything is built once here: files for the next build would only fill the disk.
export CARGO_INCREMENTAL=0

stage() { printf '\n== %s (at %s s)\n' "$1" "$SECONDS"; }

# Installs Debian packages where that is possible; says so where it is not.
install() {
    if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
        echo "SKIPPED: $* not installed here, and this is not root on a Debian"
        return
    fi
    export DEBIAN_FRONTEND=noninteractive
    if ! { apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@" >/dev/null; }; then
        echo "SKIPPED: $* cannot be installed here (apt-get failed, see above)"
    fi
}
# Whether Slurm is here; with ACCOUNTING=1 also what its accounts need.
has_slurm() { tests/slurm/cluster.sh missing >/dev/null; }
# Prints how long its command took.
timed() {
    local begin=$SECONDS
    "$@"
    echo "took $((SECONDS - begin)) s: $*"
}
# With all crates named as for the tests, nothing is compiled a second time.
ignored() { cargo test --workspace --locked "$@"; }
