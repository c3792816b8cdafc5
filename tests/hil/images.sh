#!/usr/bin/env bash
# images.sh DIRECTORY TABLES.hpp: the firmware images that the test bed runs in emulators.
set -euo pipefail
cd "$(dirname "$0")/../.."
build() {
  cmake --preset "$1" -B "$2/$1" -DFXDYN_TABLES="$3" >/dev/null
  cmake --build "$2/$1" --target "$4" >/dev/null
}
build cortex-m4 "$1" "$2" fxdyn_node
build cortex-r5 "$1" "$2" fxdyn_node_qemu
