#!/usr/bin/env bash
# tick.sh TICK_CYCLES BUILD_DIR [gate|append]: cycles of the model's tick on an STM32G474 at 170 MHz (tick_cycles.cpp), held against
# the newest row of each set-up of the flash in firmware/cycles.csv; `append` adds rows instead.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: tick.sh TICK_CYCLES BUILD_DIR [gate|append]" >&2; exit 2; }
tick_cycles=$1 build=$2 what=${3:-gate}
root=$(cd "$(dirname "$0")/../.." && pwd)
figures=$root/firmware/cycles.csv
most_with_caches=25000  # of a node with six joints

cd "$root"
mkdir -p "$build"
(cmake --preset stm32g474 -B "$build" -DFXDYN_TABLES="$root/tests/golden/tables.hpp" &&
  cmake --build "$build" --target fxdyn_golden) >"$build/golden.log" 2>&1 || { cat "$build/golden.log" >&2; exit 1; }
said=$("$tick_cycles" "$build/tests/golden/golden-stm32g474.elf" 2>"$build/semihosting.log") ||
  { cat "$build/semihosting.log" >&2; exit 1; }

figure() { awk -v name="$1" '$1 == name { print $2 }' <<<"$said"; }
instructions=$(figure instructions) ticks=$(figure ticks)
rows=$(awk 'NF == 4 { print $1 "," $2 "," $3 "," $4 }' <<<"$said")
[ -n "$rows" ] || { echo "tick: no figures: $said" >&2; exit 1; }
if [ "$what" = append ]; then
  while IFS=, read -r setup cycles; do
    echo "$(date +%F),stm32g474,golden,$ticks,$setup,$instructions,$cycles" >>"$figures"
  done <<<"$rows"
  exit 0
fi

result=0
within() {  # NAME MEASURED RECORDED
  [ -n "$3" ] && [ "$2" -le "$3" ] || { echo "tick: $1 $2, recorded is ${3:-nothing} (firmware/cycles.csv)" >&2; result=1; }
}
while IFS=, read -r setup fastest likely slowest; do
  echo "$setup: $likely cycles ($fastest to $slowest), $instructions instructions"
  row=$(awk -F, -v setup="$setup" '$5 == setup { row = $6 "," $8 "," $9 } END { print row }' "$figures")
  IFS=, read -r may_instructions may_likely may_slowest <<<"$row"
  within "$setup: instructions" "$instructions" "$may_instructions"
  within "$setup: cycles" "$likely" "$may_likely"
  within "$setup: cycles at the slowest" "$slowest" "$may_slowest"
  [ "$setup" != caches ] || [ "$slowest" -le $most_with_caches ] ||
    { echo "tick: $slowest cycles with caches, the goal is $most_with_caches" >&2; result=1; }
done <<<"$rows"
exit $result
