#!/usr/bin/env bash
# The Python part: a wheel is built, installed into empty environments of every Python from 3.10 on that is here, and run there
# without Rust; then the module's tests, its types, its notebooks. Needs Rust, a Python and PyPI; what is not to be had is SKIPPED.
#
#   crates/python/test.sh            all
#   SHORT=1 crates/python/test.sh    by the oldest and the newest Python, without notebooks, the guide's code and the packages that need an environment of their own
#   crates/python/test.sh ARGS...    the module's tests alone, with these arguments for pytest
#   PYTHONS="FILE..." crates/python/test.sh   with these interpreters
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
root=$PWD
work=$root/${CARGO_TARGET_DIR:-target}/python
case ${CARGO_TARGET_DIR:-target} in /*) work=$CARGO_TARGET_DIR/python ;; esac
export PIP_DISABLE_PIP_VERSION_CHECK=1 PYTHONDONTWRITEBYTECODE=1
unset PYTHONPATH VIRTUAL_ENV

step() { printf -- '-- %s (at %s s)\n' "$1" "$SECONDS"; }
skip() { echo "SKIPPED: $*"; }
quietly() { "$@" >"$work/log" 2>&1 || { cat "$work/log"; return 1; }; }

# One interpreter of each minor version from 3.10 on, with the lock that the stable interface needs.
interpreters() {
    local minor candidate
    for minor in 10 11 12 13 14 15; do
        for candidate in "python3.$minor" "$HOME"/.pyenv/versions/3."$minor".*/bin/python python3; do
            if "$candidate" -c "import sys, sysconfig, venv, ensurepip
sys.exit(sys.version_info[:2] != (3, $minor) or bool(sysconfig.get_config_var('Py_GIL_DISABLED')))" 2>/dev/null; then
                "$candidate" -c "import os, sys; print(os.path.realpath(sys.executable))"
                break
            fi
        done
    done
}
read -ra pythons <<<"${PYTHONS:-$(interpreters | tr '\n' ' ')}"
if [ "${#pythons[@]}" = 0 ]; then
    skip "no Python from 3.10 on with venv here (Debian: python3-venv)"
    exit 0
fi
short=${SHORT:-}
[ -z "$short" ] || [ "${#pythons[@]}" = 1 ] || pythons=("${pythons[0]}" "${pythons[-1]}")
mkdir -p "$work"
last=${pythons[-1]}
version() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])'; }

# environment NAME PYTHON PACKAGE...: an environment with these packages, new each time.
environment() {
    local folder=$work/$1 python=$2
    shift 2
    rm -rf "$folder"
    "$python" -m venv "$folder"
    [ $# = 0 ] || quietly "$folder/bin/python" -m pip install --quiet "$@"
}

step "the wheel, by $(version "$last")"
if ! environment build "$last" 'maturin>=1.9,<2'; then
    skip "PyPI is not to be had here: maturin cannot be installed"
    exit 0
fi
rm -rf "$work/wheels"
quietly env PATH="$work/build/bin:$PATH" "$work/build/bin/python" -m pip wheel --no-deps --no-build-isolation -w "$work/wheels" crates/python
wheel=$(echo "$work"/wheels/*.whl)
bytes=$(stat -c %s "$wheel" 2>/dev/null || stat -f %z "$wheel")
echo "$(basename "$wheel"): $bytes bytes"
[ "$bytes" -lt 15000000 ] || { echo "FAILED: a wheel of $bytes bytes, and 15 MB are allowed"; exit 1; }

# Without Rust: nothing of it on the PATH, nor in HOME.
bare() { env -i HOME="$work/home" PATH=/usr/bin:/bin LANG=C.UTF-8 "$@"; }
same() {
    for name in posterior.json samples.csv draws.csv table.md; do
        cmp "$1/$name" "$2/$name"
    done
}

if [ $# = 0 ]; then
    step "the command of cargo, for comparison"
    rm -rf "$work/home" "$work/by-cargo" "$work/impact-by-cargo"
    mkdir -p "$work/home"
    cargo=$(cargo build --release --locked --quiet -p calibrate --message-format json | sed -n 's/.*"executable":"\([^"]*\)".*/\1/p')
    "$cargo" --material ps --quiet --out "$work/by-cargo"
    "$cargo" --plan experiments/external/impact.toml --quiet --out "$work/impact-by-cargo"
    for python in "${pythons[@]}"; do
        name=$(version "$python")
        step "Python $name: installed into an empty environment, and run"
        environment "py$name" "$python" "$wheel"
        here=$work/py$name
        rm -rf "$work/by-wheel" "$work/impact-by-wheel"
        bare "$here/bin/calibrate" --material ps --quiet --out "$work/by-wheel"
        same "$work/by-cargo" "$work/by-wheel"
        bare "$here/bin/python" -c "import calibrate as cal; assert cal.material('ps').calibrate().record == cal.read('$work/by-cargo').record"
    done
    step "a plan with a program, its runs on this machine"
    bare "$work/py$(version "$last")/bin/calibrate" --plan experiments/external/impact.toml --quiet --out "$work/impact-by-wheel"
    same "$work/impact-by-cargo" "$work/impact-by-wheel"
    step "a plan with a program, its runs by Slurm"
    if [ -n "$short" ]; then
        skip "this is the short form"
    elif tests/slurm/cluster.sh missing >/dev/null; then
        CALIBRATE=$work/py$(version "$last")/bin/calibrate timeout 300 tests/slurm/run.sh all_succeed exit_code
    else
        skip "Slurm is not installed here"
    fi
fi

step "the module's tests, by $(version "$last")"
if ! environment tests "$last" "$wheel" pytest tqdm mypy nbclient nbformat ipykernel; then
    skip "PyPI is not to be had here: pytest cannot be installed"
    exit 0
fi
quietly "$work/tests/bin/python" -m pip install --quiet arviz xarray netcdf4 || skip "arviz cannot be installed: its tests say so"
if [ $# = 0 ]; then
    (cd crates/python && "$work/tests/bin/python" -m mypy --strict --cache-dir "$work/mypy" python/calibrate)
    (cd "$work" && tests/bin/python -m mypy --strict --cache-dir mypy "$root/crates/python/tests/typed.py")
fi
tested() {
    local python=$work/$1/bin/python
    shift
    (cd crates/python && "$python" -m pytest -p no:cacheprovider "$@")
}
if [ $# != 0 ]; then
    tested tests "$@"
    exit 0
elif [ -n "$short" ]; then
    tested tests --ignore tests/test_notebooks.py --ignore tests/test_guide.py
    skip "notebooks, the guide's code, GrainLearning and ArviZ below 1: this is the short form"
    exit 0
fi
tested tests

# also NAME PYTHON PACKAGE TEST: a test with a package that does not go with the others in one environment.
also() {
    step "$4 with $3, by $(version "$2")"
    if environment "$1" "$2" "$wheel" pytest "$3" netcdf4; then
        tested "$1" "tests/$4"
    else
        skip "$3 cannot be installed by $(version "$2")"
    fi
}
# GrainLearning wants numpy below 2; ArviZ below 1 is what older Pythons get.
also grainlearning "${pythons[0]}" grainlearning test_grainlearning.py
also arviz0 "${pythons[0]}" 'arviz<1' test_arviz.py
