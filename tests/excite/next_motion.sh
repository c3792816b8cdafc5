#!/usr/bin/env bash
# next_motion.sh FXDYN DIRECTORY: a diagnosis of slow motion leaves open which effect an arm's elbow has. The motion that
# `excite --after` plans is played on the arm and joins the train logs: the diagnosis names the effect.
set -euo pipefail
fxdyn=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
rm -rf "$2"
mkdir -p "$2"
cd "$2"
cp "$root/tests/support/elastic_arm/arm.urdf" .
fail() { echo "FAILED: $*" >&2; exit 1; }

# scenario NAME EFFECT PARAMETERS LOG..: logs as TOML tables
scenario() {
  printf 'seed = 4\n[sensors]\nencoder_bits = 22\ntorque_noise = 0.01\n[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n'
  printf '[[effect]]\nname = "viscous"\njoint = "all"\nparameters = { coefficient = [1.5, 0.6] }\n'
  printf '[[effect]]\nname = "coulomb"\njoint = "all"\nparameters = { amplitude = [3.0, 1.2], width = 0.01 }\n'
  printf '[[effect]]\nname = "%s"\njoint = 2\nparameters = { %s }\n' "$1" "$2"
}
drawn() { printf '[[log]]\nname = "%s"\nduration_s = 10\nperiod_s = 5\nspeed = %s\nseed = %s\n' "$1" "$2" "$3"; }
planned() {
  python3 - <<'PYTHON'
import json
for i, one in enumerate(json.load(open('next/excite.json'))['trajectories']):
    print(f'[[log]]\nname = "next{i}"\nplan = "next/excite.json"\ntrajectory = "{one["name"]}"\nduration_s = {one["duration_s"]}\nseed = {40 + i}')
PYTHON
}
# project LOG:ROLE..
project() {
  printf '[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n[limits]\nacceleration = [8, 8]\n'
  for entry in "$@"; do printf '[[log]]\nfile = "%s.csv"\nrole = "%s"\n' "${entry%:*}" "${entry#*:}"; done
}
value() { python3 -c "import json,sys; d = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))" "$1" "$2"; }
established="[e['effect'] for e in d['joints'][1]['effects'] if e['certainty'] == 'established']"

# names EFFECT PARAMETERS SPEEDS..: open before, established after
names() {
  local effect=$1 parameters=$2 next
  { scenario "$effect" "$parameters"; drawn a "$3" 1; drawn b "$4" 2; drawn judge "$5" 3; } >arm.toml
  project a:train b:train judge:validate >before.toml
  "$fxdyn" simulate arm.toml --out . >/dev/null
  "$fxdyn" diagnose before.toml --out before >/dev/null
  [ "$(value before/diagnosis.json "$established")" = "[]" ] || fail "$effect: the first diagnosis leaves nothing open"
  "$fxdyn" excite before.toml --after before --out next >said.txt
  grep -q '^joint 2: ' said.txt || fail "$effect: joint 2 is no question: $(cat said.txt)"
  { scenario "$effect" "$parameters"; planned; } >next.toml
  "$fxdyn" simulate next.toml --out . >/dev/null
  next=$(value next/excite.json "' '.join(f'next{i}:train' for i in range(len(d['trajectories'])))")
  # shellcheck disable=SC2086
  project a:train b:train judge:validate $next >after.toml
  "$fxdyn" diagnose after.toml --out after >/dev/null
  [ "$(value after/diagnosis.json "$established")" = "['$effect']" ] ||
    fail "$effect: after the planned motion: $(value after/diagnosis.json "[(e['effect'], e['certainty']) for e in d['joints'][1]['effects']]")"
}

names viscous_cubic 'coefficient = 0.8' 0.3 0.2 0.25
names viscous_quadratic 'coefficient = 0.7' 0.3 0.2 0.25

# One line each, and nothing is written.
refused() {
  local expected=$1
  shift
  if "$fxdyn" excite "$@" --out refused >out.txt 2>err.txt; then fail "not refused: $*"; fi
  grep -q "$expected" err.txt || fail "$*: $(cat err.txt)"
  [ "$(grep -c . err.txt)" -eq 1 ] || fail "more than a line: $(cat err.txt)"
  [ ! -e refused/excite.json ] || fail "written: $*"
}
refused 'missing; --after takes the --out of' before.toml --after nowhere
refused "is of the project 'after.toml', or of another robot, not of 'before.toml'" before.toml --after after
echo passed
