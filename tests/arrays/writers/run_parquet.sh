#!/usr/bin/env bash
# run_parquet.sh TEST WORK: files of write_parquet.mjs, and what the test reads of them. Packages of npm go to WORK.
set -euo pipefail
program=$1 work=$2
here=$(cd "$(dirname "$0")" && pwd)
"$here/write_parquet.sh" "$work" "$work/files" 4
FXDYN_PARQUET=$work/files "$program" --gtest_filter='*LongParquet.*' --gtest_brief=1
