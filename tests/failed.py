#!/usr/bin/env python3
"""failed.py BUILD_FOLDER: the last lines of each test that failed in the last run of ctest there.

A run of all tests prints for more than an hour: what failed is shown once more where one looks, at its end.
"""
import pathlib
import re
import sys

LINES = 20  # of each test
BEGIN = re.compile(r'\d+/\d+ Test: (.*)')


def failed(log):
    """Name and last lines of each test that failed, in the lines of a LastTest.log."""
    name, output, within, missing, out = None, [], False, None, []
    for line in log:
        if not within and (begin := BEGIN.fullmatch(line)):
            name, output = begin.group(1), []
            if missing:
                out.append((name, [missing]))
            missing = None
        elif not within and line == 'Output:':
            within = True
        elif line.endswith('<end of output>'):
            within = False
        elif within:
            output.append(line)
        elif line.startswith('Unable to find executable'):
            missing = line  # of the test that begins next
        elif line == 'Test Failed.':
            out.append((name, output[1:][-LINES:]))  # the first line is a rule
    return out


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    log = pathlib.Path(sys.argv[1]) / 'Testing/Temporary/LastTest.log'
    for name, lines in failed(log.read_text(errors='replace').splitlines()):
        print('\n'.join(['', f'--- failed: {name}', *lines]))


if __name__ == '__main__':
    main()
