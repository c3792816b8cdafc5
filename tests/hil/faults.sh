#!/usr/bin/env bash
# faults.sh DIRECTORY EVENTS: the fault campaign on vcan with the Linux node. DIRECTORY has the programs.
set -euo pipefail
. "$(cd "$(dirname "$0")" && pwd)/interfaces.sh"
"$1/fault_bus" "$1/fxdyn_node" "$2"
