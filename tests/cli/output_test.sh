#!/usr/bin/env bash
# output_test.sh FXDYN: --json prints one object with the results of this run alone, --quiet nothing but notes and complaints.
set -euo pipefail
fxdyn=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT
cd "$work"
failed=0
fail() {
  echo "FAILED: $*" >&2
  failed=1
}

cp "$root/tests/support/elastic_arm/arm.urdf" .
cat >arm.toml <<'TOML'
seed = 4
[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
acceleration = [8, 8]
[[effect]]
name = "viscous"
joint = "all"
parameters = { coefficient = [1.5, 0.6] }
[[log]]
name = "a"
duration_s = 4
period_s = 4
seed = 1
[[log]]
name = "b"
duration_s = 4
period_s = 4
seed = 2
[[log]]
name = "c"
duration_s = 4
period_s = 4
seed = 3
TOML
cat >robot.toml <<'TOML'
[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
[[log]]
file = "a.csv"
role = "train"
[[log]]
file = "b.csv"
role = "test"
TOML

# says CODE PYTHON ARGUMENTS..: the exit code, and what holds for the JSON `d` on standard output
says() {
  local code=0 expected=$1 condition=$2
  shift 2
  "$fxdyn" "$@" >said.json 2>err || code=$?
  [ "$code" -eq "$expected" ] || fail "$*: exit code $code: $(cat err)"
  python3 -c "import json,sys; d = json.load(open('said.json')); sys.exit(not ($condition))" || fail "$*: not $condition: $(head -c 400 said.json)"
}
says 0 "d['verb'] == 'simulate' and d['exit'] == 0 and {'a.csv', 'b.csv'} <= set(d['files'])" simulate arm.toml --out . --json
[ ! -s err ] || fail "simulate --json: progress on standard error: $(head -1 err)"
mkdir out
echo '{"old": 1}' >out/old.json
touch -d '1 hour ago' out/old.json
says 0 "len(d['results']['model.json']['joints']) == 2 and 'metrics.json' in d['results'] and 'old.json' not in d['files']" identify robot.toml --out out --json
says 2 "d['exit'] == 2 and 'gone.toml' in d['complaint'] and not d['results']" identify gone.toml --out none --json
[ "$(wc -l <err)" -eq 1 ] || fail "a complaint has $(wc -l <err) lines"
says 0 "[e for e in d if e['effect'] == 'viscous']" effects --json
says 0 "d['findings'] is not None and d['logs']" check robot.toml --json
says 0 "{'used_by', 'looked_for', 'found'} <= set(d[0])" doctor --json

"$fxdyn" identify robot.toml --out out --quiet >said 2>err || fail "identify --quiet: $(cat err)"
[ ! -s said ] || fail "identify --quiet prints: $(head -1 said)"
! grep -qv "^note: " err || fail "identify --quiet: $(grep -v "^note: " err | head -1)"
# On a terminal verdicts have colours and the table is as wide as that; not with NO_COLOR, a dumb one, or in a file.
cat >look.py <<'PYTHON'
import fcntl, os, pty, struct, subprocess, sys, termios
columns, program = int(sys.argv[1]), sys.argv[2:]
master, slave = pty.openpty()
fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack('HHHH', 40, columns, 0, 0))
child = subprocess.Popen(program, stdout=slave, stderr=subprocess.DEVNULL)
os.close(slave)
try:
    while data := os.read(master, 65536):
        sys.stdout.buffer.write(data)
except OSError:  # how Linux says that the other end is closed
    pass
sys.exit(child.wait())
PYTHON
{ cat robot.toml && printf '[[log]]\nfile = "c.csv"\nrole = "validate"\n'; } >judged.toml
look() { env "$1" "$2" python3 look.py 130 "$fxdyn" diagnose judged.toml --out out >said || fail "diagnose on a terminal: $?"; }
verdict=$'\033\\[3[123]m(nothing missing|explained|unexplained|partly explained)'
look TERM=xterm NO_COLOR=
grep -qE "$verdict" said || fail "no colours on a terminal: $(head -c 300 said)"
look TERM=xterm NO_COLOR=1
! grep -q $'\033' said || fail "colours with NO_COLOR"
grep -q "verdict" said || fail "no table on a terminal"
look TERM=dumb NO_COLOR=
! grep -q $'\033' said || fail "colours on a dumb terminal"
"$fxdyn" diagnose judged.toml --out out >said 2>err || fail "diagnose: $(tail -1 err)"
! grep -q $'\033' said || fail "colours in a file"
code=0
"$fxdyn" identify gone.toml --out out --quiet >said 2>err || code=$?
[ "$code" -eq 2 ] && grep -q "gone.toml" err && [ ! -s said ] || fail "--quiet hides a complaint"
exit $failed
