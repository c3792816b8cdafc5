# To be sourced where SocketCAN is: vcan0 with and vcan1 without CAN FD, vcan2 left down; can0 and can1 at 1 Mbit/s where
# there are controllers.
for name in vcan0 vcan1 vcan2; do
  ip link show "$name" >/dev/null 2>&1 || ip link add "$name" type vcan
done
ip link set vcan0 down
ip link set vcan0 mtu 72 txqueuelen 1000 up
ip link set vcan1 mtu 16 up
for name in can0 can1; do
  ! ip link show "$name" >/dev/null 2>&1 || ip link set "$name" up type can bitrate 1000000
done
