#!/usr/bin/env bash
# format.sh style | tidy BUILD_DIR [REF [SECONDS]]: clang-format over all sources; clang-tidy over those that differ from REF
# (HEAD~1), no new file after SECONDS (60). Says what to do: clang-format-14 -i FILE.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
longest_s=${4:-60}

sources() { find model hal firmware host_tools tests -name '*.[ch]pp' | grep -v '^tests/golden/.*\(tables\|vectors\)\.hpp$' | sort; }

case ${1:-} in
  style)
    sources | xargs clang-format-14 --dry-run -Werror
    ;;
  tidy)
    # File by file, whatever the build does, with what it has made; gcc's precompiled headers are not clang's.
    commands=$(mktemp -d)
    trap 'rm -r "$commands"' EXIT
    database=$commands/compile_commands.json
    cmake --preset host -B "$commands" -DCMAKE_UNITY_BUILD=OFF >/dev/null
    sed -i "s/-Winvalid-pch -include [^ ]*cmake_pch.hxx//; s|$commands|$(realpath "$2")|g" "$database"
    # most changed first
    mapfile -t files < <(git diff --numstat -M --diff-filter=AM "${3:-HEAD~1}" -- '*.cpp' 2>/dev/null | sort -rn | cut -f3)
    done=0 failed=0
    for file in "${files[@]}"; do
      [ "$SECONDS" -lt "$longest_s" ] || break
      grep -q "\"file\": \"$root/$file\"" "$database" || continue  # of a target: another compiler
      clang-tidy-14 -p "$commands" --quiet --warnings-as-errors='*' "$file" 2>/dev/null || failed=1
      done=$((done + 1))
    done
    echo "clang-tidy: $done of ${#files[@]} changed files in $SECONDS s"
    exit $failed
    ;;
  *)
    echo "usage: format.sh style | tidy BUILD_DIR [REF [SECONDS]]" >&2
    exit 2
    ;;
esac
