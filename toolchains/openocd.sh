#!/usr/bin/env bash
# openocd.sh ARGUMENT..: openocd, and where it fails what to do about it, in one line. OPENOCD: another program than openocd.
set -uo pipefail
log=$(mktemp)
trap 'rm -f "$log"' EXIT
"${OPENOCD:-openocd}" "$@" 2>&1 | tee "$log"
code=${PIPESTATUS[0]}
[ "$code" -ne 0 ] || exit 0
if grep -q 'LIBUSB_ERROR_ACCESS' "$log"; then
  advice='no permission for the debug probe: sudo apt install openocd brings the udev rules; then plug it in again'
elif grep -q 'open failed' "$log"; then
  advice='no debug probe: its cable; lsusb must show ST-LINK'
elif grep -qE 'nable to connect to the target|init mode failed' "$log"; then
  advice='the board does not answer the debug probe: its power; hold reset while it starts'
elif [ "$code" -eq 127 ]; then
  advice='there is no openocd: toolchains/setup.sh installs it'
else
  advice='openocd failed: what it said stands above'
fi
echo "flash: $advice (docs/guide/bring-up.md)" >&2
exit 1
