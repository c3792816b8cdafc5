#!/usr/bin/env bash
# package.sh: installs fxdyn and builds firmware/example_drive against the installed package only, for the host, where damaged
# tables are refused, and for a Cortex-M4.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
quietly() { "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }; }

quietly cmake -S "$root" -B "$work/fxdyn" -DFXDYN_MODEL_ONLY=ON
quietly cmake --install "$work/fxdyn" --prefix "$work/prefix"
cp -r "$root/firmware/example_drive" "$work/my_drive"
cp "$root/tests/golden/tables.hpp" "$work/my_drive/"

build() {  # NAME ARGUMENT..
  quietly cmake -S "$work/my_drive" -B "$work/$1" -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Release "${@:2}"
  quietly cmake --build "$work/$1"
}
build host
"$work/host/my_drive"
# Tables that a flash has lost bits of: the drive says so, by its exit code here.
objcopy -O binary --only-section=.fxdyn_tables "$work/host/my_drive" "$work/tables.bin"
flashed() { objcopy --update-section .fxdyn_tables="$work/tables.bin" "$work/host/my_drive" "$work/flashed" && "$work/flashed"; }
flashed
printf 'lost' | dd of="$work/tables.bin" bs=1 seek=1000 conv=notrunc status=none
if flashed; then
  echo "package: the example drive runs with damaged tables" >&2
  exit 1
fi
build cortex-m4 --toolchain "$work/prefix/share/fxdyn/toolchains/arm-none-eabi.cmake" -DFXDYN_CPU=cortex-m4
arm-none-eabi-nm "$work/cortex-m4/my_drive.elf" | grep -q fxdyn_tables_begin
if grep -rqF "$root/" "$work/host/CMakeFiles/my_drive.dir" "$work/cortex-m4/CMakeFiles/my_drive.dir"; then
  echo "package: built from the source tree instead of the installed package" >&2
  exit 1
fi
