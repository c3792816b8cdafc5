#!/usr/bin/env bash
# flash_test.sh BUILD_DIR_OF_STM32G474: openocd reads the configurations of the boards without hardware and knows their flash;
# `flash-tables` programs the right page to the right address and refuses every other one.
set -euo pipefail
build=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "flash_test: $*" >&2; exit 1; }

for target in $(awk '/^[a-z]/ && $6 != "-" { print $6 }' "$root/toolchains/boards.txt"); do
  said=$(openocd -f interface/stlink.cfg -f "target/$target.cfg" -c 'echo [flash list]; shutdown' 2>&1) ||
    fail "openocd does not read $target: $said"
  grep -q "name $target.flash driver" <<<"$said" || fail "$target: no flash bank: $said"
done

# The targets' own commands, with a stand-in for openocd that prints what it is told.
elf=$build/firmware/node-stm32g474.elf
commands=$(cd "$build" && ninja -t commands flash)
grep -q "toolchains/openocd.sh -f interface/stlink.cfg -f target/stm32g4x.cfg -c .*program.*node-stm32g474.elf.* verify reset exit" <<<"$commands" ||
  fail "flash runs $commands"
printf '#!/bin/sh\necho "$@"\n' >"$work/openocd"
chmod +x "$work/openocd"
tables() { OPENOCD=$work/openocd "$root/toolchains/flash_tables.sh" arm-none-eabi- "$elf" "$1" -f interface/stlink.cfg 2>&1; }

# What stops openocd is told in one line, whatever else it prints.
printf '#!/bin/sh\necho "Info : clock speed 2000 kHz"\necho "$SAYS" >&2\nexit ${CODE:-1}\n' >"$work/failing"
chmod +x "$work/failing"
expect_advice() {  # OPENOCD_SAYS ADVICE
  said=$(SAYS=$1 OPENOCD=$work/failing "$root/toolchains/openocd.sh" -f x 2>&1) && fail "a failing openocd is taken for a good one"
  [ "$(grep -c '^flash: ' <<<"$said")" -eq 1 ] && [[ $said == *"flash: $2"* ]] || fail "'$1' is told as: $said"
}
expect_advice 'Error: open failed' 'no debug probe'
expect_advice 'Error: libusb_open() failed with LIBUSB_ERROR_ACCESS' 'no permission'
expect_advice 'Error: init mode failed (unable to connect to the target)' 'the board does not answer'
expect_advice 'Error: flash write failed' 'openocd failed'
SAYS=done CODE=0 OPENOCD=$work/failing "$root/toolchains/openocd.sh" >"$work/said" || fail "a good openocd is taken for a failing one"
! grep -q '^flash: ' "$work/said" || fail "advice for a good openocd"

arm-none-eabi-objcopy -O binary --only-section=.fxdyn_tables "$elf" "$work/tables.bin"
said=$(tables "$work/tables.bin") || fail "refuses the image's own page: $said"
[[ $said == *"program {$work/tables.bin} verify reset exit 0x08078000" ]] || fail "programs $said"
for build_output in bin hex; do [ -s "${elf%.elf}.$build_output" ] || fail "no .$build_output"; done
# The .bin begins with the stack's end and the entry, in flash.
[ "$(od -An -t x4 -j 4 -N 4 "${elf%.elf}.bin" | cut -c 2-5)" = 0800 ] || fail "the .bin does not begin with a vector table"

expect_refusal() {  # FILE MESSAGE
  said=$(tables "$1") && fail "takes $1"
  [[ $said == *"$2"* ]] || fail "says $said"
}
expect_refusal "$work/nothing.bin" "no such file"
{ printf 'FXD1\1\2\3\4'; tail -c +9 "$work/tables.bin"; } >"$work/other.bin"
expect_refusal "$work/other.bin" "another model or layout"
# patched FILE WORD VALUE
patched() { printf "$(printf '\\x%02x' $(($3 & 255)) $(($3 >> 8 & 255)) $(($3 >> 16 & 255)) $(($3 >> 24)))" | dd of="$1" bs=4 seek="$2" conv=notrunc status=none; }
word() { od -A n -t u4 -j $((4 * $2)) -N 4 "$1" | tr -d ' '; }
cp "$work/tables.bin" "$work/changed.bin"
patched "$work/changed.bin" 4 $(($(word "$work/tables.bin" 4) ^ 1))
expect_refusal "$work/changed.bin" "an update of another model"
cp "$work/tables.bin" "$work/changed.bin"
patched "$work/changed.bin" 3 1
expect_refusal "$work/changed.bin" "would not take it"  # of the same number, but not the image's own
patched "$work/changed.bin" 5 0
expect_refusal "$work/changed.bin" "has sequence 0"
patched "$work/changed.bin" 5 $(($(word "$work/tables.bin" 5) + 1))
said=$(tables "$work/changed.bin") || fail "refuses an update: $said"
[[ $said == *"0x08078000" ]] || fail "programs $said"
head -c 40000 /dev/zero >"$work/large.bin"
expect_refusal "$work/large.bin" "the slot has 32768"
