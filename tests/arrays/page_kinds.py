#!/usr/bin/env python3
"""page_kinds.py ARRAYS_TEST: Parquet files of every kind of page that is read, and of those that are not, by a writer of its
own after the format's pages (github.com/apache/parquet-format: README, Encodings.md, parquet.thrift) and those of the packers.
ARRAYS_TEST reads them: the numbers of files/truth.csv, or one line that names what is not read.

pyarrow's defaults are among them: pages of version 1, nullable columns, dictionaries that go over to plain numbers, snappy,
statistics, several row groups, lists as of LeRobot."""
import csv
import gzip
import itertools
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROWS_A_GROUP, ROWS_A_PAGE = 25, 10  # borders of both within the log
SIZES = {'double': (5, '<d'), 'float': (4, '<f'), 'int32': (1, '<i'), 'int64': (2, '<q')}
CODECS = {'none': 0, 'snappy': 1, 'gzip': 2, 'zstd': 6, 'lz4': 7}
PLAIN, OLD_DICTIONARY, RUNS, DELTA, DICTIONARY, APART = 0, 2, 3, 5, 8, 9


def varint(n):
    out = b''
    while n > 127:
        out, n = out + bytes([n & 127 | 128]), n >> 7
    return out + bytes([n])


def zigzag(n): return varint((n << 1) ^ (n >> 63))


class Long(int):
    """A number of 64 bits, by its type alone."""


class Struct:
    """Of Thrift's compact protocol; fields in rising order."""

    def __init__(self, *fields):
        self.bytes, last = b'', 0
        for number, value in fields:
            kind, content = self.coded(value)
            self.bytes += bytes([number - last << 4 | kind]) + content
            last = number
        self.bytes += b'\0'

    @classmethod
    def coded(cls, value):
        if isinstance(value, bool):
            return (1 if value else 2), b''
        if isinstance(value, int):
            return (6 if isinstance(value, Long) else 5), zigzag(value)
        if isinstance(value, (str, bytes)):
            text = value.encode() if isinstance(value, str) else value
            return 8, varint(len(text)) + text
        if isinstance(value, Struct):
            return 12, value.bytes
        items = [cls.coded(item) for item in value]
        size = len(items)
        head = bytes([size << 4 | items[0][0]]) if size < 15 else bytes([0xF0 | items[0][0]]) + varint(size)
        return 9, head + b''.join(content for _, content in items)


# Packers.

def matches(data, longest, least, last):
    """(where literals begin, where the match begins, its length, how far back); the last one has no match."""
    seen, begin, at = {}, 0, 0
    while at + least <= last:
        before = seen.get(data[at:at + least])
        seen[data[at:at + least]] = at
        if before is None or at - before > 65535:
            at += 1
            continue
        length = least
        while length < longest and at + length < last and data[before + length] == data[at + length]:
            length += 1
        yield begin, at, length, at - before
        at += length
        begin = at
    yield begin, len(data), 0, 0


def snappy(data):
    out = varint(len(data))
    for begin, at, length, back in matches(data, 64, 4, len(data)):
        for k in range(begin, at, 60):
            some = data[k:min(k + 60, at)]
            out += bytes([len(some) - 1 << 2]) + some
        if length:
            out += bytes([length - 1 << 2 | 2]) + struct.pack('<H', back)
    return out


def lz4(data):
    """The last five bytes are literals, and no match begins in the last twelve."""
    def rest(n):
        return b'' if n < 15 else b'\xFF' * ((n - 15) // 255) + bytes([(n - 15) % 255])
    out = b''
    for begin, at, length, back in matches(data, 1000, 8, max(len(data) - 12, 0)):
        literals, more = at - begin, max(length - 4, 0)
        out += bytes([min(literals, 15) << 4 | min(more, 15)]) + rest(literals) + data[begin:at]
        if length:
            out += struct.pack('<H', back) + rest(more)
    return out


def zstd(data):
    """RFC 8878: one segment of blocks as they are, but for those of one byte repeated."""
    out = struct.pack('<IBI', 0xFD2FB528, 0xA0, len(data))
    blocks = [data[k:k + 64] for k in range(0, len(data), 64)] or [b'']
    for k, block in enumerate(blocks):
        same = len(block) > 1 and len(set(block)) == 1
        out += struct.pack('<I', len(block) << 3 | same << 1 | (k + 1 == len(blocks)))[:3] + (block[:1] if same else block)
    return out


PACK = {'none': bytes, 'snappy': snappy, 'gzip': gzip.compress, 'zstd': zstd, 'lz4': lz4}


# Values and levels.

def bits_for(most): return most.bit_length()


def packed(values, bits):
    whole = sum(value << k * bits for k, value in enumerate(values))
    return whole.to_bytes((len(values) * bits + 7) // 8, 'little')


def runs(values, bits):
    """Runs of eight and more as such, the others in groups of eight."""
    out, at = b'', 0
    while at < len(values):
        same = next((k for k in range(at, len(values)) if values[k] != values[at]), len(values)) - at
        if same >= 8:
            out += varint(same << 1) + values[at].to_bytes((bits + 7) // 8, 'little')
            at += same
        else:
            group = values[at:at + 8] + [0] * (8 - len(values[at:at + 8]))
            out += varint(1 << 1 | 1) + packed(group, bits)
            at += 8
    return out


def differences(values):
    """DELTA_BINARY_PACKED with blocks of 128 in four parts."""
    out = varint(128) + varint(4) + varint(len(values)) + zigzag(values[0])
    steps = [b - a for a, b in zip(values, values[1:])]
    for k in range(0, len(steps), 128):
        block = steps[k:k + 128]
        least = min(block)
        parts = [[step - least for step in block[p:p + 32]] for p in range(0, 128, 32)]
        widths = [bits_for(max(part, default=0)) for part in parts]
        out += zigzag(least) + bytes(widths)
        out += b''.join(packed(part + [0] * (32 - len(part)), width) for part, width in zip(parts, widths) if part)
    return out


def plain(values, kind): return b''.join(struct.pack(SIZES[kind][1], value) for value in values)


def apart(values, kind):
    size = struct.calcsize(SIZES[kind][1])
    text = plain(values, kind)
    return b''.join(text[k::size] for k in range(size))


class Column:
    """A number a row, or a list of them. `nullable`: row, and number in a list, may be null."""

    def __init__(self, name, rows, kind='double', nullable=False, converted=None):
        self.name, self.rows, self.kind, self.nullable, self.converted = name, rows, kind, nullable, converted
        self.is_list = isinstance(rows[0], list)
        self.defined = (2 * nullable + 1) if self.is_list else int(nullable)

    def schema(self):
        nullable = int(self.nullable)
        leaf = [(1, SIZES[self.kind][0]), (3, nullable), (4, 'element' if self.is_list else self.name)]
        if self.converted is not None:
            leaf.append((6, self.converted))
        if not self.is_list:
            return [Struct(*leaf)]
        return [Struct((3, nullable), (4, self.name), (5, 1), (6, 3), (10, Struct((3, Struct())))),
                Struct((3, 2), (4, 'list'), (5, 1)), Struct(*leaf)]

    def path(self): return [self.name, 'list', 'element'] if self.is_list else [self.name]

    def levels(self, rows):
        """Per entry: repeated, defined, number or None."""
        for row in rows:
            for k, number in enumerate(row if self.is_list else [row]):
                yield int(k > 0), self.defined - (number is None), number


class Kind:
    """How pages are made."""

    def __init__(self, version=1, values='plain', codec='none'):
        self.version, self.values, self.codec = version, values, codec

    def encoded(self, numbers, kind, dictionary, page):
        if self.values == 'delta':
            return DELTA, differences(numbers)
        if self.values == 'apart':
            return APART, apart(numbers, kind)
        if self.values == 'plain' or (self.values == 'dictionary_then_plain' and page > 0):
            return PLAIN, plain(numbers, kind)
        bits = bits_for(max(len(dictionary) - 1, 1))
        places = runs([dictionary.index(number) for number in numbers], bits)
        return (OLD_DICTIONARY if self.values == 'old_dictionary' else DICTIONARY), bytes([bits]) + places

    def page(self, column, rows, dictionary, number):
        entries = list(column.levels(rows))
        there = [value for _, _, value in entries if value is not None]
        encoding, values = self.encoded(there, column.kind, dictionary, number)
        repeated = runs([e[0] for e in entries], 1) if column.is_list else b''
        defined = runs([e[1] for e in entries], bits_for(column.defined)) if column.defined else b''
        statistics = Struct((3, Long(len(entries) - len(there))), (5, plain([max(there)], column.kind)), (6, plain([min(there)], column.kind)))
        if self.version == 2:
            content = PACK[self.codec](values)
            size, length = (len(repeated) + len(defined) + len(x) for x in (values, content))
            # all but one page in three say that they are packed, as they have to where nothing is said
            head = [(1, len(entries)), (2, len(entries) - len(there)), (3, len(rows)), (4, encoding), (5, len(defined)), (6, len(repeated))]
            if self.codec == 'none' or number % 3 == 0:
                head.append((7, self.codec != 'none'))
            head = Struct((1, 3), (2, size), (3, length), (8, Struct(*head, (8, statistics))))
            return head.bytes + repeated + defined + content
        with_length = lambda levels: struct.pack('<I', len(levels)) + levels
        whole = (with_length(repeated) if column.is_list else b'') + (with_length(defined) if column.defined else b'') + values
        content = PACK[self.codec](whole)
        head = Struct((1, 0), (2, len(whole)), (3, len(content)),
                      (5, Struct((1, len(entries)), (2, encoding), (3, RUNS), (4, RUNS), (5, statistics))))
        return head.bytes + content

    def dictionary_page(self, dictionary, kind):
        whole = plain(dictionary, kind)
        content = PACK[self.codec](whole)
        encoding = OLD_DICTIONARY if self.values == 'old_dictionary' else PLAIN
        return Struct((1, 2), (2, len(whole)), (3, len(content)), (7, Struct((1, len(dictionary)), (2, encoding)))).bytes + content

    def chunk(self, column, rows, at):
        """The bytes of a column's part of a row group, and what the footer says of it."""
        entries = list(column.levels(rows))
        has_dictionary = 'dictionary' in self.values
        dictionary = sorted({value for _, _, value in entries if value is not None}) if has_dictionary else []
        out = self.dictionary_page(dictionary, column.kind) if has_dictionary else b''
        data = at + len(out)
        for number, k in enumerate(range(0, len(rows), ROWS_A_PAGE)):
            out += self.page(column, rows[k:k + ROWS_A_PAGE], dictionary, number)
        words = [(1, SIZES[column.kind][0]), (2, [PLAIN, RUNS, DICTIONARY]), (3, column.path()), (4, CODECS[self.codec]),
                 (5, Long(len(entries))), (6, Long(len(out))), (7, Long(len(out))), (9, Long(data))]
        return out, Struct((2, Long(at)), (3, Struct(*words, *([(11, Long(at))] if has_dictionary else []))))


def parquet(columns, kind):
    out, groups, rows = b'PAR1', [], len(columns[0].rows)
    for first in range(0, rows, ROWS_A_GROUP):
        chunks, last = [], min(first + ROWS_A_GROUP, rows)
        for column in columns:
            content, words = kind.chunk(column, column.rows[first:last], len(out))
            out += content
            chunks.append(words)
        groups.append(Struct((1, chunks), (2, Long(0)), (3, Long(last - first))))
    schema = [Struct((3, 0), (4, 'schema'), (5, len(columns)))] + [e for column in columns for e in column.schema()]
    footer = Struct((1, 2), (2, schema), (3, Long(rows)), (4, groups), (5, [Struct((1, 'ARROW:schema'), (2, 'none'))]),
                    (6, 'page_kinds.py'), (7, [Struct((1, Struct()))] * len(columns))).bytes
    return out + footer + struct.pack('<I', len(footer)) + b'PAR1'


# Files.

def truth():
    with open(HERE / 'files/truth.csv') as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def flat(rows, **how): return [Column(name, [row[name] for row in rows], **how) for name in rows[0]]


def lists(rows, **how):
    of = lambda signal: [[row[f'{signal}1'], row[f'{signal}2']] for row in rows]
    return [Column('time', [row['t'] for row in rows], **how)] + [Column(name, of(name), **how) for name in ('q', 'dq', 'tau')]


def lerobot(rows):
    """As pyarrow writes LeRobot's tables."""
    names = {'q': 'observation.state', 'dq': 'observation.velocity', 'tau': 'observation.effort'}
    signals = [Column(name, [[row[f'{signal}1'], row[f'{signal}2']] for row in rows], 'float', True) for signal, name in names.items()]
    each = range(len(rows))
    return signals + [Column('timestamp', [k / 30 for k in each], 'float', True), Column('frame_index', list(each), 'int64', True),
                      Column('episode_index', [0 for _ in each], 'int64', True)]


def with_holes(columns):
    """Nulls at both ends: 5 rows and 2 rows."""
    for column in columns:
        if column.name.startswith('tau'):
            ends = lambda k: k < 5 or k >= len(column.rows) - 2
            hole = lambda row: [row[0], None] if column.is_list else None
            column.rows = [hole(row) if ends(k) else row for k, row in enumerate(column.rows)]
    return columns


def read_files(rows):
    layouts = {'required': lambda: flat(rows), 'nullable': lambda: flat(rows, nullable=True), 'lists': lambda: lists(rows),
               'nullable_lists': lambda: lists(rows, nullable=True), 'holes': lambda: with_holes(flat(rows, nullable=True)),
               'holes_in_lists': lambda: with_holes(lists(rows, nullable=True))}
    values = ['plain', 'dictionary', 'dictionary_then_plain', 'old_dictionary', 'apart']
    for layout, version, value, codec in itertools.product(layouts, (1, 2), values, CODECS):
        yield f'{layout}_v{version}_{value}_{codec}', parquet(layouts[layout](), Kind(version, value, codec))
    stamps = lambda: [Column('t', [round(1e6 * row['t']) for row in rows], 'int64', True, 10)] + flat(rows)[1:]
    for version, codec in itertools.product((1, 2), CODECS):
        # only whole numbers are stored by their differences
        class Mixed(Kind):
            def encoded(self, numbers, kind, dictionary, page):
                return super().encoded(numbers, kind, dictionary, page) if kind == 'int64' else (PLAIN, plain(numbers, kind))
        yield f'stamps_v{version}_delta_{codec}', parquet(stamps(), Mixed(version, 'delta', codec))
        yield f'lerobot_v{version}_{codec}', parquet(lerobot(rows), Kind(version, 'dictionary', codec))


def refused_files(rows):
    """With the words that the message has to have."""
    for number, name in {4: 'BIT_PACKED', 6: 'DELTA_LENGTH_BYTE_ARRAY', 7: 'DELTA_BYTE_ARRAY', 11: '11'}.items():
        class Other(Kind):
            def encoded(self, numbers, kind, dictionary, page):
                return number, plain(numbers, kind)
        yield f'encoding_{number}', parquet(flat(rows), Other()), f'encoding that is not read ({name})'
    for number, name in {3: 'LZO', 4: 'brotli', 5: 'Hadoop', 8: 'newer than this reader'}.items():
        CODECS['other'], PACK['other'] = number, bytes
        yield f'codec_{number}', parquet(flat(rows), Kind(codec='other')), name

    class OldLevels(Kind):
        def page(self, column, rows, dictionary, number):
            # the head's third number, 3 for runs, becomes 4
            return super().page(column, rows, dictionary, number).replace(b'\x15\x06\x15\x06', b'\x15\x08\x15\x08', 1)
    yield 'levels', parquet(flat(rows, nullable=True), OldLevels()), 'levels in an encoding of old'


def compared(folder):
    """How many files each test says that it compared: none if it was skipped or the filter matched nothing."""
    suites = json.loads((folder / 'results.json').read_text())['testsuites']
    return {test['name']: int(test.get('files', 0)) for suite in suites for test in suite['testsuite']}


def main():
    rows = truth()
    with tempfile.TemporaryDirectory() as name:
        folder, to_read, to_refuse = pathlib.Path(name), 0, 0
        (folder / 'refused').mkdir()
        for file, content in read_files(rows):
            (folder / f'{file}.parquet').write_bytes(content)
            to_read += 1
        for file, content, words in refused_files(rows):
            (folder / f'refused/{file}.parquet').write_bytes(content)
            (folder / f'refused/{file}.txt').write_text(words)
            to_refuse += 1
        result = subprocess.run([sys.argv[1], '--gtest_filter=PageKinds.*', '--gtest_brief=1', f'--gtest_output=json:{name}/results.json'],
                                env=dict(os.environ, FXDYN_PAGE_KINDS=name)).returncode
        expected, got = {'EveryNumberIsTheWritersOwn': to_read, 'WhatIsNotReadIsNamed': to_refuse}, compared(folder)
        print(f'{to_read} files were written to be read, {to_refuse} to be refused; compared: {got}')
        if 0 in expected.values() or got != expected:
            print('FAILED: not every file was compared')
            return 1
        return result


if __name__ == '__main__':
    sys.exit(main())
