#!/usr/bin/env bash
# build_image.sh TABLES.hpp OUT_DIR [PRESET]: builds the firmware image with these tables (preset: cortex-m4).
# Leaves OUT_DIR/fxdyn-<board>.elf and OUT_DIR/size.json; the build tree stays in OUT_DIR/build-PRESET for the next time.
set -euo pipefail
if [ $# -lt 2 ]; then
  echo "usage: build_image.sh TABLES.hpp OUT_DIR [PRESET]" >&2
  exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
[ -f "$1" ] || { echo "build_image: no such file: $1" >&2; exit 2; }
command -v arm-none-eabi-g++ >/dev/null || { echo "build_image: arm-none-eabi-g++ not found: run toolchains/setup.sh" >&2; exit 2; }
tables=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
preset=${3:-cortex-m4}
known=$(awk '/^[a-z]/ && / fxdyn=/ { printf " %s", $2 }' "$root/toolchains/boards.txt")
[[ "$known " == *" $preset "* ]] || { echo "build_image: no image for '$preset', known:$known" >&2; exit 2; }
# a library of effects that fxdyn_add_effects() made
library=$(sed -n 's|^// Effects of the library \([a-z0-9_]*\) are in it[.]$|\1|p' "$tables")
effects=${library:+$root/build/host/effects/$library.hpp}
rm -f "$out"/fxdyn-*.elf "$out/size.json"
build=$out/build-$preset

log=$out/build-$preset.log
(cd "$root" && cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$tables" -DFXDYN_EFFECTS="$effects" && cmake --build "$build" --target fxdyn_image) \
  >"$log" 2>&1 || { cat "$log" >&2; exit 1; }

elf=$(echo "$build"/firmware/fxdyn-*.elf)
cp "$elf" "$out/"
cp "${elf%.elf}.size.json" "$out/size.json"
