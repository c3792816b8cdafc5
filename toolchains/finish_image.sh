#!/usr/bin/env bash
# finish_image.sh PREFIX IMAGE.elf OBJECT_DIR.. -- ROOT..: after linking: checks what the image contains, bounds its
# stack and writes IMAGE.size.json beside it. PREFIX: of the binutils, e.g. arm-none-eabi-; ROOT: as in stack_bound.py.
set -euo pipefail
here=$(dirname "$0")
prefix=$1 elf=$2
shift 2
objects=()
while [ "$1" != -- ]; do objects+=("$1"); shift; done
shift
size=${elf%.elf}.size.json
rm -f "$size"

"$here/check_image.sh" "${prefix}nm" "${prefix}objdump" "$elf"
limit=$((16#$("${prefix}nm" "$elf" | awk '$3 == "fxdyn_stack_size" { print $1 }')))
stack=$("$here/stack_bound.py" --objdump "${prefix}objdump" --elf "$elf" --ci "${objects[@]}" --root "$@" --limit "$limit")
# Berkeley format: text counts everything read-only, bss the zeroed data and the stack.
"${prefix}size" "$elf" | awk -v stack="$stack" 'NR == 2 {
  printf "{\"flash_bytes\": %d, \"ram_bytes\": %d, \"stack_bytes\": %d}\n", $1 + $2, $2 + $3, stack }' >"$size"
