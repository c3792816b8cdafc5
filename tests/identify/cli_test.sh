#!/usr/bin/env bash
# cli_test.sh FXDYN SOURCE_DIR: bad input gives exit code 1 or 2, one line that says what is wrong, and no files.
set -u
fxdyn=$1
source=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failures=0

# expect CODE "part of the message" ARGUMENTS...
expect() {
  local code=$1 part=$2
  shift 2
  local message status
  rm -rf "$work/out"
  message=$("$fxdyn" "$@" 2>&1 >/dev/null)
  status=$?
  message=$(grep '^fxdyn:' <<<"$message")
  if [ $status -ne "$code" ] || [ "$(wc -l <<<"$message")" -ne 1 ] || ! grep -qF -- "$part" <<<"$message"; then
    echo "FAILED: fxdyn $* -> exit $status (expected $code), expected '$part' in: $message"
    failures=$((failures + 1))
  fi
  if [ -e "$work/out/model.json" ] || [ -n "$(find "$work" -name '*.tmp' 2>/dev/null)" ]; then
    echo "FAILED: fxdyn $* left files behind"
    failures=$((failures + 1))
  fi
}

cat >"$work/arm.urdf" <<'URDF'
<robot name="arm"><link name="base"/><link name="one"/><link name="two"/>
<joint name="first" type="continuous"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/></joint>
<joint name="second" type="continuous"><parent link="one"/><child link="two"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/></joint>
</robot>
URDF
# make FILE AMPLITUDE_OF_JOINT_2 SAMPLES [FACTOR]
make() {
  awk -v a="$2" -v n="$3" -v f="${4:-1}" 'BEGIN { print "t,q1,q2,tau1,tau2"; for (k = 0; k < n; k++) { t = k * 0.002;
    printf "%.4f,%.9f,%.9f,%.6f,%.6f\n", t, f * sin(3 * t), f * a * sin(4 * t + 1), -9 * sin(3 * t), -16 * a * sin(4 * t + 1) + 0.1 * sin(7 * t) } }' >"$work/$1"
}
project() {  # project NAME LINES...
  local name=$1
  shift
  printf '[robot]\nurdf = "arm.urdf"\n' >"$work/$name"
  printf '%s\n' "$@" >>"$work/$name"
}
run() { expect "$1" "$2" run "$work/$3" --out "$work/out"; }

make good.csv 0.7 5000
project good.toml '[[log]]' 'file = "good.csv"' 'role = "train"' 'to_s = 7.0' '[[log]]' 'file = "good.csv"' 'role = "test"' 'from_s = 7.0'
"$fxdyn" identify "$work/good.toml" --out "$work/fresh" >/dev/null 2>&1
"$fxdyn" run "$work/good.toml" --out "$work/good" >/dev/null 2>&1 || { echo "FAILED: a good project"; failures=$((failures + 1)); }

make still.csv 0 5000
project still.toml '[[log]]' 'file = "still.csv"' 'role = "train"'
run 1 "joint 2 (second) never moves" still.toml
awk -F, 'BEGIN { OFS = "," } NR > 1 { $5 = 0 } { print }' "$work/good.csv" >"$work/zero.csv"
project zero.toml '[[log]]' 'file = "zero.csv"' 'role = "train"'
run 1 "torque of joint 2 (second) never changes" zero.toml
project few.toml '[signals]' 'position_cutoff_hz = 100' 'torque_cutoff_hz = 100' 'edge_s = 0.001' '[[log]]' 'file = "good.csv"' 'role = "train"' 'to_s = 0.026'
run 1 "too short" few.toml
project twice.toml '[identify]' 'effects = ["viscous", "viscous"]' '[[log]]' 'file = "good.csv"' 'role = "train"'
run 2 "there twice" twice.toml
make short.csv 0.7 12
project short.toml '[[log]]' 'file = "short.csv"' 'role = "train"'
run 1 "short.csv" short.toml
make degrees.csv 1 5000 57.3
project degrees.toml '[[log]]' 'file = "degrees.csv"' 'role = "train"'
run 2 "looks like degrees" degrees.toml
project overlap.toml '[[log]]' 'file = "good.csv"' 'role = "train"' '[[log]]' 'file = "good.csv"' 'role = "test"' 'from_s = 5.0'
run 2 "overlap" overlap.toml
sed '100s/^[^,]*,[^,]*/0.1960,nan/' "$work/good.csv" >"$work/nan.csv"
project nan.toml '[[log]]' 'file = "nan.csv"' 'role = "train"'
run 2 "nan.csv:100" nan.toml
sed '200s/^[^,]*/0.1/' "$work/good.csv" >"$work/back.csv"
project back.toml '[[log]]' 'file = "back.csv"' 'role = "train"'
run 2 "back.csv:200" back.toml
sed '1s/tau2/torque2/' "$work/good.csv" >"$work/column.csv"
project column.toml '[[log]]' 'file = "column.csv"' 'role = "train"'
run 2 "tau2" column.toml
sed 's/<parent link="one"/<parent link="base"/' "$work/arm.urdf" >"$work/branch.urdf"
sed 's/arm.urdf/branch.urdf/' "$work/good.toml" >"$work/branch.toml"
run 2 "branch" branch.toml
run 2 "there.toml" there.toml
project key.toml '[trian]' 'enabled = true'
run 2 "trian" key.toml
project state.toml '[train]' 'inputs = "stat"' '[[log]]' 'file = "good.csv"' 'role = "train"'
expect 2 "extended" train "$work/state.toml" --out "$work/out"
project forgetting.toml '[identify]' 'method = "rls"' 'forgetting = 1.5' '[[log]]' 'file = "good.csv"' 'role = "train"'
run 2 "at most 1" forgetting.toml

# Effects that a stage can't handle are refused by name; the list shows them all.
for effect in ripple load_friction torque_gain elasticity payload; do
  project effect.toml '[identify]' "effects = [\"viscous\", \"$effect\"]" '[[log]]' 'file = "good.csv"' 'role = "train"'
  run 2 "$effect" effect.toml
done
for acts_on in torque position body; do
  if ! "$fxdyn" effects --json | grep -q "\"acts_on\": \"$acts_on\""; then
    echo "FAILED: fxdyn effects --json shows no effect on $acts_on"
    failures=$((failures + 1))
  fi
done

expect 2 "unknown effect 'stribek'; nearest is 'stribeck'" effects viscous stribek
[ "$("$fxdyn" effects spring viscous --json | grep -c '"equation"')" = 2 ] || {
  echo "FAILED: fxdyn effects spring viscous shows other than two effects"
  failures=$((failures + 1))
}

echo '{"schema": "fxdyn.model/1"}' >"$work/model.json"
expect 2 "model.json" predict --model "$work/model.json" --log "$work/good.csv" --out "$work/out"
expect 1 "the mass of the load cannot be identified from this motion: no joint of this robot lifts" payload --model "$work/good/model.json" --log "$work/good.csv" --out "$work/out"
unwritten() { [ ! -e "$work/out" ] || { echo "FAILED: $1 left files behind"; failures=$((failures + 1)); }; }
# a known load: its mass and where it is, and a log without it
known() { expect 2 "$1" payload --model "$work/good/model.json" --log "$work/good.csv" --out "$work/out" "${@:2}"; }
known "--mass has to be above 0 kg" --mass 0 --com 0,0,0.1 --unloaded "$work/good.csv"
known "give its --mass too" --com 0,0,0.1
known "needs --com X,Y,Z" --mass 1 --unloaded "$work/good.csv"
known "needs --unloaded" --mass 1 --com -0.1,0,0.1
for com in 0,0.1 0,0,0.1,2 0,x,0.1; do known "--com $com: expected three lengths" --mass 1 --com $com --unloaded "$work/good.csv"; done
expect 1 "no joint feels a load of 0.001 kg" payload --model "$work/good/model.json" --log "$work/good.csv" --unloaded "$work/good.csv" --mass 0.001 --com 0,0,0.1 --out "$work/out"
unwritten "payload with a load that nothing feels"
forward() { expect 2 "$1" forward --model "$work/good/model.json" --log "$work/$2" --out "$work/out" "${@:3}"; }
forward "at least 3 samples" good.csv --given 2
forward "nothing is left to simulate" good.csv --given 5000
forward "tau2 (second) stays at 0" zero.csv
awk -F, 'BEGIN { OFS = "," } NR > 1 { $4 = -$4; $5 = -$5 } { print }' "$work/good.csv" >"$work/opposite.csv"
forward "is it this robot's" opposite.csv
awk -F, 'BEGIN { OFS = "," } { print $1, $2, $3 }' "$work/good.csv" >"$work/motion.csv"
forward "tau1" motion.csv
awk -F, 'BEGIN { OFS = "," } NR == 700 { $5 = "nan" } { print }' "$work/good.csv" >"$work/gap.csv"
forward "gap.csv:700" gap.csv
sed '2,12s/^[^,]*,[^,]*/,/' "$work/good.csv" >"$work/first.csv"
forward "first.csv:2" first.csv
# Another robot of two joints: its links hang in a vertical plane, so that gravity is nearly all of its torque; then one with a joint less.
awk 'BEGIN { print "t,q1,q2,tau1,tau2"; for (k = 0; k < 5000; k++) { t = k * 0.002; q1 = 0.8 * sin(2 * t); q2 = 0.6 * sin(3 * t + 1);
  tau2 = 6 * cos(q1 + q2) - 0.3 * sin(3 * t + 1); printf "%.4f,%.9f,%.9f,%.6f,%.6f\n", t, q1, q2, 15 * cos(q1) - 0.4 * sin(2 * t) + tau2, tau2 } }' >"$work/hanging.csv"
forward "is it this robot's" hanging.csv
awk -F, 'BEGIN { OFS = "," } { print $1, $2, $4 }' "$work/good.csv" >"$work/one.csv"
forward "q2" one.csv
unwritten forward
"$fxdyn" forward --model "$work/good/model.json" --log "$work/good.csv" --out "$work/forward" >/dev/null 2>&1 ||
  { echo "FAILED: forward of a good log"; failures=$((failures + 1)); }
for file in forward.json closed.csv forward.svg; do
  [ -s "$work/forward/$file" ] || { echo "FAILED: forward: no $file"; failures=$((failures + 1)); }
done
# Parameters for simulation: of a model of this project only, and not without one.
expect 2 "is no model of" refine "$work/still.toml" --model "$work/good/model.json" --out "$work/out"
expect 2 "model.json" refine "$work/good.toml" --out "$work/out"
expect 2 "at least 3 samples" refine "$work/good.toml" --model "$work/good/model.json" --given 2 --out "$work/out"
expect 2 "too few beside the 2000 that are given" refine "$work/good.toml" --model "$work/good/model.json" --given 2000 --out "$work/out"
unwritten refine
# LuGre friction that would drive the joint, and bristles that can't bend: every verb that reads the model says so.
lugre() {  # lugre FILE DISTANCE DAMPING
  python3 - "$work/good/model.json" "$work/$1" "$2" "$3" <<'PYTHON'
import json, sys
model = json.load(open(sys.argv[1]))
values = {"distance": float(sys.argv[3]), "velocity": 0.1, "share": 0.7, "static": 5.0, "damping": float(sys.argv[4])}
model["joints"][1]["effects"].append({"effect": "lugre", "origin": "named", "parameters":
                                      [{"name": name, "unit": "", "value": value} for name, value in values.items()]})
for of_tables in ("formats", "layout", "tables_crc"):
    model.pop(of_tables, None)
json.dump(model, open(sys.argv[2], "w"))
PYTHON
}
lugre drives.json 0.01 1000
lugre stiff.json 0 2
lugre brakes.json 0.01 20
for verb in predict forward payload; do
  expect 2 "joint 2 (second): lugre: with a damping of 1000 it would drive the joint" $verb --model "$work/drives.json" --log "$work/good.csv" --out "$work/out"
  unwritten "$verb with friction that drives"
  expect 2 "joint 2 (second): lugre: distance 0 is not within" $verb --model "$work/stiff.json" --log "$work/good.csv" --out "$work/out"
  expect 2 'bristles that do not bend are `coulomb` and `stribeck`, take those' $verb --model "$work/stiff.json" --log "$work/good.csv" --out "$work/out"
  unwritten "$verb with bristles that can't bend"
done
"$fxdyn" predict --model "$work/brakes.json" --log "$work/good.csv" --out "$work/brakes" >/dev/null 2>&1 ||
  { echo "FAILED: predict with LuGre friction"; failures=$((failures + 1)); }
expect 2 "would be overwritten" payload --model "$work/good/model.json" --log "$work/good.csv" --out "$work/good"
expect 2 "'diagnos' is no verb" diagnos "$work/good.toml" --out "$work/fresh"
expect 2 "'--oout' is no option here" diagnose "$work/good.toml" --oout "$work/fresh"
expect 2 "is a folder" diagnose "$work" --out "$work/fresh"
expect 2 "none.csv" payload --model "$work/good/model.json" --log "$work/none.csv" --out "$work/out"
mkdir "$work/apart" && cp "$work/good.csv" "$work/apart"
expect 2 "prediction" predict --model "$work/good/model.json" --log "$work/apart/good.csv" --out "$work/apart"
expect 2 "holds a model" predict --model "$work/good/model.json" --log "$work/good.csv" --out "$work/good"
# the firmware was built from tables of a model that exists: none is made for it
expect 2 "not a trained model" replay "$work/good.toml" --image "$work/none.elf" --out "$work/fresh"
expect 2 "there is no model: run" replay "$work/good.toml" --image "$work/none.elf" --out "$work/nowhere"
if [ -e "$work/nowhere/model.json" ]; then
  echo "FAILED: replay made a model"
  failures=$((failures + 1))
fi

# a project without logs is good for planning only
project plan.toml '[limits]' 'velocity = [1, 1]'
expect 2 "no log to learn from" identify "$work/plan.toml" --out "$work/out"
expect 2 "name a PROJECT" excite --out "$work/out"
sed 's/velocity.*/torque = [1, 1]/' "$work/plan.toml" >"$work/fast.toml"
expect 2 "joint 'first': no velocity limit" excite "$work/fast.toml" --out "$work/out"

[ $failures -eq 0 ] && echo "all refused as they should be"
exit $failures
