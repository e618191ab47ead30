#!/usr/bin/env bash
# Calibrations on a real Slurm of two nodes (cluster.sh), with everything that can happen to one; each must end with the
# same bytes of the posterior as with runs by processes of this machine. Needs slurm-wlm and munge (cluster.sh install).
#
#   tests/slurm/run.sh [CASE...]             all cases, or those named
#   CALIBRATE=FILE tests/slurm/run.sh        with a command that is built already
#   LEVEL=runs tests/slurm/run.sh [CASE...]  without the calibration: the runs alone, by crates/campaign/examples/drive.rs
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
here=$PWD/tests/slurm
cluster=$here/cluster.sh
simulator=$here/simulator.sh

if ! lacking=$("$cluster" missing); then
    echo "skipped: not installed: $lacking (as root: tests/slurm/cluster.sh install)"
    exit "${SKIPPED:-0}"
fi

level=${LEVEL:-posterior}
# Where the outcomes are kept in the folder of a run.
journal=campaign/results.jsonl
[ "$level" = posterior ] || journal=results.jsonl
target=${CARGO_TARGET_DIR:-$PWD/target}/debug
if [ "$level" = runs ]; then
    cargo build --locked --quiet -p campaign --example drive
elif [ -z "${CALIBRATE:-}" ]; then
    cargo build --locked --quiet -p calibrate
fi
calibrate=${CALIBRATE:-$target/calibrate}
scratch=$(mktemp -d)
export SIM_LOG="" SIM_SECONDS=0 SIM_FAIL="" SIM_HANG="" RUN_TIMEOUT_S=60 PARTITION=main
runs=16

finish() {
    local status=$?
    trap - EXIT
    if ((status != 0)); then
        exec >&2
        echo "FAILED: case ${case:-none}; the end of the driver's words:"
        tail -n 30 "$scratch/${case:-none}.log" 2>/dev/null || true
        tail -n 30 "$scratch/cluster/ctld.log" 2>/dev/null || true
    fi
    "$cluster" down "$scratch/cluster" 2>/dev/null || true
    rm -rf "$scratch"
    exit "$status"
}
trap finish EXIT
fail() { echo "$*" >&2; exit 1; }

# launch CASE EXECUTOR: becomes the driver of a run in the case's directory, one that begins or goes on.
launch() {
    local dir=$scratch/$1 plan=$scratch/$1-$2.toml
    exec 2>>"$scratch/$1.log"
    if [ "$level" = runs ]; then
        export SLURM_SETTINGS="{\"partition\": \"$PARTITION\", \"chunk\": 2, \"poll_min_s\": 0.1, \"poll_max_s\": 0.5,
            \"grace_s\": 2, \"command_timeout_s\": 5}"
        exec "$target/examples/drive" "$dir" "$2" "$runs" "$simulator"
    fi
    plan "$2" >"$plan"
    local interrupt=(--on-interrupt "${ON_INTERRUPT:-cancel}")
    if [ -e "$dir/campaign/campaign.json" ]; then
        # shellcheck disable=SC2086
        exec "$calibrate" --resume "$dir" --plan "$plan" "${interrupt[@]}" ${RETRY:-}
    fi
    exec "$calibrate" --plan "$plan" --out "$dir" "${interrupt[@]}"
}
drive() { (launch "$@"); }

plan() {
    cat <<PLAN
name = "slurm"
[parameters.x]
distribution = "uniform"
lower = 0.5
upper = 1.5
[experiments.sine.simulator]
kind = "command"
argv = ["$simulator", "{x}", "{run}"]
timeout_s = $RUN_TIMEOUT_S
[experiments.sine.observables.y]
table = "sine.csv"
control = "t"
noise = { kind = "fixed", sigma = 0.1 }
result = { file = "out.csv", control = "t", value = "y" }
[sampler]
samples = $runs
iterations = 2
seed = 3
[executor]
PLAN
    if [ "$1" = local ]; then
        printf 'kind = "local"\nparallel = 8\n'
    else
        printf 'kind = "slurm"\npartition = "%s"\nchunk = 2\n' "$PARTITION"
        printf 'poll_min_s = 0.1\npoll_max_s = 0.5\ngrace_s = 2\ncommand_timeout_s = 5\n'
        printf 'extra = [%s]\n' "${EXTRA:-}"
    fi
}
printf 't,y\n0.1,0.11\n0.5,0.44\n1,0.87\n' >"$scratch/sine.csv"

# The same outcome as the local executor's with the same simulator.
same_as_local() {
    local expected=local${SIM_FAIL:+-fail}${SIM_HANG:+-hang} result=posterior.json
    [ "$level" = posterior ] || result=table.txt
    if [ ! -d "$scratch/$expected" ]; then
        SIM_SECONDS=0 SIM_LOG="" drive "$expected" local >/dev/null || fail "the local executor failed"
    fi
    diff "$scratch/$expected/$result" "$scratch/$1/$result" || fail "$1: not what the local executor gives"
}

# How often each run was started: fails where one was more often.
each_once() {
    local twice
    twice=$(sort "$SIM_LOG" | uniq -d | tr '\n' ' ')
    [ -z "$twice" ] || fail "$case: started more than once: $twice"
}

# Waits until a condition holds, at most 60 s.
until_true() {
    local deadline=$((SECONDS + 60))
    until "$@"; do
        ((SECONDS < deadline)) || fail "$case: never came true: $*"
        sleep 0.1
    done
}
started() { [ "$(cat "$SIM_LOG" 2>/dev/null | wc -l)" -ge "$1" ]; }
running() { [ "$(squeue --noheader --array --states=running | wc -l)" -ge "$1" ]; }
queue_is_empty() { [ -z "$(squeue --noheader)" ]; }

case_all_succeed() {
    drive "$case" slurm
    same_as_local "$case"
    each_once
}

case_exit_code() {
    SIM_FAIL=5
    drive "$case" slurm
    grep -q '"number":5,.*"exit_code":{"code":7}' "$scratch/$case/$journal" || fail "no exit code"
    same_as_local "$case"
    each_once
}

case_hanging_run() {
    SIM_HANG=4
    RUN_TIMEOUT_S=3
    drive "$case" slurm
    grep -q '"number":4,.*"timeout"' "$scratch/$case/$journal" || fail "no timeout"
    same_as_local "$case"
    # Its whole process group is gone.
    ! pgrep -f "^sleep 98765$" >/dev/null || fail "the run that hung is still there"
}

# The daemons of both nodes are killed and come back soon: jobs go on without them.
case_slurmd_restarted() {
    SIM_SECONDS=2 drive "$case" slurm &
    until_true started 3
    "$cluster" kill "$scratch/cluster" n1
    "$cluster" kill "$scratch/cluster" n2
    sleep 1
    "$cluster" start "$scratch/cluster" n1
    "$cluster" start "$scratch/cluster" n2
    wait $! || fail "the driver failed"
    same_as_local "$case"
    each_once
}

# A node is away for so long that Slurm gives its jobs up.
case_node_lost() {
    SIM_SECONDS=2 drive "$case" slurm &
    until_true started 3
    "$cluster" kill "$scratch/cluster" n1
    until_true eval '[[ $(sinfo --noheader --Node --nodes=n1 --format=%t) = down* ]]'
    "$cluster" start "$scratch/cluster" n1
    wait $! || fail "the driver failed"
    same_as_local "$case"
}

case_slurmctld_restarted() {
    SIM_SECONDS=4 drive "$case" slurm &
    until_true started 3
    "$cluster" kill "$scratch/cluster" ctld
    until_true grep -q 'what runs is not known' "$scratch/$case.log"
    "$cluster" start "$scratch/cluster" ctld
    # It has forgotten what happened in its last seconds, starts jobs again that run already, and drains their nodes.
    # Resuming these is the administrator's part.
    while kill -0 $! 2>/dev/null; do
        resume_nodes
        sleep 0.5
    done
    wait $! || fail "the driver failed"
    same_as_local "$case"
}
resume_nodes() {
    if sinfo --noheader --Node --format=%t | grep -q '^dr'; then
        scontrol update NodeName=n1,n2 State=RESUME || true
    fi
}

case_driver_killed() {
    SIM_SECONDS=2 launch "$case" slurm &
    until_true started 3
    kill -KILL $!
    wait $! 2>/dev/null && fail "it was killed"
    squeue --noheader --array | grep -q . || fail "no jobs go on"
    drive "$case" slurm
    grep -q 'in Slurm.s queue already' "$scratch/$case.log" || fail "jobs were not taken up"
    same_as_local "$case"
    each_once
}

case_driver_killed_often() {
    local attempt pid
    for attempt in 1 2 3 4 5 6 7 8; do
        launch "$case" slurm &
        pid=$!
        sleep "0.$((RANDOM % 5))$((RANDOM % 10))"
        kill -KILL "$pid" 2>/dev/null || true
        wait "$pid" 2>/dev/null || true
    done
    drive "$case" slurm
    same_as_local "$case"
}

case_user_scancel() {
    SIM_SECONDS=2 drive "$case" slurm &
    until_true started 3
    scancel --user="$(id -un)"
    wait $! || fail "the driver failed"
    grep -q 'was cancelled' "$scratch/$case.log" || fail "the driver does not say so"
    same_as_local "$case"
}

case_two_drivers() {
    SIM_SECONDS=1 drive "$case" slurm &
    until_true started 1
    ! drive "$case" slurm || fail "the second one ran"
    grep -q 'in use by' "$scratch/$case.log" || fail "the second one does not say why"
    wait $! || fail "the first one failed"
    same_as_local "$case"
    each_once
}

case_interrupted() {
    launch "$case" slurm &
    until_true queue_has_jobs
    kill -TERM $!
    wait $! && fail "it was interrupted"
    until_true queue_is_empty
    drive "$case" slurm
    same_as_local "$case"
}
queue_has_jobs() { ! queue_is_empty; }

case_detached() {
    SIM_SECONDS=1 DETACH=1 ON_INTERRUPT=detach launch "$case" slurm &
    until_true started 2
    kill -TERM $!
    wait $! && fail "it was interrupted"
    # The jobs come to their end without a driver.
    until_true queue_is_empty
    each_once
    drive "$case" slurm
    same_as_local "$case"
    each_once
}

# A run that failed is made once more, by jobs whose driver leaves; stages that had counted it are placed again.
case_retried() {
    SIM_FAIL=5
    drive "$case" slurm
    SIM_FAIL=""
    SIM_SECONDS=1 RETRY=--retry-failed ON_INTERRUPT=detach launch "$case" slurm &
    until_true queue_has_jobs
    kill -TERM $!
    wait $! && fail "it was interrupted"
    drive "$case" slurm
    same_as_local "$case"
}

# A QOS that takes two jobs of a user at most: all runs are made, a few at a time.
case_qos_limit() {
    EXTRA='"--qos=tiny"' drive "$case" slurm
    grep -q 'QOSMaxSubmitJobPerUserLimit' "$scratch/$case.log" || fail "the limit was not met"
    same_as_local "$case"
    each_once
    [ "$(sacct --noheader --allocations --format=QOS%20 | grep -c tiny)" -ge 2 ] || fail "no job in this QOS"
}

case_refused() {
    ! PARTITION=nope drive "$case" slurm || fail "there is no such partition"
    grep -q 'invalid partition specified: nope' "$scratch/$case.log" || fail "Slurm's words are missing"
    drive "$case" slurm
    same_as_local "$case"
}

# The cases "$@" on a cluster of their own.
on_a_cluster() {
    MAX_ARRAY_SIZE=5 SLURMD_TIMEOUT=5 "$cluster" up "$scratch/cluster" >"$scratch/up.log" 2>&1 </dev/null ||
        fail "no cluster: $(cat "$scratch/up.log")"
    # shellcheck source=/dev/null
    source "$scratch/cluster/env"
    for case in "$@"; do
        begin=$SECONDS
        resume_nodes
        SIM_LOG=$scratch/$case.starts SIM_FAIL="" SIM_HANG="" SIM_SECONDS=0 RUN_TIMEOUT_S=60
        rm -rf "${scratch:?}/$case" "$SIM_LOG" "$scratch/$case.log"
        "case_$case" >/dev/null
        until_true queue_is_empty
        echo "ok: $case${ACCOUNTING:+ with accounts} ($((SECONDS - begin)) s)"
    done
    case=""
    "$cluster" down "$scratch/cluster"
}

if (($#)); then
    on_a_cluster "$@"
else
    on_a_cluster all_succeed exit_code hanging_run slurmd_restarted node_lost slurmctld_restarted driver_killed \
        driver_killed_often user_scancel two_drivers interrupted detached retried refused
    export ACCOUNTING=1
    if lacking=$("$cluster" missing); then
        on_a_cluster all_succeed exit_code node_lost user_scancel interrupted qos_limit
    else
        echo "skipped: the cases with accounts; not installed: $lacking (as root: tests/slurm/cluster.sh install)"
    fi
fi
echo "passed on Slurm: ${*:-all cases} ($SECONDS s)"
