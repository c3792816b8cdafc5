#!/usr/bin/env bash
# m4_slcan.sh DIRECTORY IMAGE [TICKS [LEAST_RATE]]: the Cortex-M4 image on QEMU's MPS2 board, its UART a CAN adapter that speaks
# SLCAN, at a bus of the guest: slcand there makes can0 of the virtual console hvc0. A relay between the two hands on whole frames.
# DIRECTORY has the programs.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
bin=$1 image=$2 ticks=${3:-5000} least=${4:-0}

if [ "${FXDYN_INSIDE:-0}" = 0 ]; then
  lines=$(mktemp -d)
  # mux: a UART without it gets one byte a turn of QEMU's main loop, with it the next one as soon as it has read the last
  timeout 840 qemu-system-arm -M mps2-an386 -display none -monitor none \
    -chardev "socket,id=line,path=$lines/board,server=on,wait=on,mux=on" -serial chardev:line -kernel "$image" &
  board=$!
  "$bin/slcan_relay" "$lines/host" "$lines/board" &
  trap 'kill $board 2>/dev/null || true; rm -rf "$lines"' EXIT
  for _ in $(seq 100); do [ -S "$lines/host" ] && break || sleep 0.1; done
  FXDYN_INSIDE=1 "$here/guest.sh" --qemu -device --qemu virtio-serial-pci --qemu -chardev --qemu "socket,id=line,path=$lines/host" \
    --qemu -device --qemu virtconsole,chardev=line -- "$here/m4_slcan.sh" "$@"
  exit
fi

# 1 Mbit/s (S8); the adapter's own queue is deep, since a console has no flow control for frames
slcand -o -c -f -s8 -S 115200 -F hvc0 can0 &
trap 'kill %1' EXIT
for _ in $(seq 100); do [ -e /sys/class/net/can0 ] && break || sleep 0.1; done
ip link set can0 txqueuelen 1000 up
chrt --fifo 50 "$bin/hil_driver" --name "Cortex-M4 over SLCAN" --can can0 --nodes 1 --ticks "$ticks" --least-rate "$least"
