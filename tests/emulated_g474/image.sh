#!/usr/bin/env bash
# image.sh BUILD_DIR: builds the STM32G474's drive node with the golden tables, as `flash` would program it.
set -euo pipefail
[ $# -eq 1 ] || { echo "usage: image.sh BUILD_DIR" >&2; exit 2; }
build=$1
root=$(cd "$(dirname "$0")/../.." && pwd)

cd "$root"
mkdir -p "$build"
(cmake --preset stm32g474 -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target fxdyn_node) >"$build/image.log" 2>&1 || { cat "$build/image.log" >&2; exit 1; }
