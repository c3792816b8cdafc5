#!/usr/bin/env bash
# budget.sh: measures the golden replay, the kernels and the drive node on every board and adds rows for them to firmware/budget.csv: when less is needed
# than before, or when more is and that is meant.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
for core in m0 m3 m4 m7 m33; do
  "$here/golden.sh" "cortex-$core" "$here/../../build/golden-$core" append
  [ $core = m0 ] || "$here/kernels.sh" "cortex-$core" "$here/../../build/golden-$core" append
done
expected=$here/../../build/host/tests/target/node_expected
for case in mps2-an386:cortex-m4 netduinoplus2:netduinoplus2 zynqmp_r5:cortex-r5 stm32g474:stm32g474; do
  "$here/node.sh" "${case%%:*}" "${case##*:}" "$here/../../build/node-${case##*:}" "$expected" append
done
