# Sourced: how the compilers of Debian 12 are called for the host and for a Cortex-M4 (mps2-an386), as anybody would call
# them: no flag is there for the sake of the model's headers. choose_compiler COMPILER TARGET (gcc | clang, host | m4) sets
# compile (compiler and flags), link and libraries.
warnings=(-Wall -Wextra -Wshadow -Wconversion -Werror)
m4=(-mcpu=cortex-m4 -mfloat-abi=soft -mthumb)

# Where the cross compiler's C and C++ library have their headers, for a compiler that does not know.
library_headers() {
  arm-none-eabi-g++ "${m4[@]}" -E -v -x c++ /dev/null 2>&1 | sed -n '/^#include </,/^End of search/s/^ //p' |
    grep -vE '/gcc/arm-none-eabi/[0-9.]+/include(-fixed)?$'
}

choose_compiler() {
  compile=() link=() libraries=()
  case $1-$2 in
    gcc-host) compile=(g++) ;;
    clang-host) compile=(clang++-14) ;;
    gcc-m4) compile=(arm-none-eabi-g++ --specs=nano.specs) ;;
    clang-m4) compile=(clang++-14 --target=thumbv7em-none-eabi -nostdinc++) ;;
    *) echo "compilers.sh: no compiler '$1' for '$2'" >&2; exit 2 ;;
  esac
  if [ "$2" = m4 ]; then
    compile+=("${m4[@]}" -ffreestanding -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit
      -ffunction-sections -fdata-sections -DFXDYN_MPS2_AN386
      -DEIGEN_NO_MALLOC -DEIGEN_NO_IO -DEIGEN_NO_DEBUG -DEIGEN_DONT_VECTORIZE -DEIGEN_MAX_ALIGN_BYTES=0)
  fi
  local script=(-Ltoolchains/linker -Ttoolchains/linker/mps2.ld) directory
  case $1-$2 in
    gcc-host) link=("${compile[@]}") ;;
    clang-host) link=("${compile[@]}" -fuse-ld=lld) ;;
    gcc-m4) link=("${compile[@]}" -nostartfiles "${script[@]}" -Wl,--gc-sections,--no-warn-rwx-segments) ;;
    clang-m4)
      # Without an operating system clang does not link at link time: lld does it alone.
      link=(ld.lld-14 "${script[@]}" --gc-sections --defsym=fxdyn_stack_size=2560 --defsym=fxdyn_flash_page=2048)
      libraries=("$(arm-none-eabi-gcc "${m4[@]}" -print-file-name=libc_nano.a)"
        "$(arm-none-eabi-gcc "${m4[@]}" -print-libgcc-file-name)")
      while read -r directory; do compile+=(-isystem "$directory"); done < <(library_headers)
      ;;
  esac
  compile+=(-std=c++20 "${warnings[@]}" -I. -isystem /usr/include/eigen3)
}
