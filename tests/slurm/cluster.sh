#!/usr/bin/env bash
# A Slurm of two nodes on this machine's loopback interface, without systemd and without cgroups: for tests, and to try
# `calibrate` with Slurm before it meets a real cluster. All its files, keys, sockets and logs are in one directory.
#
#   tests/slurm/cluster.sh install            installs Debian's packages (as root): slurm-wlm, munge, slurmdbd, mariadb-server
#   tests/slurm/cluster.sh up DIR             makes the cluster in DIR and waits until both nodes are idle
#   source DIR/env                            sbatch, squeue, ... of this shell now speak to it
#   tests/slurm/cluster.sh kill DIR WHAT      kills a daemon as a crash would: n1, n2 or ctld
#   tests/slurm/cluster.sh start DIR WHAT     starts it again
#   tests/slurm/cluster.sh down DIR           ends all jobs and daemons, and removes DIR
#
# Runs as root or as an ordinary user. Variables: MAX_ARRAY_SIZE (1001), NODE_CPUS (4), SLURMD_TIMEOUT (10 s: after that a
# node whose slurmd is silent is down, and its jobs are lost). With ACCOUNTING=1 it keeps accounts in a database of its own (slurmdbd, mariadbd), so
# that sacct answers, and has a QOS named tiny that takes two jobs of a user at most.
set -euo pipefail

export PATH="$PATH:/usr/sbin:/sbin"
needed=(munged slurmctld slurmd sbatch squeue scontrol scancel sinfo)
accounting=(slurmdbd sacctmgr mariadbd mariadb-install-db mariadb)
[ "${ACCOUNTING:-}" != 1 ] || needed+=("${accounting[@]}")

say() { printf 'cluster: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

# Runs "$@" until it succeeds, for at most $2 seconds; says what for.
wait_for() {
    local what=$1 seconds=$2 deadline log
    shift 2
    say "waiting for $what"
    deadline=$((SECONDS + seconds))
    until "$@" >/dev/null 2>&1; do
        if ((SECONDS >= deadline)); then
            for log in "$dir"/*.log; do echo "== $log"; tail -n 20 "$log"; done >&2 || true
            die "$what: not within $seconds s; the ends of the logs are above"
        fi
        sleep 0.1
    done
}

# A run of five ports that nothing listens on.
free_ports() {
    local base i
    for _ in $(seq 100); do
        base=$((20000 + RANDOM % 12000))
        for i in 0 1 2 3 4; do
            if (exec 3<>"/dev/tcp/127.0.0.1/$((base + i))") 2>/dev/null; then continue 2; fi
        done
        echo "$base"
        return
    done
    die "no free ports between 20000 and 32000"
}

install_packages() {
    needed+=("${accounting[@]}")
    if missing >/dev/null; then say "the packages are here"; return; fi
    command -v apt-get >/dev/null || die "no apt-get here: install Slurm (slurmctld, slurmd) and munge by hand"
    [ "$(id -u)" = 0 ] || die "not root: sudo apt-get install --no-install-recommends slurm-wlm munge slurmdbd mariadb-server"
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends slurm-wlm munge slurmdbd mariadb-server >/dev/null
}

# Succeeds when nothing is missing; names what is.
missing() {
    local program lacking=()
    for program in "${needed[@]}"; do
        command -v "$program" >/dev/null || lacking+=("$program")
    done
    ((${#lacking[@]} == 0)) && return 0
    echo "${lacking[*]}"
    return 1
}

write_configuration() {
    local base user host version accounts="AccountingStorageType=accounting_storage/none"
    base=$(free_ports)
    user=$(id -un)
    host=$(hostname -s)
    if [ "${ACCOUNTING:-}" = 1 ]; then
        accounts="AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=127.0.0.1
AccountingStoragePort=$((base + 3))
AccountingStoragePass=$dir/munge.socket
AccountingStorageEnforce=associations,limits,qos"
        (umask 077 && cat >"$dir/slurmdbd.conf") <<CONF
DbdHost=localhost
DbdAddr=127.0.0.1
DbdPort=$((base + 3))
SlurmUser=$user
AuthType=auth/munge
AuthInfo=socket=$dir/munge.socket
StorageType=accounting_storage/mysql
StorageHost=127.0.0.1
StoragePort=$((base + 4))
StorageUser=slurm
StoragePass=slurm
StorageLoc=slurm
LogFile=$dir/dbd.log
PidFile=$dir/dbd.pid
CONF
        echo "$((base + 4))" >"$dir/db.port"
    fi
    cat >"$dir/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$user
SlurmdUser=$user
SlurmctldPort=$base
AuthType=auth/munge
AuthInfo=socket=$dir/munge.socket
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
$accounts
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
SchedulerType=sched/builtin
SchedulerParameters=batch_sched_delay=0,sched_interval=2
MaxArraySize=${MAX_ARRAY_SIZE:-1001}
MinJobAge=3600
ReturnToService=2
SlurmctldTimeout=10
SlurmdTimeout=${SLURMD_TIMEOUT:-10}
MessageTimeout=5
InactiveLimit=0
KillWait=2
SlurmctldPidFile=$dir/ctld.pid
SlurmctldLogFile=$dir/ctld.log
SlurmdPidFile=$dir/%n.pid
SlurmdLogFile=$dir/%n.log
SlurmdSpoolDir=$dir/spool-%n
StateSaveLocation=$dir/state
SlurmdParameters=config_overrides
NodeName=n1 NodeAddr=127.0.0.1 NodeHostname=$host Port=$((base + 1)) CPUs=${NODE_CPUS:-4} RealMemory=4000
NodeName=n2 NodeAddr=127.0.0.1 NodeHostname=$host Port=$((base + 2)) CPUs=${NODE_CPUS:-4} RealMemory=4000
PartitionName=main Nodes=n1,n2 Default=YES MaxTime=60 DefaultTime=10 OverSubscribe=NO
CONF
    # Newer versions look for cgroups even where no plug-in uses them, unless they are told not to.
    version=$(slurmctld -V | sed 's/[^0-9]*\([0-9]*\).*/\1/')
    if ((version >= 23)); then
        echo "CgroupPlugin=disabled" >"$dir/cgroup.conf"
    fi
    cat >"$dir/env" <<ENV
export SLURM_CONF='$dir/slurm.conf'
ENV
}

# Daemons carry a mark in their environment, by which `down` finds the processes of this cluster and no others.
mark() { env "LOOPBACK_SLURM=$dir" "$@"; }

start() {
    case $1 in
        munge)
            # Forced: it would refuse a directory that only its owner may enter.
            mark munged --force --key-file="$dir/munge.key" --socket="$dir/munge.socket" --pid-file="$dir/munge.pid" \
                --log-file="$dir/munge.log" --seed-file="$dir/munge.seed" --num-threads=2
            wait_for "munged" 10 munge --no-input --socket="$dir/munge.socket"
            ;;
        db)
            mariadb-install-db --no-defaults --datadir="$dir/db" --user="$(id -un)" --auth-root-authentication-method=normal \
                --skip-test-db >"$dir/db-install.log"
            mark mariadbd --no-defaults --datadir="$dir/db" --user="$(id -un)" --socket="$dir/db.socket" \
                --bind-address=127.0.0.1 --port="$(cat "$dir/db.port")" --pid-file="$dir/db.pid" --log-error="$dir/db.log" \
                --innodb-buffer-pool-size=32M --innodb-lock-wait-timeout=900 >/dev/null 2>&1 &
            wait_for "mariadbd" 30 mariadb --no-defaults --socket="$dir/db.socket" --user=root --execute="select 1"
            mariadb --no-defaults --socket="$dir/db.socket" --user=root --execute="create database slurm;
                create user slurm@'127.0.0.1' identified by 'slurm'; create user slurm@localhost identified by 'slurm';
                grant all on slurm.* to slurm@'127.0.0.1'; grant all on slurm.* to slurm@localhost"
            ;;
        dbd)
            mark slurmdbd
            wait_for "slurmdbd" 30 sacctmgr --noheader --parsable2 list cluster
            sacctmgr --immediate add cluster loopback
            sacctmgr --immediate add qos tiny set MaxSubmitJobsPerUser=2
            sacctmgr --immediate add account tests Cluster=loopback
            sacctmgr --immediate add user "$(id -un)" Account=tests Cluster=loopback
            sacctmgr --immediate modify user "$(id -un)" set qos+=tiny
            ;;
        ctld)
            mark slurmctld
            wait_for "slurmctld" 20 scontrol ping
            ;;
        n1 | n2)
            mark slurmd -N "$1"
            wait_for "node $1 to be up" 30 node_is_up "$1"
            ;;
        *) die "start $1: unknown; munge, ctld, n1 or n2" ;;
    esac
}

node_is_up() { [[ $(sinfo --noheader --Node --nodes="$1" --format=%t) =~ ^(idle|mix|alloc|comp)$ ]]; }

kill_daemon() {
    local pid
    pid=$(cat "$dir/$1.pid" 2>/dev/null) || die "kill $1: no $dir/$1.pid"
    kill -KILL "$pid" || die "kill $1: no process $pid"
    # Dead, if not yet buried: a process without a command line is a zombie.
    while [ -n "$(tr -d '\0' 2>/dev/null <"/proc/$pid/cmdline")" ]; do sleep 0.05; done
    rm -f "$dir/$1.pid"
    say "killed $1 (process $pid)"
}

# The processes of this cluster: those that carry its mark, and their descendants (the jobs).
processes() {
    local pid children wave next
    wave=()
    for pid in /proc/[0-9]*; do
        if tr '\0' '\n' <"$pid/environ" 2>/dev/null | grep -qxF "LOOPBACK_SLURM=$dir"; then
            wave+=("${pid#/proc/}")
        fi
    done 2>/dev/null
    while ((${#wave[@]})); do
        printf '%s\n' "${wave[@]}"
        next=()
        for pid in "${wave[@]}"; do
            children=$(cat "/proc/$pid"/task/*/children 2>/dev/null) || true
            # shellcheck disable=SC2206
            next+=($children)
        done
        wave=("${next[@]}")
    done | sort -un
}

up() {
    local lacking
    lacking=$(missing) || die "not installed: $lacking (as root: tests/slurm/cluster.sh install)"
    [ ! -e "$dir/slurm.conf" ] || die "$dir holds a cluster already (take it down first)"
    mkdir -p "$dir/state" "$dir/spool-n1" "$dir/spool-n2"
    chmod 755 "$dir"
    ((${#dir} < 90)) || die "$dir: too long a path for munge's socket"
    write_configuration
    (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
    start munge
    if [ "${ACCOUNTING:-}" = 1 ]; then
        start db
        start dbd >"$dir/accounts.log"
    fi
    start ctld
    mark slurmd -N n1
    start n2
    wait_for "node n1 to be up" 30 node_is_up n1
    say "up; for this shell: source $dir/env"
}

down() {
    local pids signal
    if [ ! -e "$dir/slurm.conf" ]; then say "$dir holds no cluster"; return; fi
    timeout 10 scancel --user="$(id -un)" >/dev/null 2>&1 || true
    for signal in TERM TERM KILL KILL; do
        pids=$(processes)
        [ -n "$pids" ] || break
        # shellcheck disable=SC2086
        kill -s "$signal" $pids 2>/dev/null || true
        for _ in $(seq 30); do
            [ -n "$(processes)" ] || break
            sleep 0.1
        done
    done
    pids=$(processes)
    [ -z "$pids" ] || die "still running: $pids"
    rm -rf "$dir"
    say "down"
}

usage() { sed -n '2,13s/^# \{0,1\}//p' "$0" >&2; exit 2; }

case ${1:-} in
    install) install_packages; exit ;;
    missing) missing; exit ;;
    up | down | start | kill) [ -n "${2:-}" ] || usage ;;
    *) usage ;;
esac
mkdir -p "$2"
dir=$(cd "$2" && pwd -P)
export SLURM_CONF="$dir/slurm.conf"
case $1 in
    up) up ;;
    down) down ;;
    start) start "${3:-}" ;;
    kill) kill_daemon "${3:-}" ;;
esac
