#!/usr/bin/env bash
# build_node.sh TABLES.hpp OUT_DIR [linux|PRESET]: builds the drive node with these tables; PRESET: one of boards.txt with an image
# "node". Leaves it in OUT_DIR: fxdyn_node (linux, the default), else node-<board>.elf, .bin and .hex with their size.json.
set -euo pipefail
if [ $# -lt 2 ]; then
  sed -n '2,3s/^# //p' "$0" >&2
  exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
[ -f "$1" ] || { echo "build_node: no such file: $1" >&2; exit 2; }
tables=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
preset=${3:-linux}
known=$(awk '/^[a-z]/ && / node=/ { printf " %s", $2 }' "$root/toolchains/boards.txt")
[[ " linux$known " == *" $preset "* ]] || { echo "build_node: no node for '$preset', known: linux$known" >&2; exit 2; }
target=fxdyn_node configure=$preset
[ "$preset" != linux ] || { target=fxdyn_linux_node configure=host; }
# a library of effects that fxdyn_add_effects() made
library=$(sed -n 's|^// Effects of the library \([a-z0-9_]*\) are in it[.]$|\1|p' "$tables")
effects=${library:+$root/build/host/effects/$library.hpp}
build=$out/build-$preset log=$out/build-$preset.log
(cd "$root" && cmake --preset "$configure" -B "$build" -DFXDYN_TABLES="$tables" -DFXDYN_EFFECTS="$effects" && cmake --build "$build" --target "$target") \
  >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
if [ "$preset" = linux ]; then
  cp "$build/fxdyn_linux_node" "$out/fxdyn_node"
else
  cp "$build"/firmware/node-* "$out/"
fi
