#!/usr/bin/env python3
"""The drive node's image on its emulated board, over its own bus: boot-up, identity, torques bit for bit, faults.

  node_test.py mps2-an385|mps2-an386|mps2-an500|netduinoplus2|zynqmp_r5 BUILD_DIRECTORY EXPECTED [SUFFIX]

EXPECTED: program of node_expected.cpp. SUFFIX: of the images of another golden model, as in node_measured_remembers. Prints what the tick costs, one "name value" a line.
"""
import pathlib
import subprocess
import sys
import time

from bus import Emulator, QtestXcan, Silent, SlcanBus

NODE = 1
MEASURED = 401  # ticks


def emulator(board, build):
    if board == 'netduinoplus2':
        return Emulator(['qemu-system-arm', '-M', board, '-nographic', '-monitor', 'none', '-chardev',
                         'socket,id=line,fd=%fd%', '-serial', 'chardev:line', '-device',
                         f'loader,file={build}/firmware/node-{board}.bin,addr=0x08000000,force-raw=on'])
    if board == 'zynqmp_r5':
        return Emulator(['qemu-system-aarch64', '-M', 'xlnx-zcu102,canbus0=bus,canbus1=bus', '-smp', '6', '-m', '128M',
                         '-accel', 'tcg,thread=single', '-nographic', '-monitor', 'none', '-serial', 'none', '-object',
                         'can-bus,id=bus', '-chardev', 'socket,id=line,fd=%fd%', '-object',
                         'qtest,id=registers,chardev=line', '-device',
                         f'loader,file={build}/firmware/kick.bin,addr=0x10000,force-raw=on,cpu-num=0', '-device',
                         f'loader,file={build}/firmware/node_qemu-zynqmp_r5.elf,cpu-num=4'])
    return mps2(board, f'{build}/firmware/node-{board}.elf')


def mps2(board, image, *more):
    # One instruction takes 2^8 ns of emulated time, so that SysTick counts instructions (hal/mps2/systick.hpp).
    return Emulator(['qemu-system-arm', '-M', board, '-icount', 'shift=8', '-nographic', '-monitor', 'none', '-chardev',
                     'socket,id=line,fd=%fd%', '-serial', 'chardev:line', '-kernel', str(image),
                     *more])


class Node:
    def __init__(self, bus):
        self.bus = bus

    def expect(self, identifier, timeout=10):
        """The next frame of this identifier; heartbeats and emergencies in between are passed over."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            got, data = self.bus.receive(timeout)
            if got == identifier:
                return data
        raise Silent(f'no frame {identifier:#x} within {timeout} s')

    def transfer(self, request):
        self.bus.send(0x600 + NODE, bytes(request))
        answer = self.expect(0x580 + NODE)
        if answer[0] == 0x80:
            raise RuntimeError(f'SDO abort {int.from_bytes(answer[4:], "little"):#010x} of {bytes(request).hex()}')
        return answer

    def read(self, index, sub_index=0):
        """CiA 301, 7.2.4.3: expedited or segmented upload."""
        answer = self.transfer([0x40, index & 0xFF, index >> 8, sub_index, 0, 0, 0, 0])
        if answer[0] & 2:
            return answer[4:8 - (answer[0] >> 2 & 3)]
        data, toggle, size = b'', 0, int.from_bytes(answer[4:], 'little')
        while True:
            answer = self.transfer([0x60 | toggle, 0, 0, 0, 0, 0, 0, 0])
            assert answer[0] & 0x10 == toggle, 'toggle bit'
            data += answer[1:8 - (answer[0] >> 1 & 7)]
            toggle ^= 0x10
            if answer[0] & 1:
                assert len(data) == size
                return data

    def number(self, index, sub_index=0):
        return int.from_bytes(self.read(index, sub_index), 'little')

    def write(self, index, sub_index, value, size):
        self.transfer([0x23 | (4 - size) << 2, index & 0xFF, index >> 8, sub_index, *value.to_bytes(4, 'little')])

    def command(self, specifier):
        self.bus.send(0x000, bytes([specifier, NODE]))


def expected_ticks(program):
    ticks = []
    for line in subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines():
        words = [bytes.fromhex(word) for word in line.split()[1:]]
        ticks.append((words[:6], words[6:]) if words else None)
    return ticks


def stream(node, ticks):
    """Lockstep: setpoints and SYNC, then the torques. Returns how many ticks were the same, and their rate."""
    same, begin = 0, time.monotonic()
    for tick in ticks:
        if tick is None:  # the model begins at rest
            node.command(0x80)
            node.command(0x01)
            continue
        setpoints, torques = tick
        for joint, data in enumerate(setpoints, 1):
            node.bus.send(0x200 + joint, data)
        node.bus.send(0x080)
        for joint, torque in enumerate(torques, 1):
            answer = node.expect(0x180 + joint)
            assert answer[7] == 0x11, f'joint {joint}: status {answer[7]:#04x}, not fresh and enabled alone'
            assert answer[:6] == torque, f'tick {same}, joint {joint}: {answer.hex()}, expected {torque.hex()}'
        same += 1
    return same, same / (time.monotonic() - begin)


def in_lockstep(node):
    """SYNC comes at any rate, and is overdue after a minute."""
    node.write(0x1006, 0, 0, 4)
    node.write(0x2014, 0, 60_000, 2)


def counter(node, item):
    return node.number(0x2001, item + 1)


def main():
    board, build, program = sys.argv[1], pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
    suffix = sys.argv[4] if len(sys.argv) > 4 else ''
    ticks = expected_ticks(program)
    if board == 'netduinoplus2':  # polls without sleep, which slows its emulator down
        ticks = ticks[:101]
    with emulator(board, build) as machine:
        line = machine.line
        bus = QtestXcan(line) if board == 'zynqmp_r5' else SlcanBus(line)
        node = Node(bus)
        if board == 'zynqmp_r5':  # the first one may have come before this controller was on
            node.expect(0x700 + NODE, 30)
            node.command(0x81)
            while node.expect(0x700 + NODE) != b'\0':
                pass
        else:
            assert bus.receive_line(30) == f't{0x700 + NODE:03X}100', 'the first frame is not the boot-up message'
            bus.command(b'V\rt12\r')  # an adapter's answers: version; a line that is no frame
            answers = [bus.receive_line()]
            while '\a' not in answers or not any(answer.startswith('V') for answer in answers):
                answers.append(bus.receive_line())
        assert node.expect(0x700 + NODE) == b'\x7f', 'not pre-operational'

        assert node.number(0x1018, 2) == 0x31445846, 'product code'
        hardware = node.read(0x1009).decode()
        # No emulator has the STM32F4's oscillators: the image has to fall back to the internal one.
        assert hardware == {'netduinoplus2': 'netduinoplus2 HSI'}.get(board, board), hardware
        if board == 'netduinoplus2':  # and to tell it: EMCY 0x5000, bit 3: the crystal
            errors = [node.number(0x1003, i + 1) for i in range(node.number(0x1003, 0))]
            assert 0x00085000 in errors, [f'{error:#010x}' for error in errors]
        assert node.number(0x2000, 3) == 1, 'tables are not valid'

        in_lockstep(node)
        node.write(0x2010, 0, 0, 2)           # no ramp: torques are the model's from the first tick on
        same, rate = stream(node, ticks)
        assert same == sum(tick is not None for tick in ticks)
        assert counter(node, 0) == same and counter(node, 1) == 0, 'ticks were stale'

        # A setpoint missing: the tick is stale, the node says so and goes on with the next one.
        begin = ticks.index(None) + 1
        setpoints, _ = ticks[begin]
        node.command(0x80)
        node.command(0x01)
        for lost in (True, False):
            for joint, data in enumerate(setpoints, 1):
                if not (lost and joint == 3):
                    node.bus.send(0x200 + joint, data)
            node.bus.send(0x080)
            statuses = {node.expect(0x180 + joint)[7] & 1 for joint in range(1, 7)}
            assert statuses == ({0} if lost else {1}), statuses
        assert counter(node, 1) == 1 and counter(node, 3) == 1

        node.bus.send(0x201, b'\1\2')  # too short
        assert counter(node, 5) == 1

        print(f'ticks {same}\nticks_per_second {rate:.0f}')
    if board.startswith('mps2-'):  # only there the counter counts instructions
        measure(board, build / f'tests/golden/node_measured{suffix}-{board}.elf', ticks[:MEASURED])


def measure(board, image, ticks):
    """The same node, but its costs without interrupts, over a run of ticks with nothing else between them: each of
    setpoints, SYNC and torques; the first of a run has the NMT command that started it as well."""
    with mps2(board, image) as machine:
        node = Node(SlcanBus(machine.line))
        assert node.expect(0x700 + NODE, 30) == b'\0'
        in_lockstep(node)
        node.write(0x2010, 0, 0, 2)
        node.command(0x01)  # leaving operation, as the ticks begin, forgets what SDO has cost
        same, _ = stream(node, ticks)
        assert counter(node, 0) == same == sum(tick is not None for tick in ticks)
        print(f'measured_ticks {same}')
        for item, name in enumerate(('model', 'most_model', 'everything', 'most_everything'), 1):
            print(f'{name} {node.number(0x2002, item)}')


if __name__ == '__main__':
    try:
        main()
    except (AssertionError, Silent, RuntimeError) as reason:
        sys.exit(f'node_test: {reason}')
