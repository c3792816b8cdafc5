"""CAN buses of images in QEMU, for tests: frames are (identifier, bytes)."""
import os
import re
import select
import socket
import subprocess
import time


class Silent(Exception):
    pass


class Emulator:
    """QEMU, connected by the socket `line`; ends with the with statement. %fd% in the arguments is the far end."""

    def __init__(self, arguments):
        self.line, far = socket.socketpair()
        with far:
            arguments = [argument.replace('%fd%', str(far.fileno())) for argument in arguments]
            # `timeout` ends it even if this program is killed.
            self.process = subprocess.Popen(
                ['timeout', '--kill-after=5', '200', *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, pass_fds=[far.fileno()], env={**os.environ, 'QEMU_AUDIO_DRV': 'none'})
        # On one CPU its threads hand bytes over faster than on two.
        os.sched_setaffinity(self.process.pid, {min(os.sched_getaffinity(0))})

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


class SlcanBus:
    def __init__(self, line):
        self.line, self.text, self.unsent = line, b'', b''

    def command(self, text):
        self.unsent += text

    def send(self, identifier, data=b''):
        """Goes out with the next receive: one write for many frames."""
        self.unsent += f't{identifier:03X}{len(data)}{data.hex().upper()}\r'.encode()

    def receive_line(self, timeout=10):
        """The next line without its end, a CR. A BEL, which refuses a line and has no CR after it, is a line of its own."""
        self.line.sendall(self.unsent)
        self.unsent = b''
        deadline = time.monotonic() + timeout
        while not (line := re.match(rb'\a|[^\r\a]*\r|[^\r\a]+(?=\a)', self.text)):
            ready, _, _ = select.select([self.line], [], [], max(0, deadline - time.monotonic()))
            more = self.line.recv(4096) if ready else b''
            if not more:
                raise Silent(f'no line within {timeout} s')
            self.text += more
        self.text = self.text[line.end():]
        return line[0].rstrip(b'\r').decode()

    def receive(self, timeout=10):
        while True:
            line = self.receive_line(timeout)
            if line[:1] == 't':
                return int(line[1:4], 16), bytes.fromhex(line[5:])


class QtestXcan:
    """The second CAN controller of the machine, on the same bus as the first, worked through QEMU's qtest protocol:
    registers as in UG1087, frames as QEMU 7.2 has them (hal/zynqmp_r5/xcan.hpp)."""

    BASE = 0xFF070000

    def __init__(self, line):
        self.line, self.text = line, b''
        self.write(0x00, 1)
        self.write(0x00, 2)

    def ask(self, text):
        self.line.sendall(text.encode() + b'\n')
        while b'\n' not in self.text:
            more = self.line.recv(4096)
            if not more:
                raise Silent('the emulator has gone')
            self.text += more
        line, _, self.text = self.text.partition(b'\n')
        words = line.decode().split()
        assert words[0] == 'OK', line
        return int(words[1], 16) if len(words) > 1 else 0

    def write(self, offset, value):
        self.ask(f'writel {self.BASE + offset:#x} {value:#x}')

    def read(self, offset):
        return self.ask(f'readl {self.BASE + offset:#x}')

    def send(self, identifier, data=b''):
        padded = data.ljust(8, b'\0')
        self.write(0x30, identifier)
        self.write(0x34, len(data) << 28)
        self.write(0x38, int.from_bytes(padded[:4], 'little'))
        self.write(0x3C, int.from_bytes(padded[4:], 'little'))

    def receive(self, timeout=10):
        deadline = time.monotonic() + timeout
        while not self.read(0x1C) & 1 << 7:
            if time.monotonic() > deadline:
                raise Silent(f'no frame within {timeout} s')
        identifier, size, first, second = (self.read(offset) for offset in (0x50, 0x54, 0x58, 0x5C))
        self.write(0x24, 1 << 7)
        data = first.to_bytes(4, 'little') + second.to_bytes(4, 'little')
        return identifier, data[:size >> 28]
