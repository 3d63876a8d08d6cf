#!/usr/bin/env bash
# Runs a Slurm cluster of two nodes on this machine, to try slurm.sh: Debian's slurm-wlm and munge, and two slurmd.
#
#   scripts/farm/slurm_here.sh start    installs missing packages and starts it
#   scripts/farm/slurm_here.sh stop     stops it
#
# It runs as root in out/slurm, independently of any other cluster of this machine: set SLURM_CONF=out/slurm/slurm.conf
# to use it. It uses no control groups, which containers often lack, so Slurm tracks the processes of a job by their
# parents and does not limit cores or memory.

set -euo pipefail

# shellcheck source=scripts/setup.sh
. "$(dirname "${BASH_SOURCE[0]}")/../setup.sh"

place=$ROOT/out/slurm
export SLURM_CONF=$place/slurm.conf

configure() {
    local host
    host=$(hostname -s)
    mkdir -p "$place"/{state,spool/node1,spool/node2,munge}
    cat >"$SLURM_CONF" <<END
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$place/munge/socket
CredType=cred/munge
StateSaveLocation=$place/state
SlurmdSpoolDir=$place/spool/%n
SlurmctldPidFile=$place/slurmctld.pid
SlurmdPidFile=$place/%n.pid
SlurmctldLogFile=$place/slurmctld.log
SlurmdLogFile=$place/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
KillWait=10
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
NodeName=node[1-2] NodeHostname=$host NodeAddr=127.0.0.1 Port=[17001-17002] CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
}

# running NAME: the process in the file NAME.pid, if it exists and is that program
running() {
    local pid
    pid=$(cat "$place/$1.pid" 2>/dev/null) && grep -qs -e slurm -e munge "/proc/$pid/comm" && echo "$pid"
}

start() {
    [ "$(id -u)" -eq 0 ] || fail 'a cluster starts jobs as other users' 'run it as root'
    command -v slurmctld slurmd munged >/dev/null || apt_install slurm-wlm munge
    configure
    # A separate key, because munge of the system may belong to another cluster.
    [ -s "$place/munge/key" ] || (umask 077 && head -c 128 /dev/urandom >"$place/munge/key")
    running munged >/dev/null || munged --force --key-file="$place/munge/key" --socket="$place/munge/socket" \
        --pid-file="$place/munged.pid" --log-file="$place/munge/log" --seed-file="$place/munge/seed"
    running slurmctld >/dev/null || slurmctld
    local node tries
    for node in node1 node2; do
        running "$node" >/dev/null || slurmd -N "$node"
    done
    for ((tries = 0; tries < 60; tries++)); do
        [ "$(sinfo -h -N -t idle,mixed,allocated -o %N 2>/dev/null | wc -l)" -lt 2 ] || break
        sleep 0.5
    done
    sinfo -N
    say "export SLURM_CONF=$SLURM_CONF"
    [ "$tries" -lt 60 ] || fail 'the nodes do not answer' "the logs in $place say why"
}

stop() {
    local name pid
    for name in node1 node2 slurmctld munged; do
        pid=$(running "$name") || continue
        kill "$pid"
        while kill -0 "$pid" 2>/dev/null && [ "$(ps -o stat= -p "$pid")" != Z ]; do sleep 0.1; done
    done
}

case ${1:-} in
start) start ;;
stop) stop ;;
*) fail "unknown word '${1:-}'" 'slurm_here.sh start, or stop' ;;
esac
