#!/usr/bin/env bash
# Exports of runs of several kinds, read by the programs that they are for: ArviZ 0.x with cmdstanpy, ArviZ from 1.0 on, R's rstan
# and posterior. Each holds what it finds against the run's own results. Needs a CALIBRATE, and installs the readers where it can
# (Python packages into target/exports, R packages by apt-get as root); what cannot be installed is skipped and says so.
#
#   cargo build && CALIBRATE=target/debug/calibrate tests/exports/run.sh
#
# SHORT=1 leaves R out.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
calibrate=$(realpath "${CALIBRATE:?the command to test}")
tools=$here/../../target/exports
mkdir -p "$tools"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The first Python whose version (3.11 as 311) is within two bounds; of pyenv's too.
python_from_to() {
    for python in python3 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.*/bin/python3 /usr/bin/python3.*; do
        "$python" -c "import sys, venv, ensurepip; v = 100 * sys.version_info[0] + sys.version_info[1]; sys.exit(not $1 <= v <= $2)" \
            2>/dev/null && command -v "$python" && return
    done
    return 1
}
# An environment of a name with packages, made by a Python within two bounds.
environment() {
    local name=$1 python
    python=$(python_from_to "$2" "$3") || { echo "SKIPPED: no Python within $2 to $3 here, for ${*:4}"; return 1; }
    if ! { [ -x "$tools/$name/bin/python" ] || "$python" -m venv "$tools/$name"; } ||
        ! timeout 300 "$tools/$name/bin/python" -m pip install --quiet --disable-pip-version-check "${@:4}"; then
        echo "SKIPPED: ${*:4} cannot be installed here"
        return 1
    fi
}

cd "$work"
"$calibrate" --plan "$here/line.toml" --out line --quiet 2>/dev/null
"$calibrate" --plan "$here/two.toml" --out two --quiet 2>/dev/null
# So many that no process places them: faster than fewer.
"$calibrate" --material ps --samples 8192 --out ps --quiet 2>/dev/null
"$calibrate" --material ps --samples 8192 --noise correlated --out ps-correlated --quiet 2>/dev/null
"$calibrate" --material peek --samples 8192 --noise robust --out peek --quiet 2>/dev/null
"$calibrate" compare --material ps --samples 8192 --noise inferred,correlated --out compare --quiet 2>/dev/null
runs="line two ps ps-correlated peek"
for run in $runs; do
    "$calibrate" export "$run" --format zarr,idata-json,stan-csv,draws-csv --quiet
done

for reader in "py0 310 313 arviz<1 cmdstanpy" "py1 312 399 arviz>=1 zarr matplotlib h5netcdf h5py"; do
    read -r name from to packages <<<"$reader"
    # shellcheck disable=SC2086
    if environment "$name" "$from" "$to" $packages; then
        for run in $runs; do
            "$tools/$name/bin/python" "$here/check.py" "$run" "$run/export" "$tools/pictures" 2>"$work/stderr" ||
                { cat "$work/stderr"; exit 1; }
        done
    fi
done

[ -z "${SHORT:-}" ] || { echo "SHORT: without rstan and posterior"; exit 0; }
has_r() { command -v Rscript >/dev/null && Rscript -e 'stopifnot(all(c("rstan", "posterior", "loo") %in% rownames(installed.packages())))' 2>/dev/null; }
if ! has_r && command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    export DEBIAN_FRONTEND=noninteractive
    timeout 240 sh -c 'apt-get update -qq && apt-get install -y -qq --no-install-recommends r-cran-rstan r-cran-posterior' >/dev/null || true
fi
if ! has_r; then
    echo "SKIPPED: no rstan and posterior in R here"
elif [ ! -e ps/export/expected.csv ]; then
    echo "SKIPPED: rstan and posterior, as no Python has said what to expect"
else
    for run in $runs; do
        Rscript "$here/check.R" "$run/export"
    done
fi
