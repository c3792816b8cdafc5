#!/usr/bin/env bash
# install.sh BUILD: `cmake --install` gives a program that runs by itself.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$1" --prefix "$work/prefix" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
fxdyn=$work/prefix/bin/fxdyn
[ -x "$fxdyn" ] || { echo "install: no bin/fxdyn" >&2; exit 1; }
cd "$work"
"$fxdyn" --version | grep -q '^[0-9]'
"$fxdyn" effects --json | grep -q '"effect": "coulomb"'
if ldd "$fxdyn" | grep -e "not found" -e "$1"; then
  echo "install: needs libraries of the build folder" >&2
  exit 1
fi
