#!/usr/bin/env bash
# check_no_heap.sh NM IMAGE.elf: fails if anything that allocates, throws or aborts was linked into the image.
set -euo pipefail
found=$("$1" "$2" | awk '$NF ~ /^(_?malloc(_r)?|_?calloc(_r)?|_?realloc(_r)?|_?free(_r)?|_?sbrk(_r)?|abort|__cxa_(throw|allocate_exception|atexit)|_Zn[aw].*|_Zd[al].*)$/ { print $NF }')
[ -z "$found" ] && exit 0
echo "$2: linked against the heap or exceptions:" $found >&2
exit 1
