#!/usr/bin/env bash
# kernels.sh PRESET BUILD_DIR [gate|append]: instructions of the tick's kernels on the preset's board in QEMU, held against
# the newest row of that board and kernel in firmware/budget.csv; `append` adds rows instead.
set -euo pipefail
preset=$1 build=$2 what=${3:-gate}
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=$root/firmware/budget.csv

cd "$root"
cmake --preset "$preset" -B "$build" >/dev/null
cmake --build "$build" --target fxdyn_kernels >"$build/kernels.log" 2>&1 || { cat "$build/kernels.log" >&2; exit 1; }
elf=$(echo "$build"/tests/golden/kernels-*.elf)
board=$(basename "$elf" .elf)
board=${board#kernels-}
said=$(timeout 60 qemu-system-arm -M "$board" -icount shift=8 -nographic -monitor none -serial null \
  -semihosting-config enable=on,target=native -kernel "$elf" 2>&1 </dev/null)

result=0
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
