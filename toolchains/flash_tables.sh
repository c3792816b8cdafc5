#!/usr/bin/env bash
# flash_tables.sh PREFIX IMAGE.elf TABLES.bin OPENOCD_ARGUMENT..: writes a page of tables into the slot for updates of the
# board that runs IMAGE, and resets it. Refuses a page that IMAGE would not take: of another layout or model, or not newer
# than its own (its own it takes: that ends an update).
# PREFIX: of the binutils, e.g. arm-none-eabi-. OPENOCD: another program than openocd.
set -euo pipefail
[ $# -ge 4 ] || { echo "usage: flash_tables.sh PREFIX IMAGE.elf TABLES.bin OPENOCD_ARGUMENT.." >&2; exit 2; }
prefix=$1 elf=$2 page=$3
shift 3
[ -f "$page" ] || { echo "flash_tables: no such file: $page: fxdyn export or fxdyn update writes it" >&2; exit 2; }

address() { "${prefix}nm" "$elf" | awk -v name="$1" '$3 == name { print $1 }'; }
begin=$(address fxdyn_update_begin) end=$(address fxdyn_update_end)
[ -n "$begin" ] && [ -n "$end" ] || { echo "flash_tables: $elf has no slot for updated tables" >&2; exit 1; }
size=$(stat -c %s "$page")
[ "$size" -le $((16#$end - 16#$begin)) ] || { echo "flash_tables: $page: $size bytes, the slot has $((16#$end - 16#$begin))" >&2; exit 1; }

own=$(mktemp)
trap 'rm -f "$own"' EXIT
"${prefix}objcopy" -O binary --only-section=.fxdyn_tables "$elf" "$own"
# model/table_page.hpp: magic, layout hash, words, CRC; origin, sequence, check
word() { od -A n -t u4 --endian=little -j $((4 * $2)) -N 4 "$1" | tr -d ' '; }
if ! cmp -s -n 12 "$own" "$page"; then
  echo "flash_tables: $page is for another model or layout than $elf: build and flash the image anew" >&2
  exit 1
fi
if [ "$(word "$page" 4)" != "$(word "$own" 4)" ]; then
  echo "flash_tables: $page is an update of another model than $elf has: build and flash the image anew" >&2
  exit 1
fi
is=$(word "$page" 5) has=$(word "$own" 5)
if [ "$is" -le "$has" ] && ! cmp -s "$own" "$page"; then
  echo "flash_tables: $page has sequence $is, $elf has $has itself and would not take it: build and flash the image anew" >&2
  exit 1
fi
"$(dirname "$0")/openocd.sh" "$@" -c "program {$page} verify reset exit 0x$begin"
