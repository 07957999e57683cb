#!/usr/bin/env bash
# Runs a command on a Slurm cluster of one node, this machine, started for it and stopped after it.
#
# usage: slurm_node.sh COMMAND...        as root; needs apt-get install slurmctld slurmd slurm-client munge
#
# Everything it writes is in a temporary folder, but for /etc/slurm/slurm.conf, where jobs look for it; one that
# is there already is left alone, and nothing is started. The node has no accounting; jobs that take more memory
# than they asked for are killed.
set -euo pipefail
for program in munged slurmctld slurmd sbatch; do
    command -v "$program" > /dev/null || {
        echo "$program is missing: apt-get install slurmctld slurmd slurm-client munge" >&2
        exit 1
    }
done
if [[ -e /etc/slurm/slurm.conf ]]; then
    echo "/etc/slurm/slurm.conf is there: this machine has a cluster, run the command without this script" >&2
    exit 1
fi
folder=$(mktemp -d)
chmod 755 "$folder"
started=()
stop() {
    for ((i = ${#started[@]} - 1; i >= 0; i--)); do
        kill "${started[i]}" 2> /dev/null || true
        wait "${started[i]}" 2> /dev/null || true
    done
    [[ $(readlink /etc/slurm/slurm.conf) != "$folder/slurm.conf" ]] || rm /etc/slurm/slurm.conf
    rm -rf "$folder"
}
trap stop EXIT

mkdir -m 700 "$folder/munge"
mkdir "$folder/state" "$folder/spool" "$folder/socket"
head -c 1024 /dev/urandom > "$folder/munge/key"
chmod 400 "$folder/munge/key"
munged --foreground --force --socket "$folder/socket/munge" \
    --key-file "$folder/munge/key" --seed-file "$folder/munge/seed" \
    --pid-file "$folder/munge/pid" --log-file "$folder/munge/log" 2> /dev/null &
started+=($!)

host=$(hostname -s)
memory=$(grep -o "[0-9]*" <(grep MemTotal /proc/meminfo))
cat > "$folder/slurm.conf" << END
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/socket/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
SchedulerParameters=sched_interval=2,bf_interval=2
# squeue says for this long how a job ended.
MinJobAge=300
KillWait=10
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$((memory / 1024 - 1000)) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
END
mkdir -p /etc/slurm
ln -s "$folder/slurm.conf" /etc/slurm/slurm.conf
for _ in $(seq 50); do [[ -S "$folder/socket/munge" ]] && break; sleep 0.1; done
slurmctld -D 2> "$folder/slurmctld.err" &
started+=($!)
slurmd -D 2> "$folder/slurmd.err" &
started+=($!)
for _ in $(seq 100); do
    [[ $(sinfo -h -o %T 2> /dev/null) == idle ]] && break
    sleep 0.2
done
if [[ $(sinfo -h -o %T) != idle ]]; then
    tail -n 20 "$folder"/*.log "$folder"/*.err >&2
    echo "the node did not start" >&2
    exit 1
fi
"$@"
