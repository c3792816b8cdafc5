#!/usr/bin/env bash
# mca.sh FUNCTION_CYCLES: the inner loops of the tick (tests/target/mca_kernels.cpp) in the project's timing model beside llvm-mca's,
# memory without wait states. llvm-mca moves any number of registers in one instruction in a cycle or two, where the
# processor's manual has 1 + N, so its figure is a lower bound: fails where ours is below it.
set -euo pipefail
[ $# -eq 1 ] || { echo "usage: mca.sh FUNCTION_CYCLES" >&2; exit 2; }
function_cycles=$(realpath "$1")
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cd "$root"
theirs=$(tests/target/mca.sh | awk '$2 == "cortex-m4" { print $1, $4 }')
mapfile -t kernels < <(awk '{ print "kernel_" $1 }' <<<"$theirs")
[ ${#kernels[@]} -gt 0 ] || { echo "mca: no kernels" >&2; exit 1; }
arm-none-eabi-g++ -o "$work/kernels.elf" -nostartfiles -Wl,-Ttext=0x08000000,-e,"${kernels[0]}",--no-warn-rwx-segments \
  -mcpu=cortex-m4 -mthumb -mfloat-abi=soft -std=c++20 -O2 -fno-exceptions -ffreestanding --specs=nano.specs -Wno-psabi \
  -DEIGEN_NO_MALLOC -DEIGEN_NO_IO -DEIGEN_NO_DEBUG -DEIGEN_DONT_VECTORIZE -isystem /usr/include/eigen3 -I. tests/target/mca_kernels.cpp

printf '%-12s %8s %8s %8s %8s %8s\n' kernel executed llvm-mca fastest likely slowest
"$function_cycles" "$work/kernels.elf" "${kernels[@]}" | awk -v theirs="$theirs" '
  BEGIN { n = split(theirs, cell, /[ \n]/); for (i = 1; i < n; i += 2) mca["kernel_" cell[i]] = cell[i + 1] }
  { name = $1; sub(/^kernel_/, "", name); printf "%-12s %8d %8d %8d %8d %8d\n", name, $2, mca[$1], $3, $4, $5 }
  mca[$1] == "" || $3 < mca[$1] { print "mca: " name " takes fewer cycles than llvm-mca says" > "/dev/stderr"; bad = 1 }
  END { exit bad }'
