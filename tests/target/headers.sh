#!/usr/bin/env bash
# headers.sh PRESET BUILD_DIR: builds the header check of a cross preset.
set -euo pipefail
cmake --preset "$1" -B "$2" >/dev/null
cmake --build "$2" --target fxdyn_header_check
