#!/usr/bin/env bash
# headers.sh PRESET BUILD_DIR: builds the header check of a cross preset. On a Cortex-M4 each header compiles alone, on the
# others those of the board.
set -euo pipefail
together=ON
[ "$1" = cortex-m4 ] && together=OFF
cmake --preset "$1" -B "$2" -DFXDYN_HEADERS_TOGETHER=$together >/dev/null
cmake --build "$2" --target fxdyn_header_check
