#!/usr/bin/env bash
# one_node_slurm.sh ROOT DIR COMMAND..: runs COMMAND beside a Slurm of this machine alone, with DIR for its state, and ends it
# afterwards. ROOT holds Debian's packages slurmctld, slurmd, slurm-client, slurm-wlm-basic-plugins and libmunge2, unpacked
# (apt-get download, dpkg -x) or installed (then ROOT is /). No authentication, loopback only: for tests.
# In COMMAND, SLURM_TEST_CONTROLLER is a script that ends the controller with kill -9 and starts it again.
set -eu
root=$(realpath "$1") dir=$(realpath -m "$2")
shift 2
mkdir -p "$dir/state" "$dir/spool" "$dir/bin"
plugins=$root/usr/lib/x86_64-linux-gnu/slurm-wlm
export SLURM_CONF=$dir/slurm.conf LD_LIBRARY_PATH=$plugins:$root/usr/lib/x86_64-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
cat >"$SLURM_CONF" <<CONF
ClusterName=test
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=${SLURM_TEST_PORT:-16817}
SlurmdPort=$((${SLURM_TEST_PORT:-16817} + 1))
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
PluginDir=$plugins
MailProg=/bin/true
ReturnToService=2
SlurmdParameters=config_overrides
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=night Nodes=$(hostname -s) Default=YES MaxTime=INFINITE State=UP
CONF
cat >"$dir/controller" <<SH
#!/usr/bin/env bash
[ ! -e "$dir/controller.pid" ] || kill -9 "\$(cat "$dir/controller.pid")" || true
"$root/usr/sbin/slurmctld-wlm" -D >>"$dir/controller.txt" 2>&1 &
echo \$! >"$dir/controller.pid"
SH
export PATH=$root/usr/bin:$PATH SLURM_TEST_CONTROLLER=$dir/controller
chmod +x "$dir/controller"
"$dir/controller"
"$root/usr/sbin/slurmd-wlm" -D -d "$root/usr/sbin/slurmstepd-wlm" >"$dir/slurmd.txt" 2>&1 &
node=$!
# A controller that has lost its last seconds finds jobs on the node that it does not know, and drains it. An administrator
# takes it back.
while sleep 2; do
  ! sinfo -h -o %T 2>/dev/null | grep -q '^drain' || scontrol update NodeName="$(hostname -s)" State=RESUME || true
done >"$dir/administrator.txt" 2>&1 &
administrator=$!
finish() {
  kill -9 $administrator $node "$(cat "$dir/controller.pid")" 2>/dev/null || true
  while kill -0 $node || kill -0 "$(cat "$dir/controller.pid")"; do sleep 0.1; done 2>/dev/null
}
trap finish EXIT
for _ in $(seq 100); do
  sinfo -h -o %t 2>/dev/null | grep -qx idle && ready=1 && break
  sleep 0.3
done
[ -n "${ready:-}" ] || { echo "no node is ready; see $dir"; tail -5 "$dir"/slurm*.log; exit 1; }
"$@"
