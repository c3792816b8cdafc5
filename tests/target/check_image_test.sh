#!/usr/bin/env bash
# check_image_test.sh: toolchains/check_image.sh finds what it must in tiny images, and nothing in a clean one.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# expect FLAGS MESSAGE: the image of the program on stdin is refused with this message; empty: it is accepted.
expect() {
  cat >"$work/main.cpp"
  # shellcheck disable=SC2086 -- several flags
  arm-none-eabi-g++ $1 -w -std=c++20 -O1 -mthumb -ffreestanding -fno-exceptions --specs=nano.specs -nostartfiles \
    -Wl,--entry=main,--no-warn-rwx-segments "$work/main.cpp" -o "$work/image.elf"
  local said
  said=$("$root/toolchains/check_image.sh" arm-none-eabi-nm arm-none-eabi-objdump "$work/image.elf" 2>&1) && said=""
  if { [ -z "$2" ] && [ -n "$said" ]; } || [[ $said != *"$2"* ]]; then
    echo "expected '$2', got '$said' for $1: $(cat "$work/main.cpp")" >&2
    failed=1
  fi
}
m0="-mcpu=cortex-m0 -mfloat-abi=soft" m3="-mcpu=cortex-m3 -mfloat-abi=soft" m4="-mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16"

for cpu in "$m0" "$m3" "$m4"; do
  expect "$cpu" "" <<<'volatile long long x; int main() { x = x * x >> 5; }'
  expect "$cpu" "floating-point routines" <<<'volatile double x; int main() { x = x * x; }'
  expect "$cpu" "floating-point" <<<'volatile float x; volatile int y; int main() { x = y; }'
  expect "$cpu" "division" <<<'volatile int x; int main() { x = 1000 / x; }'
  expect "$cpu" "division routines" <<<'volatile long long x; int main() { x = 1000 / x; }'
done
expect "$m3" "floating-point routines" <<<'volatile float x; int main() { x = x + 1; }'
expect "$m4" "floating-point instructions" <<<'volatile float x; int main() { x = x + 1; }'
expect "$m3" "the heap" <<<'#include <cstdlib>
extern "C" void* _sbrk(int) { return nullptr; }
volatile void* x; int main() { x = std::malloc(7); }'
exit $failed
