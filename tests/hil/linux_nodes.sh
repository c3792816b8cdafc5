#!/usr/bin/env bash
# linux_nodes.sh DIRECTORY [TICKS [LEAST_RATE]]: six nodes with a joint each on one virtual bus, in one process and in six, then one
# node with all six joints, then the same with CAN FD. DIRECTORY has the programs.
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
start_batch() {
  chrt --batch 0 "$bin/fxdyn_node" --can vcan0 "$@" &
  pids+=($!)
}

# SCHED_BATCH: the master is not woken for each torque, but when the nodes sleep.
drive() { chrt --batch 0 "$bin/hil_driver" --can vcan0 "$@"; }

start --joint 1 --joint 2 --joint 3 --joint 4 --joint 5 --joint 6
drive --name "6 Linux nodes on vcan, one process" --nodes 6 --ticks "$ticks" --least-rate "$least"
stop_nodes
# SCHED_BATCH for them too: a node is not woken for each of a tick's seven frames, but when all of them are there.
for joint in 1 2 3 4 5 6; do start_batch --joint $joint; done
drive --name "6 Linux nodes on vcan, six processes" --nodes 6 --ticks $((ticks < 1000 ? ticks : 1000))
stop_nodes
start
drive --name "1 Linux node with 6 joints on vcan" --nodes 1 --ticks "$ticks"
stop_nodes
start --fd
drive --name "1 Linux node with 6 joints, CAN FD" --nodes 1 --ticks "$ticks" --fd 1
