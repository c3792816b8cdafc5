#!/usr/bin/env python3
"""A drive node whose slot for updates holds all that it may hold, on an emulated board: it starts every time, and says
which tables it uses and why.

  slot_test.py mps2-an386 IMAGE.elf OWN_PAGE.bin SLOT_ADDRESS
"""
import pathlib
import struct
import sys
import tempfile
import zlib

from bus import Silent, SlcanBus
from node_test import NODE, Node, mps2

HEADER = struct.Struct('<7I')
LAYOUT, CRC, ORIGIN, SEQUENCE = 1, 3, 4, 5
EMPTY, USED, SAME, OLDER, OTHER_ORIGIN, OTHER_LAYOUT, DAMAGED = range(7)


def changed(page, parameter=None, **words):
    """The page with other words in its header, parameters with another last word, and the CRCs that belong to them."""
    header, parameters = list(HEADER.unpack_from(page)), page[HEADER.size:]
    if parameter is not None:
        parameters = parameters[:-4] + struct.pack('<I', parameter)
        header[CRC] = zlib.crc32(parameters)
    for name, value in words.items():
        header[{'layout': LAYOUT, 'origin': ORIGIN, 'sequence': SEQUENCE}[name]] = value
    header[6] = zlib.crc32(HEADER.pack(*header)[:24])
    return HEADER.pack(*header) + parameters


def cases(own):
    header = HEADER.unpack_from(own)
    update = changed(own, parameter=12345, sequence=header[SEQUENCE] + 1)
    yield 'never written', b'', EMPTY
    yield 'erased', b'\xff' * len(own), EMPTY
    yield 'an update', update, USED
    yield "the image's own page", own, SAME
    yield 'an older page', changed(own, parameter=12345, sequence=header[SEQUENCE] - 1), OLDER
    yield 'another page of the same number', changed(own, parameter=12345), OLDER
    yield 'a newer page of another model', changed(update, origin=header[ORIGIN] ^ 1, sequence=1000), OTHER_ORIGIN
    yield 'another layout', changed(update, layout=header[LAYOUT] ^ 1), OTHER_LAYOUT
    yield 'a flipped bit of its number', update[:23] + bytes([update[23] ^ 0x40]) + update[24:], DAMAGED
    for part in (8, 24, 32, len(own) // 2, len(own) - 4):
        yield f'{part} bytes of an update', update[:part] + b'\xff' * (len(own) - part), DAMAGED


def main():
    board, image, page, slot = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]).read_bytes(), sys.argv[4]
    count = 0
    with tempfile.NamedTemporaryFile() as file:
        for name, content, state in cases(page):
            pathlib.Path(file.name).write_bytes(content)
            loader = ['-device', f'loader,file={file.name},addr={slot},force-raw=on'] if content else []
            with mps2(board, image, *loader) as machine:
                node = Node(SlcanBus(machine.line))
                assert node.expect(0x700 + NODE, 30) == b'\0', f'{name}: no boot-up'
                if state >= OLDER:
                    emergency = node.expect(0x080 + NODE)
                    expected = struct.pack('<HBH', 0x6320, 1, state)
                    assert emergency[:5] == expected, f'{name}: EMCY {emergency.hex()}'
                said = [node.number(0x2000, item) for item in (8, 6, 3)]
                assert said == [state, int(state == USED), 1], f'{name}: slot, page, valid {said}, expected {state}'
                used = HEADER.unpack_from(content if state == USED else page)
                assert [node.number(0x2000, 1), node.number(0x2000, 7)] == [used[CRC], used[SEQUENCE]], name
                node.command(0x01)
                while node.expect(0x700 + NODE) != b'\x05':
                    pass
            count += 1
    print(f'{count} slots, the node starts from each')


if __name__ == '__main__':
    try:
        main()
    except (AssertionError, Silent, RuntimeError) as reason:
        sys.exit(f'slot_test: {reason}')
