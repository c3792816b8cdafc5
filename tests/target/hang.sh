#!/usr/bin/env bash
# hang.sh BOARD PRESET BUILD_DIR: builds the drive node whose tick hangs and sees its watchdog reset it (hang_test.py).
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: hang.sh BOARD PRESET BUILD_DIR" >&2; exit 2; }
board=$1 preset=$2 build=$3
root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
mkdir -p "$build"
(cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target fxdyn_node_hangs) >"$build/hang.log" 2>&1 || { cat "$build/hang.log" >&2; exit 1; }
exec tests/target/hang_test.py "$board" "$build"
