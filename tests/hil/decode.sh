#!/usr/bin/env bash
# decode.sh CAPTURE: Wireshark's CANopen dissector takes every frame of a candump log, and finds none malformed.
set -euo pipefail
frames=$(wc -l <"$1")
tshark -r "$1" -d can.subdissector,canopen -T fields -e _ws.col.Protocol -e _ws.malformed -e _ws.col.Info 2>/dev/null >"$1.decoded"
decoded=$(grep -c "^CANopen" "$1.decoded" || true)
malformed=$(grep -ci 'malformed' "$1.decoded" || true)
echo "$frames frames, $decoded of them CANopen, $malformed malformed"
cut -f3 "$1.decoded" | sed 's/ \[.*//' | sort | uniq -c | sort -rn | head -n 20
# some 3 000 frames pass; a capture may miss some where the machine is busy, which is no loss of the bus
[ "$frames" -gt 1500 ] && [ "$decoded" -eq "$frames" ] && [ "$malformed" -eq 0 ]
