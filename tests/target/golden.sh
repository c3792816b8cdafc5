#!/usr/bin/env bash
# golden.sh PRESET BUILD_DIR [gate|append] [IMAGE]: builds the golden replay IMAGE (golden, golden_remembers) for a cross preset,
# runs it on its board in QEMU and holds the figures against the newest row of that board and image in firmware/budget.csv;
# `append` adds a row instead.
# FXDYN_CONSTANT_TICK=0: a tick need not take the same number of instructions whatever the data.
set -euo pipefail
preset=$1 build=$2 what=${3:-gate} image=${4:-golden}
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=$root/firmware/budget.csv

cd "$root"
cmake --preset "$preset" -B "$build" >/dev/null
cmake --build "$build" --target "fxdyn_$image" >"$build/$image.log" 2>&1 || { cat "$build/$image.log" >&2; exit 1; }
elf=$(echo "$build"/tests/golden/"$image"-*.elf)
board=$(basename "$elf" .elf)
board=${board#"$image"-}

# One instruction takes 2^8 ns of emulated time, so that SysTick counts instructions (hal/mps2/systick.hpp).
result=0
said=$(timeout 300 qemu-system-arm -M "$board" -icount shift=8 -nographic -monitor none -serial null \
  -semihosting-config enable=on,target=native -kernel "$elf" 2>&1 </dev/null) || result=$?
echo "$board, $image: $(tr '\n' ',' <<<"$said")"
[ $result -eq 0 ] || { echo "golden: not bit for bit the host's, or stopped (exit code $result)" >&2; exit 1; }

figure() { awk -v name="$1" '$1 == name { print $2 }' <<<"$said"; }
size() { sed -E "s/.*\"$1\": ([0-9]+).*/\1/" "${elf%.elf}.size.json"; }
fewest=$(figure fewest_instructions)
most=$(figure most_instructions)
if [ "$fewest" != "$most" ]; then
  echo "golden: a tick takes $fewest to $most instructions, depending on the data" >&2
  [ "$what" = append ] || [ "${FXDYN_CONSTANT_TICK:-1}" = 0 ] || exit 1
fi

if [ "$what" = append ]; then
  echo "$(date +%F),$board,$image,$(figure joints),$(figure effects),$(figure bls_nodes),$most,$(size flash_bytes),$(
    size ram_bytes),$(size stack_bytes)" >>"$budget"
  exit 0
fi
row=$(awk -F, -v board="$board" -v image="$image" '$2 == board && $3 == image { row = $0 } END { print row }' "$budget")
[ -n "$row" ] || { echo "golden: no row for $board, $image in firmware/budget.csv: tests/target/budget.sh adds them" >&2; exit 1; }
IFS=, read -r _ _ _ joints effects nodes instructions flash ram stack <<<"$row"
if [ "$joints,$effects,$nodes" != "$(figure joints),$(figure effects),$(figure bls_nodes)" ]; then
  echo "golden: the newest row of $board, $image is about another model: tests/target/budget.sh adds rows" >&2
  exit 1
fi
within() {  # NAME MEASURED BUDGET
  [ -z "$2" ] || [ "$2" -le "$3" ] || { echo "golden: $board, $image: $1 $2, the budget is $3 (firmware/budget.csv)" >&2; return 1; }
}
within instructions_per_tick "$most" "$instructions"
within flash_bytes "$(size flash_bytes)" "$flash"
within ram_bytes "$(size ram_bytes)" "$ram"
within stack_bytes "$(size stack_bytes)" "$stack"
