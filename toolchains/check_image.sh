#!/usr/bin/env bash
# check_image.sh NM OBJDUMP IMAGE.elf: fails if the image contains anything that the firmware must do without: the heap,
# exceptions, floating point (routines or instructions), division.
set -euo pipefail
if [ $# -ne 3 ]; then
  echo "usage: check_image.sh NM OBJDUMP IMAGE.elf" >&2
  exit 2
fi
heap='_?malloc(_r)?|_?calloc(_r)?|_?realloc(_r)?|_?free(_r)?|_?sbrk(_r)?|abort|__cxa_.*|_Unwind_.*|_Zn[aw].*|_Zd[al].*'
# Run-time ABI for the Arm architecture (IHI 0043), "Helper functions", and the same routines under libgcc's own names.
float='__aeabi_[fd].*|__aeabi_c[fd]cmp.*|__aeabi_(u?[il]2[fdh]|h2f.*|h2d)|__[a-z]+[sdht]f[0-9a-z]*|__(float|fix)[a-z]+|sqrtf?|floorf?'
division='__aeabi_[ui]*l?div(mod)?|__aeabi_u?ldivmod|__aeabi_[il]?div0|__u?(div|mod|divmod)[sdt]i[34]'

symbols=$("$1" "$3" | awk '{ print $NF }')
# Constants in between are printed as .word.
mnemonics=$("$2" -d --no-show-raw-insn "$3" | awk '/^ *[0-9a-f]+:\t/ { print $2 }' | sort -u)
[ -n "$symbols" ] && [ -n "$mnemonics" ] || { echo "check_image: $3: no symbols or no code" >&2; exit 2; }

good=true
forbid() {  # WHAT PATTERN NAMES
  local found
  found=$(grep -Ex "$2" <<<"$3" | sort -u | tr '\n' ' ' || true)
  [ -z "$found" ] && return
  echo "check_image: $image contains $1: $found" >&2
  good=false
}
image=$3
forbid "the heap or exceptions" "$heap" "$symbols"
forbid "floating-point routines" "$float" "$symbols"
forbid "division routines" "$division" "$symbols"
forbid "floating-point instructions" 'v[a-z].*|f(ld|st)m.*' "$mnemonics"
forbid "division instructions" '[us]div.*' "$mnemonics"
$good
