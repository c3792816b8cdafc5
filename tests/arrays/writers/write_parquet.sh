#!/usr/bin/env bash
# write_parquet.sh WORK FOLDER [SECONDS [CAMERA_KILOBYTES]]: the files of write_parquet.mjs in FOLDER. Packages of npm go to WORK.
set -euo pipefail
work=$1
shift
here=$(cd "$(dirname "$0")" && pwd)
for tool in node npm; do
  command -v "$tool" >/dev/null || { echo "parquet: $tool is missing: run toolchains/setup.sh" >&2; exit 1; }
done
mkdir -p "$work"
cp "$here"/package.json "$here"/package-lock.json "$here"/write_parquet.mjs "$work"
if ! cmp -s "$here/package-lock.json" "$work/node_modules/installed.json"; then
  (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --silent) ||
    { echo "parquet: npm can't install the packages of $here/package-lock.json: is its registry reachable?" >&2; exit 1; }
  cp "$here/package-lock.json" "$work/node_modules/installed.json"
fi
node "$work/write_parquet.mjs" "$@"
