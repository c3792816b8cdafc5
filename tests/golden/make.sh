#!/usr/bin/env bash
# make.sh [PROJECT.toml]: makes tests/golden/tables.hpp and vectors.hpp anew, from project.toml here unless told otherwise.
# Only where the formats, the tables' layout or the arithmetic changed on purpose: these files are what notices otherwise.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
project=$(realpath "${1:-$root/tests/golden/project.toml}")
cd "$root"
cmake --preset host >/dev/null
cmake --build --preset host --target fxdyn make_golden -j "${JOBS:-$(nproc)}"
out=$root/out/golden
build/host/host_tools/cli/fxdyn run "$project" --out "$out" >/dev/null
build/host/tests/golden/make_golden "$out" tests/golden/vectors.hpp
cp "$out/tables.hpp" tests/golden/tables.hpp
