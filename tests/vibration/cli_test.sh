#!/usr/bin/env bash
# cli_test.sh FXDYN: on an arm with elastic gears the identified model as feedforward, in fixed point, follows and stops
# better than a PD alone and than a rigid body; more data give less error; what can't be done is refused.
set -u
fxdyn=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}

cat >arm.urdf <<'URDF'
<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
</robot>
URDF
cat >arm.toml <<'SCENARIO'
seed = 4
plant = "mujoco"
motion = "closed_loop"
[sensors]
encoder_bits = 22
torque_noise = 0.003
[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
acceleration = [8, 8]
[[effect]]
name = "rotor_inertia"
joint = "all"
parameters = { inertia = [0.6, 0.2] }
[[effect]]
name = "viscous"
joint = "all"
parameters = { coefficient = [1.5, 0.6] }
[[effect]]
name = "coulomb"
joint = "all"
parameters = { amplitude = [3.0, 1.2], width = 0.004 }
[[effect]]
name = "presliding"
joint = "all"
parameters = { distance = 0.004, amplitude = [3.0, 1.2] }
[[effect]]
name = "elasticity"
joint = "all"
parameters = { compliance = [1e-4, 3e-4], relaxation = 0.001 }
[[log]]
name = "fast"
duration_s = 10
period_s = 5
speed = 0.7
seed = 1
[[log]]
name = "slow"
duration_s = 10
period_s = 5
speed = 0.12
seed = 2
[[log]]
name = "judge"
duration_s = 10
speed = 0.5
seed = 3
[[log]]
name = "test"
duration_s = 10
speed = 0.6
seed = 5
SCENARIO
{
  printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n[identify]\neffects = ["viscous", "coulomb", "rotor_inertia"]\n'
  for role in fast/train slow/train judge/validate test/test; do
    printf '[[log]]\nscenario = "arm.toml"\nlog = "%s"\nrole = "%s"\n' "${role%/*}" "${role#*/}"
  done
} >arm.project
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
sed 's/log = "slow"/log = "fast"\nto_s = 5/; s/log = "fast"$/&/' arm.project | sed '0,/log = "fast"/s//log = "fast"\nfrom_s = 5/' >other.project
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
