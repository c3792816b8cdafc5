#!/usr/bin/env bash
# integer.sh BUILD_DIR MODEL SOURCE|LIBRARY..: builds a test or a program with clang's checks of integers (overflow, signed or not,
# lost bits and signs, shifts) and runs it: the first find in model/, hal/ or firmware/ ends it. MODEL: whose tables it
# gets, golden or golden/remembers.
set -euo pipefail
build=$1
model=tests/$2
shift 2
root=$(cd "$(dirname "$0")/../.." && pwd)
cd "$root"
mkdir -p "$build"
flags=(-std=c++20 -O1 -g1 -fsanitize=integer,undefined -fno-sanitize-recover=all
  -fsanitize-ignorelist=tests/portable/not_checked.txt -I"$root" -isystem /usr/include/eigen3
  -DFXDYN_SOURCE_DIR="\"$root\"" -DFXDYN_TABLES_HEADER="\"$model/tables.hpp\"" -DFXDYN_VECTORS_HEADER="\"$model/vectors.hpp\"")
# A folder's files in one go: most of the time goes into headers.
sources=() libraries=()
for source in "$@"; do
  if [[ $source == *.a ]]; then
    libraries+=("$source")
    continue
  fi
  together=$build/$(dirname "$source" | tr / _).cpp
  [[ " ${sources[*]-} " == *" $together "* ]] || { sources+=("$together") && : >"$together"; }
  echo "#include \"$source\"" >>"$together"
done
objects=()
for source in "${sources[@]}"; do
  object=$build/$(basename "$source" .cpp).o
  clang++-14 "${flags[@]}" -c "$source" -o "$object"
  objects+=("$object")
done
clang++-14 -fsanitize=integer,undefined "${objects[@]}" -o "$build/test" \
  -Wl,--start-group "${libraries[@]}" -Wl,--end-group -lrapidcheck -lgtest_main -lgtest -lpthread -lfmt \
  -ltomlplusplus -lz -lzstd -llz4 -lsnappy -lsqlite3 $(pkg-config --libs matio hdf5-serial) -Wl,--as-needed -lurdfdom_model -ltinyxml -lconsole_bridge
rm "${objects[@]}"
UBSAN_OPTIONS=print_stacktrace=1 RC_PARAMS=seed=1 timeout 300 "$build/test"
