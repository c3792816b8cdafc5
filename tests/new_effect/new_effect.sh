#!/usr/bin/env bash
# new_effect.sh FXDYN DIRECTORY EFFECT PARAMETERS [LIBRARY]: simulates a friction, identifies it, finds it where it is hidden, predicts and
# exports it; an image for a Cortex-M4 computes it bit for bit in QEMU. The files go to DIRECTORY/EFFECT.
# PARAMETERS as in a scenario, all of them, of a joint with 20 N*m. LIBRARY of fxdyn_add_effects(); none: the effect is in model/effects.
#   tests/new_effect/new_effect.sh build/host/host_tools/cli/fxdyn out/try stribeck 'velocity = 0.1, amplitude = 2'
set -uo pipefail
if [ $# -lt 4 ]; then
  sed -n '2,5s/^# *//p' "$0" >&2
  exit 2
fi
fxdyn=$(realpath "$1")
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
effect=$3 parameters=$4 library=${5:-}
# fxdyn itself starts it for projects that name the library; scenarios and models do not
own=$fxdyn${library:+-$library}
work=$2/$effect
# as in the tables: TanhCubicDamping
type=$(sed -E 's/(^|_)([a-z])/\U\2/g' <<<"$effect")
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
# verb of a program, its output shown where it fails
must() { "$@" >said.txt 2>&1 || { fail "fxdyn $2: $(tail -1 said.txt)"; cat said.txt; exit 1; }; }

effect() { printf '[[effect]]\nname = "%s"\njoint = %s\nparameters = { %s }\n' "$1" "$2" "$3"; }
log() { printf '[[log]]\nname = "%s"\nduration_s = 10\nperiod_s = 5\nspeed = %s\nseed = %s\n' "$1" "$2" "$3"; }
{
  printf 'seed = 4\n[sensors]\nencoder_bits = 22\ntorque_noise = 0.002\n[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n'
  effect viscous '"all"' 'coefficient = [1.5, 0.6]'
  effect coulomb '"all"' 'amplitude = [3.0, 1.2], width = 0.01'
  effect "$effect" 2 "$parameters"
  log a 0.7 1 && log b 0.3 2 && log judge 0.5 3 && log test 0.6 5
} >arm.toml
# project NAME EFFECTS
project() {
  {
    printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n%s\n' "$2"
    [ -z "$library" ] || printf '[effects]\nlibrary = "%s"\n' "$library"
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
must "$own" effects
grep -q "^$effect  *tau = ." said.txt || fail "effects: $effect is not listed"
"$own" effects --json >effects.json

step "simulate"
must "$own" simulate arm.toml --out .

# value FILE PYTHON: a value out of JSON
value() { python3 -c "import json,sys; print(eval(sys.argv[2], {'d': json.load(open(sys.argv[1]))}))" "$1" "$2"; }
# near FILE KIND..: parameters of these kinds that joint 2's effect has, against PARAMETERS: coefficients (linear) to 5 %, shapes, which are
# searched, to 10 %
near() {
  python3 - "$effect" "$parameters" "$@" <<'PYTHON' || fail "$1: parameters of $effect"
import json, sys
effect, text, file, *kinds = sys.argv[1:]
kind_of = {p['name']: p['kind'] for e in json.load(open('effects.json')) if e['effect'] == effect for p in e['parameters']}
expected = {name.strip(): float(value) for name, value in (entry.split('=') for entry in text.split(','))}
fits = [e for e in json.load(open(file))['joints'][1]['effects'] if e['effect'] == effect]
if not fits:
    sys.exit(f'{file}: joint 2 has no {effect}')
wrong = 0
for parameter in fits[0]['parameters']:
    name, value = parameter['name'], parameter['value']
    share = {'linear': 0.05, 'shape': 0.1}[kind_of[name]]
    if kind_of[name] in kinds and abs(value - expected[name]) > share * abs(expected[name]):
        print(f'{name}: {value:.4g}, expected {expected[name]:g} within {share:.0%}')
        wrong = 1
sys.exit(wrong)
PYTHON
}

step "identify"
must "$fxdyn" identify known.toml --out out/known
near out/known/model.json shape linear

step "diagnose"
must "$fxdyn" diagnose hidden.toml --out out/hidden
found=$(value out/hidden/diagnosis.json "[[e['effect'] for e in j['effects']] for j in d['joints']]")
# What goes on is a model that has the effect.
run=hidden
if [ "$found" = "[[], ['$effect']]" ]; then
  near out/hidden/model.json linear
else
  fail "diagnose: found $found; the steps below go on with known.toml"
  run=known
fi

step "predict"
must "$own" predict --model out/$run/model.json --log test.csv --out out/prediction
relative=$(value out/prediction/metrics.json "max(j['relative'] for j in d['logs'][0]['joints'])")
awk -v r="$relative" 'BEGIN { exit !(r < 0.01) }' || fail "predict: relative error $relative"

step "export"
must "$fxdyn" export $run.toml --out out/$run
grep -q "$type" out/$run/tables.hpp || fail "export: the tables do not name it"

step "image for a Cortex-M4"
"$root/toolchains/build_image.sh" out/$run/tables.hpp image cortex-m4 >said.txt 2>&1 || {
  cat said.txt
  fail "the image does not build"
  exit 1
}

step "replay in QEMU"
must "$fxdyn" replay $run.toml --out out/$run --image image/fxdyn-mps2-an386.elf --ticks 500
[ "$(value out/$run/replay.json "d['bit_exact']")" = True ] || fail "replay: not bit for bit"

step "done"
exit $((failures > 0))
