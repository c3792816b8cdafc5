#!/usr/bin/env bash
# replay.sh FXDYN DIRECTORY: identifies a small robot, builds the drive node with its tables, and replays over CAN: in lockstep, in
# the loop with a simulated robot, and everything that can be wrong.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
fxdyn=$1 work=$2
if [ "${FXDYN_INSIDE:-0}" = 0 ]; then
  rm -rf "$work"
  mkdir -p "$work"
  cp "$root"/tests/support/elastic_arm/* "$work/"
  cd "$work"
  "$fxdyn" export arm.project --out out >/dev/null 2>&1
  # a controller for the robot in the loop; `fxdyn vibration` would look for the best one first
  cat >out/vibration.json <<'JSON'
{"schema": "fxdyn.vibration/1", "made_from": {"logs": {}}, "methods": [],
 "control": {"bandwidth_hz": 24, "damping": 0.5, "tick_s": 0.002, "encoder_step": 1.5e-6, "settling_band": 2e-5}}
JSON
  "$root/toolchains/build_node.sh" out/tables.hpp node
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
# refused EXIT_CODE EXPECTED ARGUMENT..
refused() {
  local code=0
  "$fxdyn" replay arm.project --out out "${@:3}" >refused.txt 2>&1 || code=$?
  [ $code -eq "$1" ] || fail "${*:3}: exit code $code"
  [ "$(grep -c '^fxdyn: ' refused.txt)" -eq 1 ] && tail -1 refused.txt | grep -q "$2" || fail "${*:3}: $(cat refused.txt)"
}
refused 2 'no interface can9' --can can9
refused 2 'ip link set vcan2' --can vcan2
refused 2 'no node answers' --can vcan0
trap 'kill $node 2>/dev/null || true' EXIT
start_node "$work/node/fxdyn_node"
"$fxdyn" replay arm.project --out out --can vcan0 --ticks 1500 || fail "replay"
grep -q '"bit_exact": true' out/can_replay.json || fail "the torques differ"
"$fxdyn" replay arm.project --out out --can vcan0 --closed-loop || fail "closed loop"
grep -q '"numbers": "drive"' out/can_replay.json || fail "no drive in the loop"
# the motors follow to 0.05 mrad on average, which takes the feedforward: without it they are 0.2 off and more
python3 -c '
import json
loop = json.load(open("out/can_replay.json"))["closed_loop"]["methods"][-1]["moves"]["all"]
assert loop["tracking_motor"] < 0.05, loop' || fail "tracking in the loop"
kill $node
wait $node 2>/dev/null || true
start_node "$work/../fxdyn_node"
refused 2 'a robot of 6 joints' --can vcan0
exit $failures
