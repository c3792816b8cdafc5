#!/bin/busybox sh
# First process of the guest: mounts the host's files (read-only, with changes kept in memory), runs the command that
# tests/hil/guest.sh packed as /command inside them, and powers off with its exit code.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8
b=/bin/busybox
$b mount -t devtmpfs none /dev
$b mount -t proc none /proc
$b mount -t sysfs none /sys
leave() {  # QEMU's isa-debug-exit: its own exit code is 2 v + 1
  $b sync
  $b printf "\\x$($b printf %x "$1")" | $b dd of=/dev/port bs=1 seek=244 2>/dev/null
}
for module in $($b cat /lib/modules/order); do
  $b insmod "/lib/modules/$module" || leave 126
done
$b mkdir -p /host /changes /output
share() { $b mount -t 9p -o "trans=virtio,version=9p2000.L,msize=512000,$3" "$1" "$2"; }
share host /host ro,cache=loose || leave 126
$b mount -t tmpfs none /changes
$b mkdir /changes/upper /changes/work
$b mount -t overlay -o lowerdir=/host,upperdir=/changes/upper,workdir=/changes/work none /root || leave 126
$b mkdir -p /dev/pts
$b mount -t devpts none /dev/pts
$b mount -t configfs none /sys/kernel/config
for directory in dev proc sys; do $b mount -o rbind /$directory /root/$directory; done
output=$($b cat /output-directory)
if [ -n "$output" ]; then share output "/root$output" rw,cache=none || leave 126; fi
$b cp /command /root/run/fxdyn-command
$b stty -F /dev/ttyS0 -opost
$b setsid $b chroot /root /bin/bash /run/fxdyn-command </dev/null >/dev/ttyS0 2>&1
code=$?
[ $code -lt 124 ] || code=124
leave $code
