#!/usr/bin/env bash
# run.sh [LABEL...]: builds and runs the tests, all of them or those with one of the labels
#   format unit target hil real diagnosis fuzz bench findings
# findings: every figure of docs/findings made anew and compared with its page, for an hour or two. Only where it is named.
# Without a label the unit tests also run with address and undefined-behaviour sanitizers.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
labels=(format unit target hil real diagnosis fuzz bench findings)
for label in "$@"; do
  if [[ " ${labels[*]} " != *" $label "* ]]; then
    echo "run.sh: unknown label '$label'; known: ${labels[*]}" >&2
    exit 2
  fi
done

cd "$root"
step() { printf '\n[%3d s] %s\n' "$SECONDS" "$*"; }
jobs=$(nproc)

# build PRESET [TARGET]
build() {
  step "building $1"
  # From nothing, files are compiled several at once, which takes half the time. Who works here configures without.
  local together=()
  [ -f "build/$1/CMakeCache.txt" ] || together=(-DCMAKE_UNITY_BUILD=ON)
  toolchains/configure.sh "$1" "${together[@]}"
  cmake --build --preset "$1" ${2:+--target "$2"}
}

step "packages"
toolchains/setup.sh
build host

if [[ " $* " == *" findings "* ]]; then
  step "figures of docs/findings"
  tests/findings/figures.py --program build/host/host_tools/cli/fxdyn
  others=()
  for label in "$@"; do [ "$label" = findings ] || others+=("$label"); done
  [ ${#others[@]} -gt 0 ] || exit 0
  set -- "${others[@]}"
fi

for label in "$@"; do
  if ctest --test-dir build/host -N -L "^$label\$" | grep -q '^Total Tests: 0$'; then
    echo "run.sh: no tests have the label '$label' yet" >&2
    exit 1
  fi
done

pattern=$(IFS='|'; echo "^($*)\$")
step "tests"
ctest --test-dir build/host --parallel "$jobs" --output-on-failure --no-tests=error ${1:+-L "$pattern"}
[ $# -eq 0 ] || exit 0

build host-asan unit_tests
step "unit tests with sanitizers"
# Not the command line's tests from end to end, whole projects, or the page in a browser: minutes each here, of code that
# the others run. Nor what does not compile: its messages are of the other compiler. Nor hundreds of draws of one test, nor times.
ctest --test-dir build/host-asan --parallel "$jobs" --output-on-failure --no-tests=error -L '^unit$' -E '_cli$|^cli$|^report_browser$|^findings_short$|^must_not_compile|^layers_against$|Seeds$|Seconds$|EveryParameterChangesATorque$'
printf '\ndone in %d s\n' "$SECONDS"
