#!/usr/bin/env bash
# mca.sh: what llvm-mca's models of the Cortex-M4 and M7 pipelines say of the inner loops of the tick (mca_kernels.cpp): a lower
# bound in cycles, flash without wait states. Fails where a kernel has a branch: then the estimate would mean nothing.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
mca=$(command -v llvm-mca-14 || command -v llvm-mca) || { echo "mca: no llvm-mca: run toolchains/setup.sh" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

printf '%-12s %-10s %12s %8s\n' kernel core instructions cycles
for core in cortex-m4 cortex-m7; do
  arm-none-eabi-g++ -S -o "$work/kernels.s" -mcpu=$core -mthumb -mfloat-abi=soft -std=c++20 -O2 -fno-exceptions -ffreestanding \
    -Wno-psabi -DEIGEN_NO_MALLOC -DEIGEN_NO_IO -DEIGEN_NO_DEBUG -DEIGEN_DONT_VECTORIZE -isystem /usr/include/eigen3 -I"$root" "$root/tests/target/mca_kernels.cpp"
  for kernel in two_nodes two_tanh two_ramps row_16 sin_cos rotate dahl; do
    # The function's instructions without directives, labels and literals. The M7 model doesn't know IT: what is conditional
    # there costs the same when it always happens.
    awk -v name="kernel_$kernel" '
      $1 == name ":" { on = 1; next }
      $1 == ".size" { on = 0 }
      !on || /^[ \t]*[.@]/ { next }
      $1 ~ /^it[te]*$/ { conditional = length($1) - 1; next }
      conditional > 0 { --conditional; sub(/(eq|ne|hs|cs|lo|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)(\.[wn])?$/, "", $1) }
      { sub(/@.*/, ""); print }' "$work/kernels.s" >"$work/$kernel.s"
    branches=$(grep -Ec '^[[:space:]]*b[a-z.]*[[:space:]]+\.L' "$work/$kernel.s" || true)
    [ "$branches" -eq 0 ] || { echo "mca: $kernel has branches on $core" >&2; exit 1; }
    "$mca" -mtriple=thumbv7em-none-eabi -mcpu=$core -iterations=100 "$work/$kernel.s" 2>"$work/said" >"$work/report" ||
      { cat "$work/said" >&2; exit 1; }
    awk -v kernel="$kernel" -v core="$core" '
      $1 == "Instructions:" { instructions = $2 / 100 }
      $1 == "Total" && $2 == "Cycles:" { cycles = $3 / 100 }
      END { printf "%-12s %-10s %12.0f %8.0f\n", kernel, core, instructions, cycles }' "$work/report"
  done
done
