#!/usr/bin/env bash
# hal.sh DIRECTORY: the Linux back ends, on interfaces and pins of this kernel. DIRECTORY has the test programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/interfaces.sh"
"$1/test_socket_can"
if [ -d /sys/kernel/config/gpio-sim ]; then
  . "$here/gpio_sim.sh"
  "$1/test_pins"
else
  echo "no gpio-sim here: pins not tested"
fi
