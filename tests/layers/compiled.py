#!/usr/bin/env python3
"""How many files are compiled: from what ninja knows of a build directory, or from the includes alone.

  compiled.py BUILD for TARGET   for a target, from nothing
  compiled.py BUILD after FILE   after a change of a source or a header, by folder; of a build directory in which all is built
  compiled.py includes FILE      the same of host_tools, from the includes: no build is needed
  compiled.py BUILD goals        fails where a goal of docs/findings/2026-11-26-layers.md is missed
"""
import collections
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = re.compile(r'^\s*#\s*include "([^"]+)"', re.M)
LOG_TESTS, MOST_FOR_LOG_TESTS = 'logs_test', 20
MODEL, MOST_AFTER_MODEL = 'host_tools/effects/identified_model.hpp', 60
CATALOGUE, MOST_AFTER_EFFECT = 'model/catalogue.hpp', 30  # it includes each effect


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


def includes_of(root):
    """file -> what it includes, of all that is compiled for the host's tools"""
    out = {}
    for folder in ('host_tools', 'model', 'hal', 'firmware'):
        for path in (root / folder).rglob('*.[ch]pp'):
            text = re.sub(r'R"\((.*?)\)"', '', path.read_text(), flags=re.S)  # what is written into generated files
            out[str(path.relative_to(root))] = INCLUDE.findall(text)
    return out


def sources_with(includes, file):
    """Sources of host_tools that read a file, themselves or through headers."""
    users = collections.defaultdict(set)
    for one, included in includes.items():
        for other in included:
            users[other].add(one)
    seen, todo = {file}, [file]
    while todo:
        for user in users[todo.pop()] - seen:
            seen.add(user)
            todo.append(user)
    return sorted(one for one in seen if one.startswith('host_tools/') and one.endswith('.cpp'))


def misses(counts):
    """Lines, one for each (what, count, goal) that is missed."""
    return [f'{what}: {count} files, more than {goal}' for what, count, goal in counts if count > goal]


def goals(build):
    includes = includes_of(ROOT)
    effects = [name for name in includes[CATALOGUE] if name.startswith('model/effects/')]
    counts = [(LOG_TESTS, for_target(ninja(build, '-t', 'commands', LOG_TESTS)), MOST_FOR_LOG_TESTS),
              (MODEL, len(sources_with(includes, MODEL)), MOST_AFTER_MODEL)]
    counts += [(name, len(sources_with(includes, name)), MOST_AFTER_EFFECT) for name in effects]
    lines = misses(counts)
    print('\n'.join(lines) or '\n'.join(f'{what}: {count} of {goal} files' for what, count, goal in counts))
    return 1 if lines else 0


def main():
    words = sys.argv[1:]
    if len(words) == 2 and words[1] == 'goals':
        return goals(words[0])
    if len(words) == 3 and words[1] == 'for':
        print(f'{words[2]}: {for_target(ninja(words[0], "-t", "commands", words[2]))} files')
        return 0
    if not (len(words) == 2 and words[0] == 'includes' or len(words) == 3 and words[1] == 'after'):
        sys.exit(__doc__.strip())
    name = words[-1]
    if not (ROOT / name).is_file():
        sys.exit(f'compiled.py: no such file: {name}')
    if words[0] == 'includes':
        print(f'{name}: {len(sources_with(includes_of(ROOT), name))} files of host_tools')
        return 0
    counts = after_change(ninja(words[0], '-t', 'deps'), name)
    parts = ', '.join(f'{folder} {count}' for folder, count in sorted(counts.items()))
    print(f'{name}: {sum(counts.values())} files ({parts})')
    return 0


if __name__ == '__main__':
    sys.exit(main())
