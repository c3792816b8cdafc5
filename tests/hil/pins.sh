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
enable up
"$1/fxdyn_node" --can vcan0 --gpio-chip "$FXDYN_GPIO_CHIP" --enable 0 --fault 1 --busy 2 &
trap 'kill %1; wait' EXIT
gpioinfo "$FXDYN_GPIO_CHIP" | head -n 4
"$1/hil_driver" --name "1 Linux node with pins" --can vcan0 --nodes 1 --ticks 200
expect "fault after a clean run" "$(level 1)" 0
expect "tick-busy between ticks" "$(level 2)" 0

# No setpoints: stale ticks, EMCY 0x8250, fault.
cansend vcan0 000#0101
for _ in $(seq 5); do cansend vcan0 080#; done
sleep 0.2
expect "fault without setpoints" "$(level 1)" 1
cansend vcan0 000#8001
sleep 0.3
expect "fault after pre-operational" "$(level 1)" 0

# Enable low: torques go out, but say that they are not enabled.
enable down
cansend vcan0 000#0101
candump -n 1 -T 2000 vcan0,181:7FF >/tmp/torque &
sleep 0.2
cansend vcan0 080#
wait $!
cat /tmp/torque
status=$(awk '{print $NF}' /tmp/torque)
expect "enabled bit of the torque's status" $((0x$status >> 4 & 1)) 0
