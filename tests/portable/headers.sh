#!/usr/bin/env bash
# headers.sh COMPILER TARGET: every header that the package installs compiles without a warning,
# and the compiler makes the same tables of functions as the others.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tests/portable/compilers.sh
choose_compiler "$1" "$2"
for header in model/*.hpp model/effects/*.hpp firmware/tick_budget.hpp; do echo "#include \"$header\""; done |
  "${compile[@]}" -fsyntax-only -x c++ -
"${compile[@]}" -fsyntax-only tests/portable/constants.cpp
