#!/usr/bin/env bash
# session_decoded.sh DIRECTORY OUTPUT: session.sh where SocketCAN is, then its capture decoded on this machine.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
"$here/on_can.sh" --output "$2" -- "$here/session.sh" "$1" "$2"
"$here/decode.sh" "$2/session.log"
