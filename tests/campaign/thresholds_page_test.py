#!/usr/bin/env python3
"""docs/findings/thresholds.md names every threshold of the diagnosis, and none that does not exist.

thresholds_page_test.py [ROOT]    prints what is missing and what is not there
"""
import pathlib
import re
import sys
import unittest

PAGE = 'docs/findings/thresholds.md'
OPTIONS = 'host_tools/diagnose/options.hpp'


def thresholds_of(header):
    """Names PART.MEMBER of all thresholds in Options."""
    members = {}
    for struct, body in re.findall(r'^struct (\w+) \{\n(.*?)^\};', header, re.M | re.S):
        declared = re.findall(r'^  (?:double|int|std::size_t) ([^;(]*);', body, re.M)
        members[struct] = [name for line in declared for name in re.findall(r'(\w+) *= *[^,]+', line)]
    parts = re.findall(r'^  (\w+Options) (\w+);', header, re.M)
    return {f'{part}.{name}' for struct, part in parts for name in members[struct]}


def names_in(page, parts):
    """Names PART.MEMBER that a page has in backticks or in a table's first column."""
    names = re.findall(r'`([a-z_]+\.[a-z_]+)`', page) + re.findall(r'^\| ([a-z_]+\.[a-z_]+) \|', page, re.M)
    return {name for name in names if name.split('.')[0] in parts}


def complaints(header, page):
    known = thresholds_of(header)
    parts = {name.split('.')[0] for name in known}
    gone = {name for line in re.findall(r'^- \*\*Removed\*\*.*', page, re.M) for name in names_in(line, parts)}
    named = names_in(page, parts)
    out = [f'{PAGE}: {name} is not there: say what it decides' for name in sorted(known - named)]
    out += [f'{PAGE}: {name} is in no Options: take it out' for name in sorted(named - known - gone)]
    out += [f'{PAGE}: {name} is called removed, but Options have it' for name in sorted(gone & known)]
    return out


HEADER = '''struct GateOptions {
  /// share; what it is; hand
  double least = 0.5, most = 2;
};
struct Options {
  GateOptions gate;
};
'''


class Complaints(unittest.TestCase):
    def test_all_are_named(self):
        self.assertEqual(complaints(HEADER, 'text `gate.least`\n| gate.most | 2 |\nof `other.name`'), [])

    def test_one_is_missing(self):
        self.assertEqual(len(complaints(HEADER, '| gate.most | 2 |')), 1)

    def test_one_is_not_there(self):
        self.assertIn('gate.old is in no Options', complaints(HEADER, '`gate.least` `gate.most` `gate.old`')[0])

    def test_removed_ones_may_be_named(self):
        page = '`gate.least` `gate.most` `gate.old`\n- **Removed**: `gate.old`\n'
        self.assertEqual(complaints(HEADER, page), [])
        self.assertIn('called removed', complaints(HEADER, '`gate.most`\n- **Removed**: `gate.least`')[0])


if __name__ == '__main__':
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[2])
    result = unittest.main(argv=sys.argv[:1], exit=False).result
    found = complaints((root / OPTIONS).read_text(), (root / PAGE).read_text())
    print('\n'.join(found))
    sys.exit(1 if found or not result.wasSuccessful() else 0)
