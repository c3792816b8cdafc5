#!/usr/bin/env bash
# cell.sh COMPILER TARGET LEVEL GOLDEN PAGES BUILD_DIR: builds the example drive with one compiler (gcc | clang) for one
# target (host | m4) at one level of optimisation (O1 O2 O3 Os lto) and replays the golden setpoints through it: the golden
# torques, bit for bit. Then flashes pages over its tables without a rebuild: other numbers are computed with, a damaged
# page is refused. GOLDEN: the folder of the golden tables and vectors; PAGES: the program that makes those pages.
set -euo pipefail
target=$2 level=$3 golden=$4 pages=$5 build=$6
cd "$(dirname "$0")/../.."
source tests/portable/compilers.sh
choose_compiler "$1" "$target"
mkdir -p "$build"
objcopy=objcopy
[ "$target" = host ] || objcopy=arm-none-eabi-objcopy

optimise=("-$level")
[ "$level" != lto ] || optimise=(-O2 -flto)
objects=()
object() {  # SOURCE
  objects+=("$build/$(basename "$1" .cpp).o")
  "${compile[@]}" "${optimise[@]}" -I"$golden" -c "$1" -o "${objects[-1]}"
}
object tests/portable/replay_main.cpp
[ "$target" = host ] || object hal/mps2/startup.cpp
[ "${link[0]}" = ld.lld-14 ] || link+=("${optimise[@]}")
"${link[@]}" "${objects[@]}" "${libraries[@]}" -o "$build/drive"

run() {  # PROGRAM
  if [ "$target" = host ]; then
    timeout 20 "$1"
  else
    timeout 60 qemu-system-arm -M mps2-an386 -nographic -monitor none -serial null \
      -semihosting-config enable=on,target=native -kernel "$1" 2>&1 </dev/null
  fi
}
result=0
expect() {  # PROGRAM WORDS WHAT
  local said
  said=$(run "$1") || said="$said (exit code $?)"
  [ "$said" = "$2" ] || { echo "portable: $3: '$said' instead of '$2'" >&2; result=1; }
}

figures=$("$pages" "$build")
torques_of() { awk -v page="$1" '$1 == page { print $2 }' <<<"$figures"; }
[ "$(torques_of golden)" != "$(torques_of other)" ]
expect "$build/drive" "torques $(torques_of golden)" "golden tables"
for page in other damaged; do
  "$objcopy" --update-section ".fxdyn_tables=$build/$page.bin" "$build/drive" "$build/drive-$page" 2>"$build/objcopy.log"
done
expect "$build/drive-other" "torques $(torques_of other)" "other numbers, flashed without a rebuild"
expect "$build/drive-damaged" "refused, no torque" "a damaged page"
exit $result
