#!/usr/bin/env python3
"""How many files are compiled in a build directory, from what ninja knows of it.

  compiled.py BUILD for TARGET   for a target, from nothing
  compiled.py BUILD after FILE   after a change of a source or a header, by folder
"""
import collections
import pathlib
import re
import subprocess
import sys


def ninja(build, *arguments):
    return subprocess.run(['ninja', '-C', build, *arguments], check=True, capture_output=True, text=True).stdout


def for_target(commands):
    """Compiles in the output of `ninja -t commands`."""
    return len(re.findall(r' -c \S+$', commands, re.M))


def after_change(deps, file):
    """Objects by their folder, of those that depend on a file in the output of `ninja -t deps`."""
    out = collections.Counter()
    for block in deps.split('\n\n'):
        head, *needs = block.strip().split('\n')
        if any(need.strip().endswith('/' + file) for need in needs):
            out[head.split('/')[0]] += 1
    return out


def main():
    if len(sys.argv) != 4 or sys.argv[2] not in ('for', 'after'):
        sys.exit(__doc__.strip())
    build, what, name = sys.argv[1:]
    if what == 'for':
        print(f'{name}: {for_target(ninja(build, "-t", "commands", name))} files')
        return
    if not pathlib.Path(name).is_file():
        sys.exit(f'compiled.py: no such file: {name}')
    counts = after_change(ninja(build, '-t', 'deps'), name)
    parts = ', '.join(f'{folder} {count}' for folder, count in sorted(counts.items()))
    print(f'{name}: {sum(counts.values())} files ({parts})')


if __name__ == '__main__':
    main()
