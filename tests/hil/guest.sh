#!/usr/bin/env bash
# guest.sh [--output DIR] [--qemu ARGUMENT].. -- COMMAND ARGUMENT..
# Runs a command as root on a kernel that has SocketCAN, vcan, slcan and gpio-sim, in the current directory, and returns its exit
# code. It sees this machine's files; what it writes is gone afterwards, except below DIR. Made by toolchains/hil_setup.sh.
#   --qemu      goes to qemu-system-x86_64, for serial lines and the like; inherited file descriptors stay open
#   FXDYN_GUEST           directory of the guest, build/guest by default
#   FXDYN_GUEST_TIMEOUT   seconds until it is killed, 120 by default
# Exit code 125: the guest itself failed or hung, 126: it could not be set up; a command's codes above 124 become 124.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
guest=${FXDYN_GUEST:-$root/build/guest}
output="" qemu=()
while [ "$1" != -- ]; do
  case $1 in
    --output) mkdir -p "$2" && output=$(cd "$2" && pwd) ;;
    --qemu) qemu+=("$2") ;;
    *) echo "guest.sh: unknown option $1" >&2 && exit 126 ;;
  esac
  shift 2
done
shift

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# The command and the first process go into a second archive behind the initramfs, which the kernel unpacks over the first.
printf '%s' "$output" >"$work/output-directory"
{
  printf 'cd %q || exit 126\n' "$PWD"
  # an environment for tests and nothing more of this machine's
  for name in "${!FXDYN_@}"; do printf 'export %s=%q\n' "$name" "${!name}"; done
  printf 'exec'
  printf ' %q' "$@"
  printf '\n'
} >"$work/command"
{
  cat "$guest/initramfs.gz"
  install -m 755 "$root/tests/hil/guest_init.sh" "$work/init"
  (cd "$work" && printf 'init\ncommand\noutput-directory\n' | cpio --quiet -o -H newc)
} >"$work/initrd"

shares=(-virtfs "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap")
[ -z "$output" ] || shares+=(-virtfs "local,path=$output,mount_tag=output,security_model=none,multidevs=remap")

# -accel tcg: /dev/kvm may be there and hang.
code=0
timeout --kill-after=5 "${FXDYN_GUEST_TIMEOUT:-120}" qemu-system-x86_64 -accel tcg -cpu qemu64 -m "${FXDYN_GUEST_MEMORY:-512M}" \
  -smp "${FXDYN_GUEST_CPUS:-1}" -no-reboot -nodefaults -display none -kernel "$guest/vmlinux" -initrd "$work/initrd" \
  -append "console=ttyS1 ${FXDYN_GUEST_DEBUG:-quiet} panic=-1 mitigations=off no_timer_check tsc=reliable" "${shares[@]}" \
  -device isa-debug-exit,iobase=0xf4,iosize=1 -serial "file:$work/console" -serial "file:$work/kernel" "${qemu[@]}" || code=$?
cat "$work/console"; [ -z "${FXDYN_GUEST_DEBUG:-}" ] || cat "$work/kernel" >&2
if [ $((code & 1)) -eq 1 ] && [ $code -ne 137 ] && [ $code -lt 251 ]; then exit $((code >> 1)); fi
echo "guest.sh: the guest did not end by itself (code $code); its kernel said:" >&2
tail -n 20 "$work/kernel" >&2
exit 125
