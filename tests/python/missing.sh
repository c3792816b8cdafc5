#!/usr/bin/env bash
# missing.sh: configured where pybind11 or a fitting Python is missing, the host says in one line what to install, and how to do without.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for package in pybind11 Python; do
  if cmake -S "$root" -B "$work/build" -DCMAKE_DISABLE_FIND_PACKAGE_$package=ON >"$work/log" 2>&1; then
    echo "missing: configured without $package" >&2
    exit 1
  fi
  grep -q 'pybind11-dev python3-dev python3-numpy.*toolchains/setup.sh.*-DFXDYN_PYTHON=OFF$' "$work/log" || { cat "$work/log" >&2; exit 1; }
  rm -rf "$work/build"
done
