#!/usr/bin/env bash
# install.sh BUILD: `cmake --install` gives a program, and a module of Python, that run by themselves.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$1" --prefix "$work/prefix" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
fxdyn=$work/prefix/bin/fxdyn
[ -x "$fxdyn" ] || { echo "install: no bin/fxdyn" >&2; exit 1; }
cd "$work"
# Not into `grep -q`: it closes the pipe before all is written.
"$fxdyn" --version >version
"$fxdyn" effects --json >effects
grep -q '^[0-9]' version || { echo "install: no version" >&2; exit 1; }
grep -q '"effect": "coulomb"' effects || { echo "install: no effects" >&2; exit 1; }
# What is opened at run time is where the program looks for it.
runpath=$(readelf -d "$fxdyn" | sed -n 's/.*R.*PATH.*\[\(.*\)\]/\1/p')
reader=${runpath/\$ORIGIN/$work/prefix/bin}/libfxdyn_sdf_reader.so
[ -f "$reader" ] || { echo "install: no reader of SDF in '$runpath'" >&2; exit 1; }
# Folders on Python's path differ with the prefix: docs/guide/python.md.
packages=$work/prefix/lib/python3/dist-packages
modules=()
if grep -qx 'FXDYN_PYTHON:BOOL=ON' "$1/CMakeCache.txt"; then
  modules=("$packages"/fxdyn/stages*.so)
  PYTHONPATH=$packages /usr/bin/python3 -B -c 'import fxdyn; print(fxdyn.__version__, fxdyn.__file__)' >module
  [ "$(cat module)" = "$(grep -o '^[0-9][0-9.]*' version) $packages/fxdyn/__init__.py" ] || { echo "install: Python has $(cat module)" >&2; exit 1; }
fi
for file in "$fxdyn" "$reader" "${modules[@]}"; do
  if ldd "$file" | grep -e "not found" -e "$1"; then
    echo "install: $file needs libraries of the build folder" >&2
    exit 1
  fi
done
