#!/usr/bin/env bash
# hil_setup.sh [DIRECTORY]: what the hardware-in-the-loop tests need besides toolchains/setup.sh. Installs Debian packages
# and, where this machine's kernel has no SocketCAN, no vcan or no gpiochip to play with, makes in DIRECTORY (build/guest)
# the guest that tests/hil/guest.sh boots: Debian's kernel as its package holds it, the modules the tests use and an
# initramfs of busybox. Running it twice does nothing.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
directory=${1:-$here/../build/guest}

packages=(qemu-system-x86 qemu-system-arm busybox-static cpio kmod xz-utils iproute2 can-utils tshark gpiod)
# The gpio-sim driver is built against these; Debian's amd64 kernel comes without it.
packages+=(linux-headers-amd64 make gcc)

"$here/install.sh" "${packages[@]}"
[ "${FXDYN_HIL_ON_HOST:-0}" = 1 ] && exit 0

headers=$(dpkg-query -W -f '${Depends}\n' linux-headers-amd64 | grep -o 'linux-headers-[0-9][^ ,]*' | head -n 1)
release=${headers#linux-headers-}
version=$(dpkg-query -W -f '${Version}\n' "$headers")
[ "$(cat "$directory/kernel-version" 2>/dev/null)" = "$version" ] && exit 0
echo "hil_setup: guest with Debian's kernel $release ($version) in $directory"

rm -rf "$directory"
mkdir -p "$directory"
cd "$directory"
# Downloaded, not installed: this machine shall not boot from it. Image, headers and source have to be of one version.
download() {
  mkdir -p packages
  (cd packages && apt-get download -qq "$1=$version" 2>/dev/null)
}
download "linux-image-$release"
download "linux-source-${version%%.*}.$(cut -d. -f2 <<<"$version")"
dpkg-deb -x packages/linux-image-*.deb image
# The kernel unpacked (xz, as its package compresses it), for QEMU's direct boot: unpacking takes 4 s in an emulator.
offset=$(LC_ALL=C grep -aobP -m1 '\xFD7zXZ\x00' "image/boot/vmlinuz-$release" | head -n 1 | cut -d: -f1)
tail -c +$((offset + 1)) "image/boot/vmlinuz-$release" | xz -dc --single-stream >vmlinux 2>/dev/null || true
readelf -h vmlinux >/dev/null

# gpio-sim and the irq_sim it needs, out of tree. Both are plain files of the kernel's source; what changes is only that
# one module's symbols are not exported to others, and that modules have no irq_to_desc().
dpkg-deb --fsys-tarfile packages/linux-source-*.deb | tar -xO --wildcards '*/linux-source-*.tar.xz' |
  tar -xJ --strip-components=1 --wildcards '*/drivers/gpio/gpio-sim.c' '*/drivers/gpio/gpiolib.h' '*/kernel/irq/irq_sim.c'
rm -r packages
mkdir gpio-sim
mv drivers/gpio/gpio-sim.c gpio-sim/gpio_sim_main.c
sed -e '/^EXPORT_SYMBOL/d' -e 's/irq_to_desc(\([^)]*\))/irq_data_to_desc(irq_get_irq_data(\1))/g' kernel/irq/irq_sim.c >gpio-sim/irq_sim.c
mv drivers/gpio/gpiolib.h gpio-sim/
rm -r drivers kernel
printf 'obj-m := gpio-sim.o\ngpio-sim-objs := gpio_sim_main.o irq_sim.o\n' >gpio-sim/Makefile
make -s -C "/usr/src/$headers" M="$PWD/gpio-sim" modules >gpio-sim/log 2>&1 || {
  cat gpio-sim/log >&2
  exit 1
}

# The initramfs: busybox, the modules and those they depend on. tests/hil/guest.sh adds /init.
modules=(virtio_pci virtio_console 9p 9pnet_virtio overlay can can_raw can_dev vcan slcan kvaser_pci configfs)
mkdir -p initramfs/{bin,dev,proc,sys,root,lib/modules}
cp /bin/busybox initramfs/bin/
depmod -b image "$release"
for module in "${modules[@]}"; do
  modprobe -d image -S "$release" --show-depends "$module"
done | awk '$1 == "insmod" && !seen[$2]++ {print $2}' >modules.list
while read -r file; do
  cp "$file" initramfs/lib/modules/
  basename "$file"
done <modules.list >initramfs/lib/modules/order
cp gpio-sim/gpio-sim.ko initramfs/lib/modules/
echo gpio-sim.ko >>initramfs/lib/modules/order
(cd initramfs && find . | cpio --quiet -o -H newc) | gzip -1 >initramfs.gz
truncate -s %4 initramfs.gz  # where guest.sh's archive may begin
rm -rf image initramfs modules.list
echo "$version" >kernel-version
