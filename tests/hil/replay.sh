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
  "$fxdyn" vibration arm.project --out out >/dev/null
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
  [ "$(wc -l <refused.txt)" -eq 1 ] && grep -q "$2" refused.txt || fail "${*:3}: $(cat refused.txt)"
}
refused 2 'no such\|No such\|not there' --can can9
refused 2 'ip link set vcan2' --can vcan2
refused 2 'no node answers' --can vcan0
"$work/node/fxdyn_node" --can vcan0 &
trap 'kill %1 2>/dev/null || true' EXIT
sleep 1
"$fxdyn" replay arm.project --out out --can vcan0 --ticks 1500 || fail "replay"
grep -q '"bit_exact": true' out/can_replay.json || fail "the torques differ"
"$fxdyn" replay arm.project --out out --can vcan0 --closed-loop || fail "closed loop"
grep -q '"numbers": "drive"' out/can_replay.json || fail "no drive in the loop"
kill %1
wait %1 2>/dev/null || true
"$work/../fxdyn_node" --can vcan0 &
trap 'kill %2 2>/dev/null || true' EXIT
sleep 1
refused 2 'a robot of 6 joints' --can vcan0
exit $failures
