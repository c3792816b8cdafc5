#!/usr/bin/env bash
# configure.sh PRESET [OPTION...]: configures build/PRESET. A build folder that came along with a copy of the sources is of another
# place: CMake refuses it, so it is configured anew here.
set -euo pipefail
cd "$(dirname "$0")/.."
cache=build/$1/CMakeCache.txt
fresh=()
if [ -f "$cache" ] && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$(pwd -P)" "$cache" && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD" "$cache"; then
  echo "configure: build/$1 was made for $(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' "$cache"): configured anew" >&2
  fresh=(--fresh)
fi
cmake --preset "$1" "${fresh[@]}" "${@:2}" >/dev/null
