#!/usr/bin/env bash
# node.sh BOARD PRESET BUILD_DIR EXPECTED [gate|append]: builds the drive node's image with the golden tables, runs it on its
# emulated board over its own bus (node_test.py; stm32g474 has no emulator) and holds its figures against the newest row
# "node" of the board in firmware/budget.csv; `append` adds a row instead.
set -euo pipefail
[ $# -ge 4 ] || { echo "usage: node.sh BOARD PRESET BUILD_DIR EXPECTED [gate|append]" >&2; exit 2; }
board=$1 preset=$2 build=$3 expected=$4 what=${5:-gate}
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=$root/firmware/budget.csv
most_flash=65536 most_ram=12288 most_instructions=16000  # of a node with six joints; bytes

cd "$root"
mkdir -p "$build"
targets=(fxdyn_node)
[ "$board" != zynqmp_r5 ] || targets+=(fxdyn_node_qemu)
[[ $board != mps2-* ]] || targets+=(fxdyn_node_measured fxdyn_node_cost)
(cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target "${targets[@]}") >"$build/node.log" 2>&1 || { cat "$build/node.log" >&2; exit 1; }

instructions= faulty=
if [ "$board" != stm32g474 ]; then
  said=$("$root/tests/target/node_test.py" "$board" "$build" "$expected")
  echo "$board: $(tr '\n' ',' <<<"$said")"
fi
if [[ $board == mps2-* ]]; then
  # The tick with its protocol, bus in memory: as a CAN controller hands frames over, and the same number in every run.
  said=$(timeout 100 qemu-system-arm -M "$board" -icount shift=8 -nographic -monitor none -serial null \
    -semihosting-config enable=on,target=native -kernel "$build/tests/golden/node_cost-$board.elf" 2>&1 </dev/null) ||
    { echo "node: $board: node_cost stopped: $said" >&2; exit 1; }
  echo "$board, bus in memory: $(tr '\n' ',' <<<"$said")"
  instructions=$(awk '$1 == "most_everything" { print $2 }' <<<"$said")
  faulty=$(awk '$1 == "most_everything_with_faults" { print $2 }' <<<"$said")
fi
size() { sed -E "s/.*\"$1\": ([0-9]+).*/\1/" "$build/firmware/node-$board.size.json"; }
flash=$(size flash_bytes) ram=$(size ram_bytes) stack=$(size stack_bytes)

if [ "$what" = append ]; then
  model=$(sed -nE 's/.*joints = ([0-9]+), effects = ([0-9]+), bls_nodes = ([0-9]+);.*/\1,\2,\3/p' tests/golden/vectors.hpp)
  echo "$(date +%F),$board,node,$model,$instructions,$flash,$ram,$stack" >>"$budget"
  exit 0
fi
row=$(awk -F, -v board="$board" '$2 == board && $3 == "node" { row = $7 "," $8 "," $9 "," $10 } END { print row }' "$budget")
[ -n "$row" ] || { echo "node: no row for $board in firmware/budget.csv: tests/target/budget.sh adds them" >&2; exit 1; }
echo "$board: instructions,flash,ram,stack $instructions,$flash,$ram,$stack (budget $row), with faults $faulty"
IFS=, read -r may_instructions may_flash may_ram may_stack <<<"$row"
within() {  # NAME MEASURED BUDGET
  [ -z "$2" ] || [ "$2" -le "$3" ] || { echo "node: $board: $1 $2, the budget is $3" >&2; return 1; }
}
# The most of any tick. What the line of text takes beside that (most_everything above) is no tick's: it depends on how many
# bytes each look at the line finds, and differs from run to run.
within instructions_per_tick "$instructions" "$may_instructions"
within "most instructions of a tick" "$instructions" $most_instructions
within "most instructions of a tick with faults" "$faulty" $most_instructions
within flash_bytes "$flash" "$may_flash"
within ram_bytes "$ram" "$may_ram"
within stack_bytes "$stack" "$may_stack"
within flash_bytes "$flash" $most_flash
within ram_bytes "$ram" $most_ram
