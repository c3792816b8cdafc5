#!/usr/bin/env bash
# replay_elastic.sh FXDYN DIRECTORY prepare: identifies a small arm with elastic gears and encoders on its links, and builds the drive
# node with its tables, in DIRECTORY.
# replay_elastic.sh FXDYN DIRECTORY: its model's feedforward over CAN, in the loop with the robot that bends, beside the host's in double:
# fixed point and the bus change less than 1 % of what is left, or less than an encoder step.
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
  "$fxdyn" export linked.project --out out >/dev/null 2>&1
  # A controller; `fxdyn vibration` would look for the best one first. Exact encoders: with steps any two runs part that differ at all.
  cat >out/vibration.json <<'JSON'
{"schema": "fxdyn.vibration/1", "made_from": {"logs": {}}, "methods": [],
 "control": {"bandwidth_hz": 24, "damping": 0.5, "tick_s": 0.002, "encoder_step": 0, "settling_band": 2e-5, "late_s": 0.12}}
JSON
  step "build the node"
  "$root/toolchains/build_node.sh" out/tables.hpp node
  step "done"
  exit
fi
if [ "${FXDYN_INSIDE:-0}" = 0 ]; then
  FXDYN_INSIDE=1 exec "$here/on_can.sh" --output "$work/inside" -- "$here/replay_elastic.sh" "$fxdyn" "$work"
fi

. "$here/interfaces.sh"
cd "$work"
copy=$(mktemp -d)  # results are written beside the model
cp -r linked.* arm.urdf out "$copy"
cd "$copy"
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
start_node "$work/node/fxdyn_node"
step "closed loop"
"$fxdyn" replay linked.project --out out --can vcan0 --closed-loop --moves 1
step "compare"
python3 - <<'PYTHON'
import json
replay = json.load(open("out/can_replay.json"))
assert replay["bit_exact"] and replay["equal_ticks"] == replay["ticks"] > 1500, replay["ticks"]
rows = {(m["feedforward"], m["numbers"]): m["moves"]["all"] for m in replay["closed_loop"]["methods"]}
none = rows["none", "-"]
encoder_step = 1.5e-3  # mrad, of the encoders in docs/findings: less can't be measured
for name in ("model_elastic", "model_elastic_shaped"):
    drive, fixed, real = (rows[name, numbers] for numbers in ("drive", "fixed", "real"))
    for figure in ("tracking_motor", "tracking_link", "residual"):
        print(f"{name} {figure}: double {real[figure]:.6f}, fixed {fixed[figure] / real[figure] - 1:+.1e}, "
              f"over the bus {drive[figure] / real[figure] - 1:+.1e}")
        assert abs(fixed[figure] / real[figure] - 1) < 1e-3, (name, figure, fixed, real)
    # The bus brings velocity and acceleration in 16 bits. That is what the drive's figures differ by, not its fixed point.
    for figure in ("tracking_motor", "tracking_link"):
        assert abs(drive[figure] / real[figure] - 1) < 0.01, (name, figure, drive, real)
    assert abs(drive["residual"] - real["residual"]) < max(0.01 * real["residual"], encoder_step), (name, drive, real)
    # it is worth something: else there would be nothing to compare
    assert drive["tracking_link"] < 0.2 * none["tracking_link"], (name, drive, none)
    assert drive["residual"] < 0.2 * none["residual"], (name, drive, none)
PYTHON
step "done"
