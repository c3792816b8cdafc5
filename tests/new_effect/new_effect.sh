#!/usr/bin/env bash
# new_effect.sh FXDYN DIRECTORY: FXDYN is fxdyn with the effect of this folder besides. It simulates the effect, identifies it, finds it
# where it is hidden, predicts and exports it; an image for a Cortex-M4 computes it bit for bit in QEMU.
set -uo pipefail
fxdyn=$1 work=$2
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
effect=tanh_cubic_damping
rm -rf "$work/out" "$work"/*.csv
mkdir -p "$work"
cp "$root/tests/support/elastic_arm/arm.urdf" "$work/"
cd "$work" || exit 1
failures=0
fail() {
  echo "FAILED: $*"
  failures=$((failures + 1))
}
step() { echo "[$SECONDS s] $*"; }
# fxdyn's verb, its output shown where it fails
must() { "$fxdyn" "$@" >said.txt 2>&1 || { fail "fxdyn $1: $(tail -1 said.txt)"; cat said.txt; exit 1; }; }

effect() { printf '[[effect]]\nname = "%s"\njoint = %s\nparameters = { %s }\n' "$1" "$2" "$3"; }
log() { printf '[[log]]\nname = "%s"\nduration_s = 10\nperiod_s = 5\nspeed = %s\nseed = %s\n' "$1" "$2" "$3"; }
{
  printf 'seed = 4\n[sensors]\nencoder_bits = 22\ntorque_noise = 0.002\n[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n'
  effect viscous '"all"' 'coefficient = [1.5, 0.6]'
  effect coulomb '"all"' 'amplitude = [3.0, 1.2], width = 0.01'
  effect $effect 2 'velocity = 0.5, amplitude = 1.5'
  log a 0.7 1 && log b 0.3 2 && log judge 0.5 3 && log test 0.6 5
} >arm.toml
# project NAME EFFECTS
project() {
  {
    printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n%s\n' "$2"
    for entry in a:train b:train judge:validate test:test; do
      printf '[[log]]\nfile = "%s.csv"\nrole = "%s"\n' "${entry%:*}" "${entry#*:}"
    done
  } >"$1.toml"
}
nominal='"viscous", "coulomb", "offset", "rotor_inertia"'
project known "[identify]
effects = [$nominal, \"$effect\"]"
project hidden ""

step "effects"
must effects
grep -q "$effect .*tanh(dq / velocity)^3" said.txt || fail "effects: $effect is not listed"

step "simulate"
must simulate arm.toml --out .

# value FILE JQ: a number out of JSON
value() { python3 -c "import json,sys; print(eval(sys.argv[2], {'d': json.load(open(sys.argv[1]))}))" "$1" "$2"; }
# near NAME VALUE EXPECTED SHARE
near() { awk -v v="$2" -v e="$3" -v s="$4" 'BEGIN { exit !(v > e * (1 - s) && v < e * (1 + s)) }' || fail "$1: $2, expected $3"; }
of_joint_2="[p['value'] for e in d['joints'][1]['effects'] if e['effect'] == '$effect' for p in e['parameters']]"

step "identify"
must identify known.toml --out out/known
near "identified velocity" "$(value out/known/model.json "$of_joint_2[0]")" 0.5 0.1
near "identified amplitude" "$(value out/known/model.json "$of_joint_2[1]")" 1.5 0.05

step "diagnose"
must diagnose hidden.toml --out out/hidden
[ "$(value out/hidden/diagnosis.json "[[e['effect'] for e in j['effects']] for j in d['joints']]")" = "[[], ['$effect']]" ] ||
  fail "diagnose: $(value out/hidden/diagnosis.json "[[e['effect'] for e in j['effects']] for j in d['joints']]")"
near "found amplitude" "$(value out/hidden/model.json "$of_joint_2[1]")" 1.5 0.05

step "predict"
must predict --model out/hidden/model.json --log test.csv --out out/prediction
relative=$(value out/prediction/metrics.json "max(j['relative'] for j in d['logs'][0]['joints'])")
awk -v r="$relative" 'BEGIN { exit !(r < 0.01) }' || fail "predict: relative error $relative"

step "export"
must export hidden.toml --out out/hidden
grep -q TanhCubicDamping out/hidden/tables.hpp || fail "export: the tables do not name it"

step "image for a Cortex-M4"
"$root/toolchains/build_image.sh" out/hidden/tables.hpp image cortex-m4 "$here/effects.hpp" >said.txt 2>&1 || {
  cat said.txt
  fail "the image does not build"
  exit 1
}

step "replay in QEMU"
must replay hidden.toml --out out/hidden --image image/fxdyn-mps2-an386.elf --ticks 500
[ "$(value out/hidden/replay.json "d['bit_exact']")" = True ] || fail "replay: not bit for bit"

step "done"
exit $((failures > 0))
