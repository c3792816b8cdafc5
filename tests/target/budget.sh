#!/usr/bin/env bash
# budget.sh: measures the golden replay, the kernels and the drive node on every board and adds rows for them to firmware/budget.csv, and cycles of the
# tick to firmware/cycles.csv: when less is needed than before, or when more is and that is meant.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
for core in m0 m3 m4 m7 m33; do
  for image in golden golden_remembers; do
    "$here/golden.sh" "cortex-$core" "$here/../../build/golden-$core" append $image
  done
  [ $core = m0 ] || "$here/kernels.sh" "cortex-$core" "$here/../../build/golden-$core" append
done
expected=$here/../../build/host/tests/target/node_expected
for case in mps2-an386:cortex-m4 netduinoplus2:netduinoplus2 zynqmp_r5:cortex-r5 stm32g474:stm32g474; do
  "$here/node.sh" "${case%%:*}" "${case##*:}" "$here/../../build/node-${case##*:}" "$expected" append
done
"$here/../cycles/tick.sh" "$here/../../build/host/tests/cycles/tick_cycles" "$here/../../build/golden-stm32g474" append
"$here/node.sh" mps2-an386 cortex-m4 "$here/../../build/node-remembers" "${expected}_remembers" append remembers
