#!/usr/bin/env bash
# pins.sh DIRECTORY: the Linux node with its enable, fault and tick-busy lines on a chip of gpio-sim, watched and driven from the
# chip's far side. DIRECTORY has the programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/interfaces.sh"
. "$here/gpio_sim.sh"
"$1/test_pins"

enable() { echo "pull-$1" >"$FXDYN_GPIO_FAR/sim_gpio0/pull"; }
level() { cat "$FXDYN_GPIO_FAR/sim_gpio$1/value"; }
expect() {  # WHAT IS WANTED
  if [ "$2" != "$3" ]; then echo "FAILED: $1 is $2, not $3"; exit 1; fi
  echo "$1: $2"
}
expect_level() {  # WHAT LINE WANTED: within 10 s
  for _ in $(seq 100); do [ "$(level "$2")" != "$3" ] || break; sleep 0.1; done
  expect "$1" "$(level "$2")" "$3"
}
enable up
start_node "$1/fxdyn_node" --gpio-chip "$FXDYN_GPIO_CHIP" --enable 0 --fault 1 --busy 2
trap 'kill $node; wait' EXIT
gpioinfo "$FXDYN_GPIO_CHIP" | head -n 4
"$1/hil_driver" --name "1 Linux node with pins" --can vcan0 --nodes 1 --ticks 200
expect "fault after a clean run" "$(level 1)" 0
expect "tick-busy between ticks" "$(level 2)" 0

# No setpoints: stale ticks, EMCY 0x8250, fault.
cansend vcan0 000#0101
for _ in $(seq 5); do cansend vcan0 080#; done
expect_level "fault without setpoints" 1 1
cansend vcan0 000#8001
expect_level "fault after pre-operational" 1 0

# Enable low: torques go out, but say that they are not enabled.
enable down
cansend vcan0 000#0101
for listening in 0.2 3; do
  candump -n 1 -T 3000 vcan0,181:7FF >/tmp/torque &
  sleep $listening
  cansend vcan0 080#
  wait $!
  [ ! -s /tmp/torque ] || break
done
cat /tmp/torque
status=$(awk '{print $NF}' /tmp/torque)
expect "enabled bit of the torque's status" $((0x$status >> 4 & 1)) 0
