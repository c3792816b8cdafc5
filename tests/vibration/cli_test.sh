#!/usr/bin/env bash
# cli_test.sh FXDYN: on an arm with elastic gears the identified model as feedforward, in fixed point, follows and stops
# better than a PD alone and than a rigid body, its links too where it knows the gears; more data give less error; what
# can't be done is refused.
set -u
fxdyn=$1
arm=$(cd "$(dirname "$0")/../support/elastic_arm" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

cp "$arm"/* .
"$fxdyn" vibration arm.project --out loop >loop.txt 2>&1 || fail "vibration: $(tail -1 loop.txt)"
python3 - <<'PYTHON' || fail "$(cat loop.txt)"
import json, sys
result = json.load(open("loop/vibration.json"))
rows = {(m["feedforward"], m["numbers"], m["parameters_off"]): m["moves"]["all"] for m in result["methods"]}
none, rigid, model = rows["none", "-", "none"], rows["rigid", "fixed", "none"], rows["model", "fixed", "none"]
wrong = rows["model", "fixed", "-20 %"]
print(none, rigid, model)
assert model["tracking_motor"] <= 0.2 * none["tracking_motor"]
assert model["tracking_motor"] <= 0.5 * rigid["tracking_motor"]
assert model["residual"] < none["residual"]
assert model["tracking_motor"] < wrong["tracking_motor"] < none["tracking_motor"]
assert result["fixed_against_double"]["error_change"] < 0.01
PYTHON

# The same model, told how the gears bend: with the motors ahead by that the links follow, too.
python3 - <<'PYTHON' || fail "no elasticity in loop/model.json"
import json
assert all(m["feedforward"] != "model_elastic" for m in json.load(open("loop/vibration.json"))["methods"])
model = json.load(open("loop/model.json"))
for joint, compliance in zip(model["joints"], (1e-4, 3e-4)):
    joint["effects"].append({"effect": "elasticity", "origin": "named", "parameters": [
        {"name": "relaxation", "unit": "s", "value": 0.001},
        {"name": "compliance", "unit": "rad/(N*m)", "value": compliance}]})
for of_tables in ("formats", "layout", "tables_crc"):
    del model[of_tables]
json.dump(model, open("loop/model.json", "w"))
PYTHON
"$fxdyn" vibration arm.project --out loop >loop.txt 2>&1 || fail "vibration, elastic: $(tail -1 loop.txt)"
python3 - <<'PYTHON' || fail "$(cat loop.txt)"
import json
result = json.load(open("loop/vibration.json"))
rows = {(m["feedforward"], m["numbers"], m["parameters_off"]): m["moves"]["all"] for m in result["methods"]}
none, rigid, elastic = rows["none", "-", "none"], rows["rigid", "fixed", "none"], rows["model_elastic", "fixed", "none"]
wrong = rows["model_elastic", "fixed", "-20 %"]
print(none, rigid, elastic)
assert elastic["tracking_link"] <= 0.2 * none["tracking_link"]
assert elastic["tracking_link"] <= 0.5 * rigid["tracking_link"]
assert elastic["tracking_motor"] <= 0.2 * none["tracking_motor"]
assert elastic["residual"] <= 0.5 * none["residual"]
assert elastic["tracking_link"] < wrong["tracking_link"] < none["tracking_link"]
assert result["fixed_against_double"]["model_elastic"]["error_change"] < 0.01
for m in result["methods"]:
    assert m["reference"] == ("motor" if m["feedforward"] == "model_elastic" else "link"), m
    ratio = m["moves"]["all"]["tracking_link"] / rigid["tracking_link"]
    assert abs(m["ratios"]["rigid"]["tracking_link"] - ratio) < 1e-9, m
PYTHON

"$fxdyn" efficiency arm.project --out data >data.txt 2>&1 || fail "efficiency: $(tail -1 data.txt)"
python3 - <<'PYTHON' || fail "$(cat data.txt)"
import json
curve = {p["seconds"]: p["percent_rated"] for p in json.load(open("data/efficiency.json"))["curve"]}
assert sorted(curve) == [5, 10, 20], sorted(curve)  # there are 20 s
assert curve[20]["lugre"] < curve[20]["friction_ls"]
assert curve[20]["lugre"] < 1.2 * curve[5]["lugre"]
PYTHON

# refused NAME EXPECTED
refused() {
  "$fxdyn" "$1" other.project --out other >refused.txt 2>&1
  [ $? -ne 0 ] || fail "$1: taken"
  tail -1 refused.txt | grep -q "$2" || fail "$1: $(tail -1 refused.txt)"
}
sed 's/log = "slow"/log = "fast"\nto_s = 5/' arm.project | sed '0,/log = "fast"/s//log = "fast"\nfrom_s = 5/' >other.project
refused efficiency 'needs fast and slow'
{
  printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n[diagnose]\nmax_effects = 0\n[train]\nenabled = false\n'
  for role in fast/train judge/validate; do
    printf '[[log]]\nfile = "loop/logs/arm/%s.csv"\nrole = "%s"\n' "${role%/*}" "${role#*/}"
  done
} >other.project
refused vibration 'a train log with scenario'

[ $failures -eq 0 ] && echo "feedforward in the loop, error against data"
exit $failures
