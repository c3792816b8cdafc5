#!/usr/bin/env bash
# cli_test.sh FXDYN: a search by swarm that was killed goes on where it was and gives the same model, whatever the number
# of threads; generations of another search are refused; every method is compared.
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
{
  printf 'seed = 4\n[sensors]\nencoder_bits = 20\ntorque_noise = 0.005\n[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n'
  for joint in 1 2; do
    for effect in 'viscous/coefficient = 1.0' 'coulomb/amplitude = 1.5, width = 0.004' 'presliding/distance = 0.004, amplitude = 1.5' \
      'stribeck/velocity = 0.1, amplitude = 0.6'; do
      printf '[[effect]]\nname = "%s"\njoint = %s\nparameters = { %s }\n' "${effect%%/*}" $joint "${effect#*/}"
    done
  done
  seed=1
  for log in a b c; do
    printf '[[log]]\nname = "%s"\nduration_s = 10\nspeed = 0.4\nseed = %s\n' $log $((seed++))
  done
} >arm.toml
# project FILE SEED
project() {
  printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n' >"$1"
  for role in a/train b/validate c/test; do
    printf '[[log]]\nscenario = "arm.toml"\nlog = "%s"\nrole = "%s"\n' "${role%/*}" "${role#*/}" >>"$1"
  done
  printf '[identify]\neffects = ["viscous", "coulomb"]\n[diagnose]\nmax_effects = 0\n[train]\nseed = %s\n[train.pso]\nparticles = 6\niterations = 5\nbounds = { nodes = [4, 12] }\n' "$2" >>"$1"
}
project arm.project 1
"$fxdyn" diagnose arm.project --out whole >whole.txt 2>&1 || fail "diagnose: $(tail -1 whole.txt)"
cp -r whole killed
cp -r whole diagnosed
FXDYN_THREADS=1 "$fxdyn" train arm.project --out whole >whole.txt 2>&1 || fail "train: $(tail -1 whole.txt)"
grep -q '"kept": true' whole/metrics.json || fail "no joint kept its BLS"
[ -e whole/train.pso.json ] && fail "a search that is done leaves its generations"

"$fxdyn" train arm.project --out killed >killed.txt 2>&1 &
for _ in $(seq 2000); do
  [ -e killed/train.pso.json ] && break
  sleep 0.01
done
kill -9 $! 2>/dev/null
wait $! 2>/dev/null
[ -e killed/train.pso.json ] || fail "nothing to go on from"
cp killed/train.pso.json generation.json
"$fxdyn" train arm.project --out killed >killed.txt 2>&1 || fail "going on: $(tail -1 killed.txt)"
cmp -s whole/model.json killed/model.json || fail "a killed run ends elsewhere"
cmp -s whole/metrics.json killed/metrics.json || fail "a killed run has other figures"
# Killed between the model and the end of the search: the model is the outcome, the search is done with.
sed 's/"generation":[0-9]*/"generation":6/g; s/"finished":false/"finished":true/' generation.json >killed/train.pso.json
"$fxdyn" train arm.project --out killed >killed.txt 2>&1 || fail "a search that was written down: $(tail -1 killed.txt)"
[ -e killed/train.pso.json ] && fail "a search that was written down is still there"
cp generation.json killed/train.pso.json
"$fxdyn" train arm.project --out killed >killed.txt 2>&1
[ $? -eq 1 ] && tail -1 killed.txt | grep -q 'another project' || fail "an unfinished search of another model: $(tail -1 killed.txt)"

project other.project 2
"$fxdyn" diagnose other.project --out other >other.txt 2>&1 || fail "diagnose other"
# refused FILE EXPECTED
refused() {
  cp "$1" other/train.pso.json
  "$fxdyn" train other.project --out other >refused.txt 2>&1
  [ $? -eq 1 ] || fail "$1: exit code"
  tail -1 refused.txt | grep -q "$2" || fail "$1: $(tail -1 refused.txt)"
}
refused generation.json 'another project'
head -c 300 generation.json >half.json
refused half.json 'cut off'
rm other/train.pso.json
cp -r diagnosed nonsense
sed 's/"generation":[0-9]*/"generation":-1/g' generation.json >nonsense/train.pso.json
"$fxdyn" train arm.project --out nonsense >nonsense.txt 2>&1
[ $? -eq 1 ] && tail -1 nonsense.txt | grep -q 'another project' || fail "a generation of -1: $(tail -1 nonsense.txt)"
sed 's/^\[train\]/[train]\nnodes = 7/' arm.project >fixed.project
"$fxdyn" train fixed.project --out fixed >fixed.txt 2>&1 || fail "nodes beside a swarm: $(tail -1 fixed.txt)"
grep -q 'train.nodes: not used' fixed/model.json || fail "nodes beside a swarm: no note"

sed 's/^\[train\]/[train]\nwindows = 3/; /^\[train.pso\]/,$d' arm.project >windows.project
"$fxdyn" train windows.project --out windows >windows.txt 2>&1 || fail "windows alone: $(tail -1 windows.txt)"
grep -q 'train.windows: not used' windows/model.json || fail "windows without nodes: no note"

"$fxdyn" compare arm.project --out begun >begun.txt 2>&1 &
for _ in $(seq 6000); do
  [ -e begun/compare.bls_pso_physical.pso.json ] && break
  sleep 0.01
done
kill -9 $! 2>/dev/null
wait $! 2>/dev/null
[ -e begun/compare.bls_pso.pso.json ] && [ -e begun/compare.bls_pso_physical.pso.json ] || fail "compare: nothing to go on from"
[ -e begun/compare.json ] && fail "compare: was done before it was killed"
"$fxdyn" compare arm.project --out compared >compared.txt 2>&1 || fail "compare: $(tail -1 compared.txt)"
cp begun/compare.bls_pso.pso.json generation.json
"$fxdyn" compare arm.project --out begun >begun.txt 2>&1 || fail "compare, going on: $(tail -1 begun.txt)"
ls begun/*.pso.json >/dev/null 2>&1 && fail "compare: searches that are done leave their generations"
cp -r other others
cp generation.json others/compare.bls_pso.pso.json
"$fxdyn" compare other.project --out others >others.txt 2>&1
[ $? -eq 1 ] && tail -1 others.txt | grep -q 'another project' || fail "compare: generations of another project: $(tail -1 others.txt)"
python3 - <<'PYTHON' || fail "compare.json"
import json

whole, begun = (json.load(open(f"{name}/compare.json")) for name in ("compared", "begun"))
names = "rigid_ls friction_ls rls mlp bls_default bls_pso bls_pso_friction bls_pso_physical dahl_stribeck lugre named_bls oracle noise_floor".split()
assert whole["against"] == "truth"
assert [m["name"] for m in whole["methods"]] == names
methods = {m["name"]: m for m in whole["methods"]}
for name, method in methods.items():
    for key in ("rmse", "percent_rated", "peak"):
        assert len(method[key]) == 2 and all(value > 0 for value in method[key]), (name, key, method)
    assert all(peak > rmse for peak, rmse in zip(method["peak"], method["rmse"])), method
    assert abs(method["mean_percent_rated"] - sum(method["percent_rated"]) / 2) < 1e-12, method
    # What could go into firmware has been there.
    fixed = name in ("rigid_ls", "friction_ls", "rls", "bls_pso_physical", "dahl_stribeck", "lugre", "named_bls")
    assert (method["fixed_error"] is not None) == fixed, method
    assert not fixed or 0 < method["fixed_error"] < 1e-3, method
error = {name: method["mean_percent_rated"] for name, method in methods.items()}
print(error)
assert error["bls_pso_physical"] <= 0.5 * error["mlp"]
# 0.249 where this was written; the goal of 0.25 is that of the paper's robot (docs/findings/paper.md)
assert error["bls_pso_physical"] <= 0.3 * error["rls"]
for name, method in ((m["name"], m) for m in begun["methods"]):
    assert method["rmse"] == methods[name]["rmse"], name
    assert (method["train_s"] is None) == (name in ("bls_pso", "bls_pso_friction", "bls_pso_physical")), (name, method["train_s"])
PYTHON
"$fxdyn" report arm.project --out compared >report.txt 2>&1 || fail "report: $(tail -1 report.txt)"
grep -q 'Methods compared' compared/report.html || fail "the report lacks the comparison"
sed -i '$d' compared/logs/arm/c.csv
"$fxdyn" report arm.project --out compared >report.txt 2>&1
grep -q 'compare.json is of another' compared/report.html || fail "a comparison of other logs is in the report"

[ $failures -eq 0 ] && echo "searches go on, and every method is there"
exit $failures
