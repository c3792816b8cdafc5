#!/usr/bin/env bash
# linux_nodes.sh DIRECTORY [TICKS [LEAST_RATE]]: six node processes with a joint each on one virtual bus, then one with all six,
# then the same with CAN FD. DIRECTORY has the programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
bin=$1 ticks=${2:-5000} least=${3:-0}
. "$here/interfaces.sh"
pids=()
stop_nodes() {
  [ ${#pids[@]} -eq 0 ] || kill "${pids[@]}" 2>/dev/null || true
  wait
  pids=()
}
trap stop_nodes EXIT
start() {
  "$bin/fxdyn_node" --can vcan0 "$@" &
  pids+=($!)
}

for joint in 1 2 3 4 5 6; do start --joint $joint; done
# SCHED_BATCH: the master is not woken for each torque, but when the nodes sleep.
chrt --batch 0 "$bin/hil_driver" --name "6 Linux nodes on vcan" --can vcan0 --nodes 6 --ticks "$ticks" --least-rate "$least"
stop_nodes
start
"$bin/hil_driver" --name "1 Linux node with 6 joints on vcan" --can vcan0 --nodes 1 --ticks "$ticks"
stop_nodes
start --fd
"$bin/hil_driver" --name "1 Linux node with 6 joints, CAN FD" --can vcan0 --nodes 1 --ticks "$ticks" --fd 1
