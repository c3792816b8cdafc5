#!/usr/bin/env bash
# faults.sh DIRECTORY EVENTS [SUFFIX]: the fault campaign on vcan with the Linux node. DIRECTORY has the programs; SUFFIX is that
# of another golden model's.
set -euo pipefail
. "$(cd "$(dirname "$0")" && pwd)/interfaces.sh"
"$1/fault_bus${3:-}" "$1/fxdyn_node${3:-}" "$2"
