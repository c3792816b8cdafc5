"""Small Parquet files for tests of commands: plain pages of version 1, not packed. Source: Apache Parquet format, parquet.thrift."""
import struct

INT64, FLOAT, DOUBLE = 2, 4, 5
REQUIRED, OPTIONAL, REPEATED = 0, 1, 2
LETTERS = {INT64: 'q', FLOAT: 'f', DOUBLE: 'd'}
LIST = 3  # of ConvertedType


def varint(value):
    out = b''
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def number(value):
    return varint(value << 1 if value >= 0 else (-value << 1) - 1)


def fields(*pairs):
    """A struct of Thrift's compact protocol: (field, value) with rising fields; bytes are a struct, a list is one of structs."""
    out, last = b'', 0
    for field, value in pairs:
        if isinstance(value, bytes):
            kind, content = 12, value
        elif isinstance(value, str):
            kind, content = 8, varint(len(value)) + value.encode()
        elif isinstance(value, list):
            kind, content = 9, bytes([0xf0 | 12]) + varint(len(value)) + b''.join(value)
        else:
            kind, content = 6, number(value)
        out, last = out + bytes([(field - last) << 4 | kind]) + content, field
    return out + b'\0'


def levels(values, width):
    """Runs of one number each, behind their length."""
    runs, at = b'', 0
    while at < len(values):
        end = at
        while end < len(values) and values[end] == values[at]:
            end += 1
        runs += varint((end - at) << 1) + bytes([values[at]])
        at = end
    return struct.pack('<I', len(runs)) + runs


def column(kind, rows):
    """The schema's elements below its name, and the page: (elements, count of values, bytes). rows: numbers, None for null, or lists."""
    is_list = isinstance(rows[0], (list, tuple))
    flat = [x for row in rows for x in row] if is_list else list(rows)
    data = b''
    if is_list:
        data += levels([0 if k == 0 else 1 for row in rows for k in range(len(row))], 1)
    elements, most = [], 2 if is_list else 1
    data += levels([most if x is not None else most - 1 for x in flat], 2)
    there = [x for x in flat if x is not None]
    data += struct.pack(f'<{len(there)}{LETTERS[kind]}', *there)
    if is_list:
        elements = [fields((3, REPEATED), (4, 'list'), (5, 1)), fields((1, kind), (3, OPTIONAL), (4, 'element'))]
    page = fields((1, 0), (2, len(data)), (3, len(data)), (5, fields((1, len(flat)), (2, 0), (3, 3), (4, 3)))) + data
    return elements, len(flat), page


def file(columns):
    """columns: name -> (kind, rows)."""
    out, schema, chunks, count = b'PAR1', [fields((4, 'schema'), (5, len(columns)))], [], 0
    for name, (kind, rows) in columns.items():
        elements, values, page = column(kind, rows)
        group = ((3, REQUIRED), (4, name), (5, 1), (6, LIST)) if elements else ((1, kind), (3, OPTIONAL), (4, name))
        schema += [fields(*group), *elements]
        chunks.append(fields((2, len(out)), (3, fields((1, kind), (4, 0), (5, values), (7, len(page)), (9, len(out))))))
        out, count = out + page, len(rows)
    footer = fields((1, 2), (2, schema), (3, count), (4, [fields((1, chunks), (3, count))]))
    return out + footer + struct.pack('<I', len(footer)) + b'PAR1'
