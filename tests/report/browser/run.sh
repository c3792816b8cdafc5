#!/usr/bin/env bash
# run.sh REPORT_TEST WORK: the pages of tests/report/pages_test.cpp in headless Chromium. Packages of npm go to WORK.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
program=$1 work=$2
for tool in node npm chromium; do
  command -v "$tool" >/dev/null || { echo "browser test: $tool is missing: run toolchains/setup.sh" >&2; exit 1; }
done
mkdir -p "$work/pages"
cp "$here"/package.json "$here"/package-lock.json "$here"/page_test.mjs "$work"
if ! cmp -s "$here/package-lock.json" "$work/node_modules/installed.json"; then
  (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --silent)
  cp "$here/package-lock.json" "$work/node_modules/installed.json"
fi
rm -f "$work"/pages/*.html
FXDYN_PAGES=$work/pages "$program" --gtest_filter='Pages.*' --gtest_brief=1
node "$work/page_test.mjs" "$work/pages"
