#!/usr/bin/env bash
# write.sh WORK [SECONDS [CAMERA_MEGABYTES]]: the recordings of write_bags.mjs and write_db3.py in WORK/bags.
set -euo pipefail
work=$1
shift
here=$(cd "$(dirname "$0")" && pwd)
for tool in node npm zstd lz4; do
  command -v "$tool" >/dev/null || { echo "bags: $tool is missing: run toolchains/setup.sh" >&2; exit 1; }
done
mkdir -p "$work"
cp "$here"/package.json "$here"/package-lock.json "$here"/write_bags.mjs "$work"
if ! cmp -s "$here/package-lock.json" "$work/node_modules/installed.json"; then
  (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --silent) ||
    { echo "bags: npm can't install the packages of $here/package-lock.json: is its registry reachable?" >&2; exit 1; }
  cp "$here/package-lock.json" "$work/node_modules/installed.json"
fi
rm -rf "$work/bags"
node "$work/write_bags.mjs" "$work/bags" "$@"
python3 "$here/write_db3.py" "$work/bags"
