#!/usr/bin/env bash
# screenshots.sh REPORT.html DIR: the page as people see it, in DIR: desktop.png, dark.png, phone.png, paper.pdf.
set -euo pipefail
[ $# -eq 2 ] || { echo "usage: screenshots.sh REPORT.html DIR" >&2; exit 2; }
work=$(cd "$(dirname "$0")/../../.." && pwd)/build/host/tests/report/browser
. "$(dirname "$0")/packages.sh"
packages "$work"
node "$work/screenshots.mjs" "$1" "$2"
