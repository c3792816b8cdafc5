"""Small files of MATLAB 5 for tests of commands. Source: "MAT-File Format", The MathWorks."""
import struct

INT8, INT32, UINT32, DOUBLE, MATRIX = 1, 5, 6, 9, 14
COMPLEX = 0x0800


def element(kind, data):
    return struct.pack('<II', kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(name, rows, imaginary=False):
    """rows: lists of numbers of one length, one a row; imaginary: with as much of that, which is 0."""
    columns = [value for column in zip(*rows) for value in column]
    numbers = element(DOUBLE, struct.pack(f'<{len(columns)}d', *columns))
    return element(MATRIX, element(UINT32, struct.pack('<II', 6 | (COMPLEX if imaginary else 0), 0)) +
                   element(INT32, struct.pack('<ii', len(rows), len(rows[0]))) + element(INT8, name.encode()) +
                   numbers + (element(DOUBLE, bytes(8 * len(columns))) if imaginary else b''))


def file(*matrices):
    return b'MATLAB 5.0 MAT-file'.ljust(124) + struct.pack('<H', 0x0100) + b'IM' + b''.join(matrices)
