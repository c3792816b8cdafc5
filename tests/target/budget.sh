#!/usr/bin/env bash
# budget.sh: measures the golden replay, the kernels and the drive node on every board and adds rows for them to firmware/budget.csv, and cycles of the
# tick to firmware/cycles.csv: when less is needed than before, or when more is and that is meant.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
expected=$here/../../build/host/tests/target/node_expected
while read -r board preset _ _ _ _ tests _ <&3; do
  if [[ ,$tests, == *,golden,* ]]; then
    for image in golden golden_remembers; do
      "$here/golden.sh" "$preset" "$here/../../build/golden-${preset#cortex-}" append $image
    done
  fi
  [[ ,$tests, != *,kernels,* ]] || "$here/kernels.sh" "$preset" "$here/../../build/golden-${preset#cortex-}" append
  [[ ,$tests, != *,node* ]] || "$here/node.sh" "$board" "$preset" "$here/../../build/node-$preset" "$expected" append
done 3< <(grep "^[a-z]" "$here/../../toolchains/boards.txt")
"$here/../cycles/tick.sh" "$here/../../build/host/tests/cycles/tick_cycles" "$here/../../build/golden-stm32g474" append
"$here/node.sh" mps2-an386 cortex-m4 "$here/../../build/node-remembers" "${expected}_remembers" append remembers
