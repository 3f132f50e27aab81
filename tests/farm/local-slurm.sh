#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A Slurm cluster of several nodes on this machine, for tests: all of it in one folder, on 127.0.0.1, without systemd
# and without a line in /etc. As root, from Debian's packages slurmctld, slurmd, slurm-client and munge.
#   local-slurm.sh start DIR NODES [PORT]   then: export SLURM_CONF=DIR/slurm.conf
#   local-slurm.sh kill-node DIR NODE       as if its power had failed: nobody reports anything
#   local-slurm.sh start-node DIR NODE
#   local-slurm.sh restart-controller DIR
#   local-slurm.sh stop DIR
# Each node's processes are in a namespace of their own, so that one signal ends them all at once.
# Exit status 77: it cannot be started here.
set -euo pipefail
command=$1 dir=$(readlink -m "$2")
export SLURM_CONF=$dir/slurm.conf PATH=$PATH:/usr/sbin:/sbin
cannot() { echo "SKIPPED: $1" >&2 && exit 77; }

write_config() {  # write_config NODES PORT
  local node host=${HOSTNAME%%.*}
  cat <<END
ClusterName=pounce
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$2
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$dir/munge.socket,cred_expire=5
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd-%n.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd-%n.log
MailProg=/bin/true
MpiDefault=none
SwitchType=switch/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=0
DependencyParameters=kill_invalid_depend
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
JobRequeue=1
ReturnToService=2
SlurmdTimeout=10
KillWait=5
SlurmdParameters=config_overrides
END
  for ((node = 1; node <= $1; ++node)); do
    echo "NodeName=n$node NodeHostname=$host NodeAddr=127.0.0.1 Port=$(($2 + node)) CPUs=2 RealMemory=4000"
  done
  echo "PartitionName=main Nodes=n[1-$1] Default=YES MaxTime=INFINITE State=UP"
}

start_node() {
  mkdir -p "$dir/spool-$1"
  setsid unshare --pid --fork --kill-child --mount-proc slurmd -D -f "$SLURM_CONF" -N "$1" \
    </dev/null >"$dir/node-$1.log" 2>&1 &
  echo $! >"$dir/node-$1.pid"
}

nodes_up() { sinfo -h -N -t idle,alloc,mix -o %N 2>/dev/null | sort -u | wc -l; }

wait_for_nodes() {
  local try
  for try in $(seq 300); do
    [[ $(nodes_up) == "$1" ]] && return 0
    sleep 0.1
  done
  cat "$dir"/*.log >&2
  echo "the cluster did not come up" >&2
  return 1
}

case $command in
  start)
    nodes=$3 port=${4:-$((20000 + RANDOM % 20000))}
    for program in munged slurmctld slurmd sbatch unshare; do
      command -v $program >/dev/null || cannot "$program is not installed"
    done
    [[ $(id -u) == 0 ]] || cannot "not root"
    unshare --pid --fork --mount-proc true 2>/dev/null || cannot "no namespaces here"
    mkdir -p "$dir/state" && chmod 755 "$dir"
    write_config "$nodes" "$port" >"$SLURM_CONF"
    (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
    munged --force --key-file="$dir/munge.key" --socket="$dir/munge.socket" --pid-file="$dir/munged.pid" \
      --log-file="$dir/munged.log" --seed-file="$dir/munge.seed" 2>/dev/null
    slurmctld -f "$SLURM_CONF"
    for ((node = 1; node <= nodes; ++node)); do start_node "n$node"; done
    wait_for_nodes "$nodes"
    ;;
  kill-node)
    # The parent goes with its only child, the first process of the namespace.
    kill -KILL "$(cat "$dir/node-$3.pid")"
    ;;
  start-node) start_node "$3" ;;
  restart-controller)
    kill -TERM "$(cat "$dir/slurmctld.pid")"
    while pgrep -F "$dir/slurmctld.pid" >/dev/null 2>&1; do sleep 0.1; done
    slurmctld -f "$SLURM_CONF"
    ;;
  stop)
    timeout 10 scancel --user=root >/dev/null 2>&1 || true
    for pid in "$dir"/node-*.pid "$dir/slurmctld.pid" "$dir/munged.pid"; do
      [[ ! -e $pid ]] || kill -KILL "$(cat "$pid")" 2>/dev/null || true
    done
    ;;
  *) echo "usage: see the head of this file" >&2 && exit 2 ;;
esac
