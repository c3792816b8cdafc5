#!/usr/bin/env bash
# kernels.sh PRESET BUILD_DIR [gate|append]: instructions of the tick's kernels on the preset's board in QEMU, and the sizes
# of the drive's whole image with the golden tables, held against the newest rows of that board in firmware/budget.csv;
# `append` adds rows instead.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: kernels.sh cortex-m3|cortex-m4|cortex-m7|cortex-m33 BUILD_DIR [gate|append]" >&2; exit 2; }
preset=$1 build=$2 what=${3:-gate}
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=$root/firmware/budget.csv

cd "$root"
cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" >/dev/null
cmake --build "$build" --target fxdyn_kernels fxdyn_image >"$build/kernels.log" 2>&1 || { cat "$build/kernels.log" >&2; exit 1; }
elf=$(echo "$build"/tests/golden/kernels-*.elf)
board=$(basename "$elf" .elf)
board=${board#kernels-}
said=$(timeout 60 qemu-system-arm -M "$board" -icount shift=8 -nographic -monitor none -serial null \
  -semihosting-config enable=on,target=native -kernel "$elf" 2>&1 </dev/null)

result=0
size() { sed -E "s/.*\"$1\": ([0-9]+).*/\1/" "$build"/firmware/fxdyn-*.size.json; }
if [ "$what" = append ]; then
  model=$(sed -nE 's/.*joints = ([0-9]+), effects = ([0-9]+), bls_nodes = ([0-9]+);.*/\1,\2,\3/p' tests/golden/vectors.hpp)
  echo "$(date +%F),$board,drive,$model,,$(size flash_bytes),$(size ram_bytes),$(size stack_bytes)" >>"$budget"
else
  row=$(awk -F, -v board="$board" '$2 == board && $3 == "drive" { row = $8 "," $9 "," $10 } END { print row }' "$budget")
  echo "$board: drive flash,ram,stack $(size flash_bytes),$(size ram_bytes),$(size stack_bytes) (budget $row)"
  IFS=, read -r flash ram stack <<<"${row:-0,0,0}"
  if [ "$(size flash_bytes)" -gt "$flash" ] || [ "$(size ram_bytes)" -gt "$ram" ] || [ "$(size stack_bytes)" -gt "$stack" ]; then
    echo "kernels: $board: the drive's image is larger than its budget (firmware/budget.csv)" >&2
    result=1
  fi
fi
while read -r kernel instructions; do
  if [ "$what" = append ]; then
    echo "$(date +%F),$board,$kernel,6,,,$instructions,,," >>"$budget"
    continue
  fi
  most=$(awk -F, -v board="$board" -v kernel="$kernel" '$2 == board && $3 == kernel { most = $7 } END { print most }' "$budget")
  echo "$board: $kernel $instructions (budget $most)"
  if [ -z "$most" ] || [ "$instructions" -gt "$most" ]; then
    echo "kernels: $board: $kernel takes $instructions instructions, the budget is ${most:-missing} (firmware/budget.csv)" >&2
    result=1
  fi
done <<<"$said"
exit $result
