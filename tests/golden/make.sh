#!/usr/bin/env bash
# make.sh [PROJECT.toml]: makes tests/golden/tables.hpp and vectors.hpp anew, from project.toml here unless told otherwise.
# make.sh remembers: makes tests/golden/remembers anew, from the scenario there.
# Only where the formats, the tables' layout or the arithmetic changed on purpose: these files are what notices otherwise.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
if [ "${1:-}" = remembers ]; then
  which=remembers targets=(model_of_scenario) extent=(60 1)
else
  which=. targets=(fxdyn) extent=()
  project=$(realpath "${1:-$root/tests/golden/project.toml}")
fi
cd "$root"
toolchains/configure.sh host
cmake --build --preset host --target make_golden "${targets[@]}" -j "${JOBS:-$(nproc)}"
out=$root/out/golden/$which
if [ $which = remembers ]; then
  build/host/tests/golden/model_of_scenario tests/golden/remembers/scenario.toml "$out"
else
  build/host/host_tools/cli/fxdyn run "$project" --out "$out" >/dev/null
fi
build/host/tests/golden/make_golden "$out" "tests/golden/$which/vectors.hpp" "${extent[@]}"
cp "$out/tables.hpp" "tests/golden/$which/tables.hpp"
