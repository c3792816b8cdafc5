#!/usr/bin/env bash
# slot.sh BOARD PRESET BUILD_DIR: builds the drive node and starts it with all that its slot for updates may hold
# (slot_test.py).
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: slot.sh BOARD PRESET BUILD_DIR" >&2; exit 2; }
board=$1 preset=$2 build=$3
root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
mkdir -p "$build"
(cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target fxdyn_node) >"$build/slot.log" 2>&1 || { cat "$build/slot.log" >&2; exit 1; }
image=$build/firmware/node-$board.elf
arm-none-eabi-objcopy -O binary --only-section=.fxdyn_tables "$image" "$build/own_page.bin"
slot=$(arm-none-eabi-nm "$image" | awk '$3 == "fxdyn_update_begin" { print $1 }')
exec tests/target/slot_test.py "$board" "$image" "$build/own_page.bin" "0x$slot"
