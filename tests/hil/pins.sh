#!/usr/bin/env bash
# pins.sh DIRECTORY: the Linux node with its enable, fault and tick-busy lines on a chip of gpio-sim, watched and driven from the
# chip's far side. DIRECTORY has the programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/interfaces.sh"
. "$here/gpio_sim.sh"
"$1/pins_test"

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
# The node holds the line, so that nobody else can watch its edges; the kernel notes every value that a line is set to.
trace=/sys/kernel/tracing
[ -e $trace/trace ] || mount -t tracefs none $trace
echo 1 >$trace/events/gpio/gpio_value/enable
"$1/hil_driver" --name "1 Linux node with pins" --can vcan0 --nodes 1 --ticks 200
echo 0 >$trace/events/gpio/gpio_value/enable
# LINE LEVEL, in their order
sed -n 's/.*gpio_value: *\([0-9]*\) set \([01]\)/\1 \2/p' $trace/trace >/tmp/edges
expect "lines that moved" "$(cut -d' ' -f1 /tmp/edges | sort -u | wc -l)" 1
expect "tick-busy rises and falls 200 times in 200 ticks" "$(cut -d' ' -f2 /tmp/edges | tr -d '\n' | grep -cxE '(10){200}')" 1
expect "fault line after a clean run" "$(level 1)" 1
expect "tick-busy between ticks" "$(level 2)" 0

# No setpoints: stale ticks, EMCY 0x8250, fault.
cansend vcan0 000#0101
for _ in $(seq 5); do cansend vcan0 080#; done
expect_level "fault line without setpoints" 1 0
cansend vcan0 000#8001
expect_level "fault line after pre-operational" 1 1

# A torque of the model, gravity's, with a ramp of 5 ticks and SYNC by hand; then enable low: the ticks are as fresh as before, but
# their torques go to zero and say that they are not enabled.
cansend vcan0 601#2306100000000000
cansend vcan0 601#2B14200060EA0000
cansend vcan0 601#2B10200005000000
cansend vcan0 000#0101
candump -L vcan0,180:780 >/tmp/torques &
listener=$!
trap 'kill $node $listener 2>/dev/null; wait' EXIT
# ticks COUNT TORQUES: with setpoints of zero, until so many torques have come in all
ticks() {
  for _ in $(seq "$1"); do
    for joint in 1 2 3 4 5 6; do cansend vcan0 20$joint#0000000000000000; done
    cansend vcan0 080#
  done
  for _ in $(seq 100); do [ "$(wc -l </tmp/torques)" -lt "$2" ] || return 0; sleep 0.1; done
  echo "FAILED: $(wc -l </tmp/torques) torques came, not $2"
  exit 1
}
# of the last tick's torques: how many are zero, and the bits enabled (10) and fresh (01) of their status
zeros() { tail -n 6 /tmp/torques | cut -d'#' -f2 | cut -c5-12 | grep -c '^00000000$' || true; }
status() { tail -n 6 /tmp/torques | cut -d'#' -f2 | cut -c15-16 | while read -r byte; do echo $((0x$byte & 0x11)); done | sort -u | xargs; }
sleep 1
ticks 8 48
expect "status of the torques with enable high" "$(status)" 17
[ "$(zeros)" -lt 6 ] || { echo "FAILED: no torque against gravity"; exit 1; }
enable down
ticks 8 96
expect "status of the torques with enable low" "$(status)" 1
expect "torques of zero with enable low" "$(zeros)" 6

# A node that is gone has let go of its line, which is pulled down on the far side.
kill $node
wait $node || true
expect_level "fault line of a node that is gone" 1 0

# The other way round.
start_node "$1/fxdyn_node" --gpio-chip "$FXDYN_GPIO_CHIP" --fault 1 --busy 2 --fault-high --active-low
expect_level "tick-busy with --active-low, between ticks" 2 1
expect_level "fault line with --fault-high, no error" 1 0
cansend vcan0 000#0101
for _ in $(seq 5); do cansend vcan0 080#; done
expect_level "fault line with --fault-high, without setpoints" 1 1
