#!/usr/bin/env bash
# session.sh DIRECTORY OUTPUT: the session by hand of docs/guide/can-node.md with can-utils, its replies checked, and a capture of it and
# of a stream as OUTPUT/session.log for tshark. DIRECTORY has the programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/interfaces.sh"
start_node "$1/fxdyn_node"
# in memory first: the shared folder is slow, and candump would drop frames
candump -r 8388608 -L vcan0 >/tmp/session.log &
capture=$!
trap 'kill $node $capture 2>/dev/null; wait' EXIT
sleep 0.5

# ask FRAME REPLY [FRAMES]: sends a frame and looks for the reply among the next frames under its identifier (1), `.` in it for any
# digit. Once more where there was no reply at all: candump may have been slower to start than cansend.
ask() {
  for listening in 0.3 3; do
    candump -L -n "${3:-1}" -T 3000 "vcan0,${2%%#*}:7FF" >/tmp/reply &
    local listener=$!
    sleep $listening
    cansend vcan0 "$1"
    wait $listener
    [ ! -s /tmp/reply ] || break
  done
  if ! awk '{print $3}' /tmp/reply | grep -qxE "$2"; then
    echo "FAILED: $1 was answered by $(awk '{print $3}' /tmp/reply | xargs), not $2"
    exit 1
  fi
  echo "$1 -> $2"
}
ask 601#4018100200000000 '581#4318100246584431'  # product code FXD1
ask 601#4000200100000000 '581#43002001........'  # CRC of the tables
ask 601#4000200300000000 '581#4F00200301......'  # tables valid
ask 601#4008100000000000 '581#4108100010000000'  # device name: 16 bytes, segmented
cansend vcan0 601#8008100000000008               # and left: abort
ask 601#2F18100200000000 '581#8018100202000106'  # read-only
ask 601#2B10200032000000 '581#6010200000000000'  # ramp of 50 ticks
ask 000#0101 '701#05' 30                         # operational, said by the next heartbeat
for joint in 1 2 3 4 5 6; do cansend vcan0 20$joint#0000000000000000; done
ask 080# '181#[0-9A-F]{16}'                      # SYNC -> torque of joint 1
ask 000#8001 '701#7F' 30
ask 000#8101 '701#00' 30                         # reset: boot-up
"$1/hil_driver" --name "captured session" --can vcan0 --nodes 1 --ticks 200
sleep 0.5
kill $capture
wait $capture 2>/dev/null || true
cp /tmp/session.log "$2/session.log"
