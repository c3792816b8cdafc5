#!/usr/bin/env bash
# run.sh REPORT_TEST WORK: the pages of tests/report/pages_test.cpp in headless Chromium. Packages of npm go to WORK.
set -euo pipefail
program=$1 work=$2
. "$(dirname "$0")/packages.sh"
packages "$work"
mkdir -p "$work/pages"
rm -f "$work"/pages/*
FXDYN_PAGES=$work/pages "$program" --gtest_filter='Pages.*' --gtest_brief=1
node "$work/page_test.mjs" "$work/pages"
