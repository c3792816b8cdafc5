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

# start_node PROGRAM ARGUMENT..: a node on vcan0, awaited until it is on the bus; its process is $node
start_node() {
  local said
  said=$(mktemp)
  "$1" --can vcan0 "${@:2}" >"$said" 2>&1 &
  node=$!
  for _ in $(seq 600); do ! grep -q ' on vcan0' "$said" || return 0; sleep 0.1; done
  echo "FAILED: $1 does not start: $(cat "$said")"
  exit 1
}
