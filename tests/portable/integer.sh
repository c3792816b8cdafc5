#!/usr/bin/env bash
# integer.sh BUILD_DIR SOURCE..: builds a test or a program with clang's checks of integers (overflow, signed or not, lost
# bits and signs, shifts) and runs it: the first find in model/, hal/ or firmware/ ends it.
set -euo pipefail
build=$1
shift
root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
mkdir -p "$build"
sources=("${@/#/$root/}")
clang++-14 -std=c++20 -O1 -g1 -fsanitize=integer,undefined -fno-sanitize-recover=all \
  -fsanitize-ignorelist=tests/portable/not_checked.txt -I"$root" -isystem /usr/include/eigen3 \
  -DFXDYN_SOURCE_DIR="\"$root\"" -DFXDYN_TABLES_HEADER='"tests/golden/tables.hpp"' -DFXDYN_VECTORS_HEADER='"tests/golden/vectors.hpp"' \
  "${sources[@]}" -o "$build/test" -lrapidcheck -lgtest_main -lgtest -lpthread -lfmt
UBSAN_OPTIONS=print_stacktrace=1 RC_PARAMS=seed=1 timeout 100 "$build/test"
