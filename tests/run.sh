#!/usr/bin/env bash
# run.sh [LABEL...]: builds and runs the tests, all of them or those with one of the labels
#   format unit target hil real diagnosis fuzz bench findings sanitizers
# sanitizers: all unit tests with address and undefined-behaviour sanitizers, for half an hour or more.
# findings: every figure of docs/findings made anew and compared with its page, for an hour or two. Only where it is named.
# Without a label, those unit tests run with sanitizers that read other people's bytes or exercise what runs on a drive.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
labels=(format unit target hil real diagnosis fuzz bench findings sanitizers)
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

# sanitize TARGET LABELS FOLDER...: what it builds of the unit tests in these folders of tests/, with sanitizers. LABELS: a|b
sanitize() {
  build host-asan "$1"
  local folder
  for folder in "${@:3}"; do
    step "unit tests with sanitizers: $folder"
    # Not the command line's tests from end to end, whole projects, or the page in a browser: minutes each here, of code that
    # the others run. Nor what does not compile: its messages are of the other compiler. Nor hundreds of draws of one test, nor times.
    ctest --test-dir "build/host-asan/tests/$folder" --parallel "$jobs" --output-on-failure --no-tests=error -L "^($2)\$" \
      -E '_NOT_BUILT|_cli$|^cli$|^report_browser$|^findings_short$|^must_not_compile|^layers_against$|Seeds$|Seconds$|EveryParameterChangesATorque$'
  done
}

step "packages"
toolchains/setup.sh
build host

# without LABEL [LABEL...]: the labels without the first
without() {
  local label
  for label in "${@:2}"; do [ "$label" = "$1" ] || printf '%s\n' "$label"; done
}
if [[ " $* " == *" findings "* ]]; then
  step "figures of docs/findings"
  tests/findings/figures.py --program build/host/host_tools/cli/fxdyn
  mapfile -t others < <(without findings "$@")
  [ ${#others[@]} -gt 0 ] || exit 0
  set -- "${others[@]}"
fi
if [[ " $* " == *" sanitizers "* ]]; then
  sanitize unit_tests "unit|exposed" .
  mapfile -t others < <(without sanitizers "$@")
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
ctest --test-dir build/host --parallel "$jobs" --output-on-failure --no-tests=error ${1:+-L "$pattern"} || {
  tests/failed.py build/host
  exit 8
}
[ $# -eq 0 ] || exit 0

# Not model/: it runs under clang's checks of integers and array bounds (tests/portable), and compiling it once more takes minutes.
mapfile -t exposed <tests/exposed.txt
sanitize exposed_unit_tests exposed "${exposed[@]}"
printf '\ndone in %d s\n' "$SECONDS"
