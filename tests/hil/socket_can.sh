#!/usr/bin/env bash
# socket_can.sh DIRECTORY: the Linux back end on interfaces of this kernel. DIRECTORY has the test programs.
set -euo pipefail
. "$(cd "$(dirname "$0")" && pwd)/interfaces.sh"
"$1/socket_can_test"
