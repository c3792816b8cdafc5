#!/usr/bin/env bash
# cli_test.sh FXDYN: what diagnosis names goes through training, tables and prediction; `run` gives the bytes of the verbs
# one by one; bad input gives exit code 1 or 2, one line that says what is wrong, and no files.
set -u
fxdyn=$1
here=$(cd "$(dirname "$0")" && pwd)
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
sed 's/\(elbow.*\)lower="-2" upper="2" velocity="2"/\1lower="0.2999" upper="0.3001" velocity="1e-7"/' arm.urdf >locked.urdf

# scenario SEED URDF SAMPLE_S START_S
scenario() {
  printf 'seed = %s\n[sensors]\nencoder_bits = 22\ntorque_noise = 0.002\nsample_s = %s\nstart_s = %s\n[robot]\nurdf = "%s"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n' "$1" "$3" "$4" "$2"
  for joint in 1 2; do
    effect viscous $joint 'coefficient = 1.0'
    effect coulomb $joint 'amplitude = 1.5, width = 0.02'
  done
}
effect() { printf '[[effect]]\nname = "%s"\n%sparameters = { %s }\n' "$1" "${2:+joint = $2$'\n'}" "$3"; }
log() { printf '[[log]]\nname = "%s"\nduration_s = 10\nperiod_s = 10\nspeed = 0.4\nseed = %s\nstart_s = %s\n' "$1" "$2" "$3"; }
missing() {
  effect ripple 2 'wavenumber = 30.0, cos = 0.5, sin = 0.4'
  effect ripple 2 'wavenumber = 47.0, cos = 0.3, sin = -0.5'
  effect presliding 1 'distance = 0.004, amplitude = 1.5'
  effect delay 2 'time = 0.006, share = 1.0'
  effect payload '' 'mass = 1.2, com_x = 0.3, com_y = 0.0, com_z = 0.05'
}
{ scenario 4 arm.urdf 0.002 0 && missing && log a 1 0 && log b 2 10 && log c 3 20; } >now.toml
{ scenario 5 arm.urdf 0.004 500 && log h 11 0 && log k 12 10; } >healthy.toml
{ scenario 6 locked.urdf 0.002 0 && effect ripple 1 'wavenumber = 30.0, cos = 0.9, sin = 0.4' && log l 1 0 && log m 2 10; } >locked.toml
for s in now healthy locked; do "$fxdyn" simulate $s.toml --out . >/dev/null || fail "simulate $s"; done

# project NAME FILE ROLE [FILE ROLE]..
project() {
  local name=$1
  shift
  printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n' >"$name.toml"
  while [ $# -gt 0 ]; do
    printf '[[log]]\nfile = "%s"\nrole = "%s"\n' "$1" "$2" >>"$name.toml"
    shift 2
  done
}
now='a.csv train b.csv validate c.csv test'
# shellcheck disable=SC2086  # a list of words
project good $now h.csv baseline k.csv baseline

# All in one go, and verb by verb; the second finds what is missing itself.
"$fxdyn" run good.toml --out run >run.txt 2>&1 || fail "run: $(tail -1 run.txt)"
for verb in diagnose train export report; do
  "$fxdyn" $verb good.toml --out verbs >verb.txt 2>&1 || fail "$verb: $(tail -1 verb.txt)"
done
for file in model.json nominal.json metrics.json diagnosis.json identified.urdf export.json tables.hpp tables.bin report.html; do
  cmp -s run/$file verbs/$file || fail "$file: run and the verbs differ"
done
# named FILE EFFECT COUNT: effects that are marked as named
named() {
  local found
  found=$(tr -d ' \n' <"$1" | grep -o "\"effect\":\"$2\",\"equation\":\"[^\"]*\",\"origin\":\"named\"" | wc -l)
  [ "$found" -eq "$3" ] || fail "$1: $found named $2, expected $3"
}
named run/model.json ripple 2
for effect in presliding delay payload; do named run/model.json $effect 1; done
grep -q '"stage": "trained"' run/model.json || fail "not trained"
for stage in rigid friction diagnosed bls; do grep -q "\"stage\": \"$stage\"" run/metrics.json || fail "no stage $stage"; done
# A joint without a BLS is exported exactly as diagnosed, or no worse on what judges; every moving link says what of it the logs decided.
python3 - <<'PY' || fail "a joint without a BLS changed"
import json
metrics = json.load(open("run/metrics.json"))
stages = {stage["stage"]: stage["logs"] for stage in metrics["stages"]}
for j, joint in enumerate(metrics["training"]):
    gate = metrics["gate_errors"][j]
    assert gate["exported"] == "bls" or not joint["kept"]
    assert joint["kept"] or gate["bls"] <= gate["diagnosed"], gate
    for before, after in zip(stages["diagnosed"], stages["bls"]):
        assert gate["exported"] == "bls" or before["joints"][j]["rmse"] == after["joints"][j]["rmse"], joint["joint"]
assert len(metrics["training"]) == 2
PY
[ "$(grep -c '<!-- data_share mass' run/identified.urdf)" -eq 2 ] || fail "identified.urdf without shares"
"$fxdyn" predict --model run/model.json --log c.csv --numbers fixed --out prediction >/dev/null 2>&1 || fail "predict"
worst=$(grep -o '"relative": [0-9.e-]*' prediction/metrics.json | awk '{ if ($2 > w) w = $2 } END { print w }')
awk -v w="$worst" 'BEGIN { exit !(w < 0.02) }' || fail "fixed point: relative error $worst with the named effects"
# A changed baseline makes the model another one.
project good a.csv train b.csv validate c.csv test h.csv baseline
"$fxdyn" export good.toml --out run >/dev/null 2>&1 || fail "export after the project changed"
[ "$(grep -c '"role": "baseline"' run/model.json)" -eq 1 ] || fail "the model is not of the project's baseline"

# No log that judges: blocks of the train log, and it says so.
project blocks a.csv train
"$fxdyn" diagnose blocks.toml --out blocks >blocks.txt 2>&1 || fail "blocks"
grep -q 'blocks of the train log' blocks.txt || fail "blocks: not said"

# Without gnuplot the answer stands.
mkdir none && ln -s "$(command -v env)" none/env
PATH=$work/none "$fxdyn" diagnose blocks.toml --out plain >plain.txt 2>&1 || fail "without gnuplot"
[ -e plain/diagnosis.json ] && [ -e plain/model.json ] || fail "without gnuplot nothing is written"

# A joint at rest is not excited; the other one is diagnosed; a feedforward for the robot needs both.
project locked l.csv train m.csv validate
sed -i s/arm.urdf/locked.urdf/ locked.toml
"$fxdyn" diagnose locked.toml --out locked >locked.txt 2>&1 || fail "locked: $(tail -1 locked.txt)"
grep -q 'shoulder *explained .*ripple' locked.txt || fail "locked: the shoulder's ripple is not found"
grep -q 'elbow *not excited' locked.txt || fail "locked: the elbow's verdict"
# Its brake holds it, the drive off.
for l in l m; do awk -F, 'BEGIN { OFS = "," } NR > 1 { $5 = 0.01 * sin(7 * NR) } { print }' $l.csv >braked_$l.csv; done
project braked braked_l.csv train braked_m.csv validate
sed -i s/arm.urdf/locked.urdf/ braked.toml
"$fxdyn" diagnose braked.toml --out braked >braked.txt 2>&1 || fail "braked: $(tail -1 braked.txt)"
grep -q 'shoulder *explained .*ripple' braked.txt || fail "braked: the shoulder's ripple is not found"
"$fxdyn" report locked.toml --out locked >locked.txt 2>&1 || fail "report locked: $(tail -1 locked.txt)"
grep -q 'not excited' locked/report.html || fail "the report of a joint at rest"
"$fxdyn" export locked.toml --out locked >locked.txt 2>&1 && fail "export goes on with a joint at rest"

# expect CODE "part of the message" VERB PROJECT
expect() {
  local message status
  rm -rf out
  message=$("$fxdyn" "$3" "$4.toml" --out out 2>&1 >/dev/null)
  status=$?
  message=$(grep '^fxdyn:' <<<"$message")
  [ $status -eq "$1" ] && [ "$(wc -l <<<"$message")" -eq 1 ] && grep -qF -- "$2" <<<"$message" ||
    fail "$3 $4 -> exit $status (expected $1), expected '$2' in: $message"
  [ -z "$(find out -name '*.json' 2>/dev/null)" ] || fail "$3 $4 left files behind"
}
expect 1 "joint 2 (elbow) never moves" run locked
awk -F, 'BEGIN { OFS = "," } NR > 1 { $2 = $3 = 0.3 } { print }' a.csv >rest.csv
project rest rest.csv train
expect 1 "no joint moves" diagnose rest
head -n 1500 a.csv >part.csv
project part part.csv train
expect 1 "too short to split" diagnose part
head -n 12 a.csv >stub.csv
project stub stub.csv train
expect 1 "stub.csv" diagnose stub

# baseline NAME 'awk program': the good project with the healthy log changed
baseline() {
  awk -F, "BEGIN { OFS = \",\" } $2" h.csv >"$1.csv"
  # shellcheck disable=SC2086
  project "$1" $now "$1.csv" baseline
}
baseline joints '{ print $1, $2, $4 }'
expect 2 "no column 'q2'" diagnose joints
baseline degrees 'NR > 1 { $2 *= 57.3; $3 *= 57.3 } { print }'
expect 2 "looks like degrees" diagnose degrees
baseline milli 'NR > 1 { $4 *= 1000; $5 *= 1000 } { print }'
expect 1 "baseline" diagnose milli
baseline another 'NR > 1 { $4 = 20 * sin(NR / 300); $5 = 9 * sin(NR / 170) } { print }'
expect 1 "baseline" diagnose another
baseline dead 'NR > 1 { $5 = 1.5 } { print }'
expect 1 "dead.csv: torque of joint 2 (elbow) never changes" diagnose dead
baseline parked 'NR > 1 { $3 = 0.3 + 1e-5 * (NR % 3 == 0) } { print }'
expect 1 "joint 2 (elbow) rests there and moves in the train logs" diagnose parked
awk -F, 'BEGIN { OFS = "," } NR > 1 { $5 *= 1000 } { print }' h.csv >one_unit.csv
project one_unit one_unit.csv train k.csv validate
expect 1 "torque of joint 2 (elbow) is about 1000 times too large beside the others'" diagnose one_unit
baseline nan 'NR == 500 { $5 = "nan" } { print }'
expect 2 "nan.csv:500" diagnose nan
baseline cut '{ print } END { print "507,0.1" }'
expect 2 "cut.csv" diagnose cut
: >empty.csv
# shellcheck disable=SC2086
project empty $now empty.csv baseline
expect 2 "empty.csv" diagnose empty
baseline short 'NR < 60 { print }'
expect 1 "short.csv" diagnose short
baseline back 'NR == 400 { $1 = 0 } { print }'
expect 2 "back.csv:400" diagnose back
baseline torqueless '{ print $1, $2, $3 }'
expect 2 "no column 'tau1'" diagnose torqueless
# shellcheck disable=SC2086
project gone $now gone.csv baseline
expect 2 "gone.csv" diagnose gone

# judge NAME 'awk program': the validate log changed
judge() {
  awk -F, "BEGIN { OFS = \",\" } $2" b.csv >"$1.csv"
  project "$1" a.csv train "$1.csv" validate c.csv test
}
judge joule 'NR > 1 { $4 *= 1000; $5 *= 1000 } { print }'
expect 1 "joule.csv: its torques are" diagnose joule
judge fewer '{ print $1, $2, $4 }'
expect 2 "no column 'q2'" diagnose fewer

# Gears that bend and friction that sticks, in two logs: a load that fits them and spoils the validate log goes, and what
# is true stays (compliance 3e-4, 1.2 N m of friction over 4 mrad).
cp -r "$here/../support/elastic_arm" .
sed -i 's/^encoder_bits = 22/&\nlink_encoder_bits = 22/' elastic_arm/arm.toml
"$fxdyn" diagnose elastic_arm/arm.project --out elastic >elastic.txt 2>&1 || fail "elastic arm: $(tail -1 elastic.txt)"
python3 - <<'PYTHON' || fail "the elastic arm: $(cat elastic.txt)"
import json
diagnosis = json.load(open("elastic/diagnosis.json"))
assert not diagnosis["robot_effects"] and not diagnosis["undecided"]
for joint in diagnosis["joints"]:
    assert joint["verdict"] == "explained" and joint["gap_after"] < 0.1 * joint["gap_before"], joint
    assert {e["effect"] for e in joint["effects"]} == {"elasticity", "presliding"}
found = {e["effect"]: {p["name"]: p["value"] for p in e["parameters"]} for e in diagnosis["joints"][1]["effects"]}
assert abs(found["elasticity"]["compliance"] / 3e-4 - 1) < 0.02
assert abs(found["presliding"]["amplitude"] / 1.2 - 1) < 0.03 and abs(found["presliding"]["distance"] / 4e-3 - 1) < 0.03
PYTHON

# A diagnosed model is a plant.
printf 'seed = 1\n[robot]\nmodel = "%s/run/model.json"\n[[log]]\nname = "played"\nduration_s = 4\nseed = 3\n' "$work" >played.toml
"$fxdyn" simulate played.toml --out played >played.txt 2>&1 || fail "simulate a model: $(tail -1 played.txt)"
"$fxdyn" predict --model run/model.json --log played/played.csv --out again >again.txt 2>&1 || fail "predict what was played"
worst=$(grep -o '"relative": [0-9.e-]*' again/metrics.json | awk '{ if ($2 > w) w = $2 } END { print w }')
awk -v w="$worst" 'BEGIN { exit !(w < 0.01) }' || fail "the played model's torque is not its prediction: $worst"

[ $failures -eq 0 ] && echo "the chain holds, and bad input is refused as it should be"
exit $failures
