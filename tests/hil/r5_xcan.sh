#!/usr/bin/env bash
# r5_xcan.sh DIRECTORY IMAGE KICK [TICKS [LEAST_RATE]]: the Cortex-R5F image on QEMU's Zynq UltraScale+ board behind its CAN
# controller, whose bus is vcan0 of the machine that this runs on: it needs SocketCAN. DIRECTORY has the programs, KICK
# starts the R5F.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
bin=$1 image=$2 kick=$3 ticks=${4:-5000} least=${5:-0}
. "$here/interfaces.sh"
QEMU_AUDIO_DRV=none qemu-system-aarch64 -M xlnx-zcu102,canbus0=canbus0 -smp 6 -m 128M -accel tcg,thread=single -display none -monitor none -serial null \
  -object can-bus,id=canbus0 -object can-host-socketcan,id=host,if=vcan0,canbus=canbus0 \
  -device "loader,file=$kick,addr=0x10000,force-raw=on,cpu-num=0" -device "loader,file=$image,cpu-num=4" &
trap 'kill %1; wait' EXIT
"$bin/hil_driver" --name "Cortex-R5F behind XCAN" --can vcan0 --nodes 1 --ticks "$ticks" --least-rate "$least"
