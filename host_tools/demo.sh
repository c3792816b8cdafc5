#!/usr/bin/env bash
# demo.sh [PROJECT.toml [DIR]]: the main job on a fresh Debian 12. Installs what is missing, builds fxdyn, identifies the
# project's robot (without arguments: the bundled PUMA 560 with friction, DIR out/demo), builds the firmware image with its
# tables, replays the held-out logs on it in QEMU and draws the report.
set -euo pipefail
if [[ ${1:-} == -* ]]; then
  sed -n '2,4s/^# //p' "$0"
  exit 2
fi
root=$(cd "$(dirname "$0")/.." && pwd)
project=${1:-$root/host_tools/demo/project.toml}
name=demo
[ $# -eq 0 ] || name=$(basename "$project" .toml)
out=${2:-$root/out/$name}
[ -f "$project" ] || { echo "demo: no such project file: $project" >&2; exit 2; }

step() { printf '\n[%3d s] %s\n' "$SECONDS" "$*"; }
fxdyn=$root/build/host/host_tools/cli/fxdyn

step "packages"
"$root/toolchains/setup.sh"

step "building fxdyn"
"$root/toolchains/configure.sh" host
(cd "$root" && cmake --build --preset host --target fxdyn)

step "from the logs to the tables"
"$fxdyn" run "$project" --out "$out" >/dev/null  # its table comes again below, with the firmware's figures

step "building the firmware image"
"$root/toolchains/build_image.sh" "$out/tables.hpp" "$out/firmware"
images=("$out"/firmware/fxdyn-*.elf)
echo "${images[0]}"

step "the held-out logs on the firmware, in QEMU"
"$fxdyn" replay "$project" --out "$out" --image "${images[0]}" --ticks 1000 >/dev/null

step "report"
"$fxdyn" report "$project" --out "$out"
printf '\ndone in %d s\n' "$SECONDS"
