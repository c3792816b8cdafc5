# packages WORK: the scripts of this folder and their packages from npm, as package-lock.json has them. To be sourced.
packages() {
  local here tool
  here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
  for tool in node npm chromium; do
    command -v "$tool" >/dev/null || { echo "browser: $tool is missing: run toolchains/setup.sh" >&2; exit 1; }
  done
  mkdir -p "$1"
  cp "$here"/package.json "$here"/package-lock.json "$here"/*.mjs "$1"
  cmp -s "$here/package-lock.json" "$1/node_modules/installed.json" && return
  (cd "$1" && npm ci --ignore-scripts --no-audit --no-fund --silent) ||
    { echo "browser: npm can't install the packages of $here/package-lock.json: is its registry reachable?" >&2; exit 1; }
  cp "$here/package-lock.json" "$1/node_modules/installed.json"
}
