#!/usr/bin/env bash
# budget.sh: measures the golden replay and the kernels on every board and adds rows for them to firmware/budget.csv: when less is needed
# than before, or when more is and that is meant.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
for core in m0 m3 m4 m7 m33; do
  "$here/golden.sh" "cortex-$core" "$here/../../build/golden-$core" append
  [ $core = m0 ] || "$here/kernels.sh" "cortex-$core" "$here/../../build/golden-$core" append
done
