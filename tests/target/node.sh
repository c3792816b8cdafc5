#!/usr/bin/env bash
# node.sh BOARD PRESET BUILD_DIR EXPECTED [gate|append] [MODEL]: builds the drive node's image with the golden tables, or those
# of tests/golden/MODEL, runs it on its emulated board over its own bus (node_test.py), if it has an emulator, and holds its
# figures against the newest rows "node" and "node_faults" (with _MODEL) of the board in firmware/budget.csv; `append` adds
# rows instead.
set -euo pipefail
[ $# -ge 4 ] || { echo "usage: node.sh BOARD PRESET BUILD_DIR EXPECTED [gate|append] [MODEL]" >&2; exit 2; }
board=$1 preset=$2 build=$3 expected=$4 what=${5:-gate} of_model=${6:+_$6}
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=$root/firmware/budget.csv
golden=tests/golden/${6:-.}
# Of a node with six joints: bytes; instructions of a tick with its protocol, under faults, and where an SLCAN line brings the
# frames as text.
most_flash=65536 most_ram=12288 most_instructions=13000 most_faulty=15000 most_slcan=19000

cd "$root"
mkdir -p "$build"
targets=(fxdyn_node)
[ "$board" != zynqmp_r5 ] || targets+=(fxdyn_node_qemu)
[[ $board != mps2-* ]] || targets+=("fxdyn_node_measured$of_model" "fxdyn_node_cost$of_model")
(cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/$golden/tables.hpp" &&
  cmake --build "$build" --target "${targets[@]}") >"$build/node.log" 2>&1 || { cat "$build/node.log" >&2; exit 1; }

instructions= faulty= slcan=
if ! grep -Eq "^$board .*[ ,]node_built[ ,]" toolchains/boards.txt; then  # it has an emulator
  said=$("$root/tests/target/node_test.py" "$board" "$build" "$expected" "$of_model")
  echo "$board: $(tr '\n' ',' <<<"$said")"
fi
if [[ $board == mps2-* ]]; then
  slcan=$(awk '$1 == "most_everything" { print $2 }' <<<"$said")
  # The tick with its protocol, bus in memory: as a CAN controller hands frames over, and the same number in every run.
  said=$(timeout 100 qemu-system-arm -M "$board" -icount shift=8 -nographic -monitor none -serial null \
    -semihosting-config enable=on,target=native -kernel "$build/tests/golden/node_cost$of_model-$board.elf" 2>&1 </dev/null) ||
    { echo "node: $board: node_cost stopped: $said" >&2; exit 1; }
  echo "$board, bus in memory: $(tr '\n' ',' <<<"$said")"
  instructions=$(awk '$1 == "most_everything" { print $2 }' <<<"$said")
  faulty=$(awk '$1 == "most_everything_with_faults" { print $2 }' <<<"$said")
fi
size() { sed -E "s/.*\"$1\": ([0-9]+).*/\1/" "$build/firmware/node-$board.size.json"; }
flash=$(size flash_bytes) ram=$(size ram_bytes) stack=$(size stack_bytes)

if [ "$what" = append ]; then
  model=$(sed -nE 's/.*joints = ([0-9]+), effects = ([0-9]+), bls_nodes = ([0-9]+);.*/\1,\2,\3/p' "$golden/vectors.hpp")
  echo "$(date +%F),$board,node$of_model,$model,$instructions,$flash,$ram,$stack" >>"$budget"
  [ -z "$faulty" ] || echo "$(date +%F),$board,node_faults$of_model,$model,$faulty,,," >>"$budget"
  exit 0
fi
row() {  # IMAGE: its newest row's instructions, flash, RAM and stack
  awk -F, -v board="$board" -v image="$1$of_model" '$2 == board && $3 == image { row = $7 "," $8 "," $9 "," $10 } END { print row }' "$budget"
}
budgeted=$(row node)
[ -n "$budgeted" ] || { echo "node: no row for $board, node$of_model in firmware/budget.csv: tests/target/budget.sh adds them" >&2; exit 1; }
IFS=, read -r may_instructions may_flash may_ram may_stack <<<"$budgeted"
IFS=, read -r may_faulty _ <<<"$(row node_faults)"
echo "$board, node$of_model: instructions,flash,ram,stack $instructions,$flash,$ram,$stack (budget $budgeted), with faults $faulty (budget $may_faulty), behind SLCAN $slcan"
within() {  # NAME MEASURED BUDGET
  [ -z "$2" ] || [ "$2" -le "${3:-0}" ] || { echo "node: $board, node$of_model: $1 $2, the budget is ${3:-missing}" >&2; return 1; }
}
# The most of any tick. Behind SLCAN no budget holds it to the instruction: what reading the text takes depends on how many
# bytes each look at the line finds, and differs from run to run.
within instructions_per_tick "$instructions" "$may_instructions"
within "most instructions of a tick" "$instructions" $most_instructions
within "instructions of a tick with faults" "$faulty" "$may_faulty"
within "most instructions of a tick with faults" "$faulty" $most_faulty
within "most instructions of a tick behind SLCAN" "$slcan" $most_slcan
within flash_bytes "$flash" "$may_flash"
within ram_bytes "$ram" "$may_ram"
within stack_bytes "$stack" "$may_stack"
within flash_bytes "$flash" $most_flash
within ram_bytes "$ram" $most_ram
