#!/usr/bin/env bash
# run.sh TEST WORK: recordings of write_bags.mjs and write_db3.py, and what the test reads of them. Packages of npm go to
# WORK.
set -euo pipefail
program=$1 work=$2
here=$(cd "$(dirname "$0")" && pwd)
"$here/write.sh" "$work"
FXDYN_BAGS=$work/bags "$program" --gtest_filter='RealWriters.*' --gtest_brief=1
