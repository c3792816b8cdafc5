#!/usr/bin/env bash
# image.sh BUILD_DIR [MODEL]: builds the STM32G474's drive node with the tables of a golden model, as `flash` would program it.
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: image.sh BUILD_DIR [MODEL]" >&2; exit 2; }
build=$1
model=${2:-}
root=$(cd "$(dirname "$0")/../.." && pwd)

cd "$root"
mkdir -p "$build"
(cmake --preset stm32g474 -B "$build" -DFXDYN_TABLES="$root/tests/golden/${model:+$model/}tables.hpp" &&
  cmake --build "$build" --target fxdyn_node) >"$build/image.log" 2>&1 || { cat "$build/image.log" >&2; exit 1; }
