#!/usr/bin/env python3
"""A drive node whose fifth tick never ends, on an emulated board: the watchdog resets it, and it says so.

  hang_test.py mps2-an386 BUILD_DIRECTORY
"""
import pathlib
import sys

from bus import Silent, SlcanBus
from node_test import NODE, Node, counter, in_lockstep, mps2

BOOT_UP, PRE_OPERATIONAL = b'\0', b'\x7f'
WATCHDOG_RESETS = 17  # item of 0x2001


def hang(node):
    """Four ticks, and a fifth that is not answered but ends with a boot-up."""
    in_lockstep(node)
    node.command(0x01)
    for _ in range(4):
        node.bus.send(0x080)
        node.expect(0x181)
    node.bus.send(0x080)
    while True:
        identifier, data = node.bus.receive()
        assert identifier != 0x181 or data[6] < 5, 'the fifth tick does not hang'
        if (identifier, data) == (0x700 + NODE, BOOT_UP):
            return


def main():
    board, build = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    with mps2(board, build / f'tests/golden/node_hangs-{board}.elf') as machine:
        node = Node(SlcanBus(machine.line))
        assert node.expect(0x700 + NODE, 30) == BOOT_UP
        # Two and a half times the watchdog's time-out: it is fed.
        beats = [node.expect(0x700 + NODE) for _ in range(25)]
        assert set(beats) == {PRE_OPERATIONAL}, f'heartbeats {beats}'
        assert counter(node, WATCHDOG_RESETS) == 0
        for _ in range(2):
            hang(node)
            emergency = node.expect(0x080 + NODE)
            assert emergency[:2] == b'\x10\x60', f'EMCY {emergency.hex()}, not 0x6010'
            assert counter(node, WATCHDOG_RESETS) == 1  # since start-up, which clears the counters


if __name__ == '__main__':
    try:
        main()
    except (AssertionError, Silent, RuntimeError) as reason:
        sys.exit(f'hang_test: {reason}')
