#!/usr/bin/env bash
# replay.sh FXDYN DIRECTORY prepare: identifies a small robot and builds the drive node with its tables, in DIRECTORY.
# replay.sh FXDYN DIRECTORY: replays over CAN to nodes with them: in lockstep, in the loop with a simulated robot, everything that can
# be wrong, and the host's end in mid-stream.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
fxdyn=$1 work=$2
step() { echo "[$SECONDS s] $*"; }
if [ "${3:-}" = prepare ]; then
  rm -rf "$work/out"
  mkdir -p "$work"
  cp "$root"/tests/support/elastic_arm/* "$work/"
  cd "$work"
  step "identify"
  "$fxdyn" export arm.project --out out >/dev/null 2>&1
  # a controller for the robot in the loop; `fxdyn vibration` would look for the best one first
  cat >out/vibration.json <<'JSON'
{"schema": "fxdyn.vibration/1", "made_from": {"logs": {}}, "methods": [],
 "control": {"bandwidth_hz": 24, "damping": 0.5, "tick_s": 0.002, "encoder_step": 0, "settling_band": 2e-5}}
JSON
  step "build the node"
  "$root/toolchains/build_node.sh" out/tables.hpp node
  step "done"
  exit
fi
if [ "${FXDYN_INSIDE:-0}" = 0 ]; then
  FXDYN_INSIDE=1 exec "$here/on_can.sh" --output "$work/inside" -- "$here/replay.sh" "$fxdyn" "$work"
fi

. "$here/interfaces.sh"
cd "$work"
# Results are written beside the model: a copy in memory.
copy=$(mktemp -d)
cp -r "$work"/arm.* "$work/out" "$copy"
cd "$copy"
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
replay() { "$fxdyn" replay arm.project --out out --can vcan0 "$@"; }
# refused EXIT_CODE EXPECTED ARGUMENT..; OUT: another directory than out
refused() {
  local code=0
  "$fxdyn" replay arm.project --out "${OUT:-out}" "${@:3}" >refused.txt 2>&1 || code=$?
  [ $code -eq "$1" ] || fail "${*:3}: exit code $code"
  [ "$(grep -c '^fxdyn: ' refused.txt)" -eq 1 ] && tail -1 refused.txt | grep -q "$2" || fail "${*:3}: $(cat refused.txt)"
}
stop_node() {
  kill $node 2>/dev/null || true
  wait $node 2>/dev/null || true
}
# heard SECONDS FRAME: a frame as candump -L prints it is in bus.log, now or within so long
heard() {
  for _ in $(seq $((10 * $1))); do ! grep -qE " $2\$" bus.log || return 0; sleep 0.1; done
  return 1
}
# ends_by SIGNAL: a replay ends by it in mid-stream. bus.log is what was on the bus since then.
ends_by() {
  candump -L vcan0 >bus.log &
  local log=$!
  "$fxdyn" replay arm.project --out out --can vcan0 --ticks 1000000 >/dev/null 2>&1 &  # no function: $! is the program
  local host=$!
  heard 120 '181#[0-9A-F]*' || fail "no torque came"
  : >bus.log
  kill -s "$1" $host
  wait $host 2>/dev/null && fail "SIG$1 did not end it" || true
  "ended_by_$1"
  kill $log
  wait $log 2>/dev/null || true
}
# The host stops the node, and no torque goes out any more.
ended_by_TERM() {
  heard 30 '000#8001' || fail "SIGTERM: the host did not stop the node"
  heard 30 '701#7F' || fail "SIGTERM: the node goes on"
  : >bus.log
  sleep 0.5
  ! grep -q ' 181#' bus.log || fail "SIGTERM: torques still go out"
}
# The node misses the host: EMCY 0x8130, and 127 is who it misses. SYNC is not overdue yet, and the torque goes to zero all the same.
ended_by_KILL() {
  heard 60 '081#3081117F00.*' || fail "SIGKILL: the node does not miss its host: $(tail -n 3 bus.log)"
  for _ in $(seq 20); do
    cansend vcan0 601#4011210100000000
    ! heard 1 '581#4311210100000000' || return 0
  done
  fail "SIGKILL: the torque does not go to zero: $(grep ' 581#' bus.log | tail -n 1)"
}

trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
step "bad interfaces, nobody there"
refused 2 'no interface can9' --can can9
refused 2 'ip link set vcan2' --can vcan2
refused 2 'no node answers' --can vcan0
OUT=nowhere refused 2 'there is no model: run .fxdyn run' --can vcan0
[ ! -e nowhere/model.json ] || fail "a model was made where there was none"
step "one node"
start_node "$work/node/fxdyn_node"
replay --ticks 500 || fail "replay"
grep -q '"bit_exact": true' out/can_replay.json || fail "the torques differ"
step "closed loop"
replay --closed-loop --moves 1 || fail "closed loop"
grep -q '"numbers": "drive"' out/can_replay.json || fail "no drive in the loop"
# What the drive puts out in the loop is the host's fixed point, bit for bit, in every tick. The host's own run has setpoints that did
# not come over a bus; exact encoders, as steps would part any two runs.
python3 -c '
import json
replay = json.load(open("out/can_replay.json"))
assert replay["bit_exact"] and replay["equal_ticks"] == replay["ticks"] > 500, replay["ticks"]
rows = {(m["feedforward"], m["numbers"]): m["moves"]["all"] for m in replay["closed_loop"]["methods"]}
driven = [name for name, numbers in rows if numbers == "drive"]
assert driven, rows
for name in driven:
    for figure in ("tracking_motor", "tracking_link", "residual"):
        assert abs(rows[name, "drive"][figure] / rows[name, "fixed"][figure] - 1) < 0.01, (name, figure, rows)
' || fail "the torques in the loop differ from the host"
# the motors follow to 0.05 mrad on average, which takes the feedforward: without it they are 0.2 off and more
python3 -c '
import json
loop = json.load(open("out/can_replay.json"))["closed_loop"]["methods"][-1]["moves"]["all"]
assert loop["tracking_motor"] < 0.05, loop' || fail "tracking in the loop"
step "the host ends in mid-stream"
ends_by TERM
ends_by KILL
stop_node
step "two nodes with a joint each"
start_node "$work/node/fxdyn_node" --joint 1 --joint 2
replay --ticks 300 || fail "replay to two nodes"
grep -q '"bit_exact": true' out/can_replay.json || fail "the torques of two nodes differ"
stop_node
step "a node for another robot"
start_node "$work/../fxdyn_node"
refused 2 'a robot of 6 joints' --can vcan0
step "done"
exit $failures
