#!/usr/bin/env bash
# on_can.sh [--output DIR] -- COMMAND..: runs a command where SocketCAN is: in a network namespace of its own on this machine, if its kernel
# has vcan and lets us, else in the guest. FXDYN_HIL=guest: in the guest in any case.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
namespace=(unshare --map-root-user --net)
if [ "${FXDYN_HIL:-}" != guest ] && "${namespace[@]}" ip link add vcan0 type vcan 2>/dev/null; then
  [ "$1" != --output ] || { mkdir -p "$2" && shift 2; }
  shift
  exec "${namespace[@]}" "$@"
fi
exec "$here/guest.sh" "$@"
