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
(cmake --preset "$preset" -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target "${targets[@]}") >"$build/node.log" 2>&1 || { cat "$build/node.log" >&2; exit 1; }

instructions=
if [ "$board" != stm32g474 ]; then
  said=$("$root/tests/target/node_test.py" "$board" "$build" "$expected")
  echo "$board: $(tr '\n' ',' <<<"$said")"
  instructions=$(awk '$1 == "everything" { print $2 }' <<<"$said")
fi
size() { sed -E "s/.*\"$1\": ([0-9]+).*/\1/" "$build/firmware/node-$board.size.json"; }
flash=$(size flash_bytes) ram=$(size ram_bytes) stack=$(size stack_bytes)

if [ "$what" = append ]; then
  model=$(sed -nE 's/.*joints = ([0-9]+), effects = ([0-9]+), bls_nodes = ([0-9]+);.*/\1,\2,\3/p' tests/golden/vectors.hpp)
  echo "$(date +%F),$board,node,$model,$instructions,$flash,$ram,$stack" >>"$budget"
  exit 0
fi
row=$(awk -F, -v board="$board" '$2 == board && $3 == "node" { row = $8 "," $9 "," $10 } END { print row }' "$budget")
[ -n "$row" ] || { echo "node: no row for $board in firmware/budget.csv: tests/target/budget.sh adds them" >&2; exit 1; }
echo "$board: flash,ram,stack $flash,$ram,$stack (budget $row), instructions $instructions"
IFS=, read -r may_flash may_ram may_stack <<<"$row"
within() {  # NAME MEASURED BUDGET
  [ -z "$2" ] || [ "$2" -le "$3" ] || { echo "node: $board: $1 $2, the budget is $3" >&2; return 1; }
}
# Not against the row: how many bytes each look at the line finds differs from run to run, and the count with it by some
# hundreds.
within "instructions of a tick with its frames" "$instructions" $most_instructions
within flash_bytes "$flash" "$may_flash"
within ram_bytes "$ram" "$may_ram"
within stack_bytes "$stack" "$may_stack"
within flash_bytes "$flash" $most_flash
within ram_bytes "$ram" $most_ram
