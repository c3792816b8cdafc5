#!/usr/bin/env python3
"""commands_test.py FXDYN: the commands on the pages name what there is. Every `fxdyn VERB` is a verb and its options are options of
it; every script and file of the tree that a command names exists; every preset and every target of `cmake --build --preset host` too.
That they do what the page says is for other tests: tutorial, logs of other makers, and those of each verb."""
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'toolchains/site'))
from pages import Page  # noqa: E402: after its path is known

import docs

FOLDERS = ('toolchains', 'tests', 'host_tools', 'firmware', 'hal', 'model')
SHELLS = ('', 'sh', 'bash')


def commands_of(page):
    """(line, command) of each line in a block of code, continued lines joined, comments gone."""
    language, joined, start = None, '', 0
    for number, line in enumerate(page.lines, 1):
        fence = re.match(r'^\s*```(\w*)', line)
        if fence:
            language = None if language is not None else fence[1]
            continue
        indented = line.startswith('    ') and not dict(page.prose)[number]
        if not (language in SHELLS or (language is None and indented)):
            continue
        start = start if joined else number
        joined += re.sub(r'\s#\s.*', '', ' ' + line).rstrip()
        if joined.endswith('\\'):
            joined = joined[:-1]
            continue
        if joined.strip():
            yield start, joined.strip()
        joined = ''


class Program:
    def __init__(self, path):
        self.path, self.known = path, {}
        self.of_all = subprocess.run([path, '--help'], capture_output=True, text=True).stdout

    def help_of(self, verb):
        if verb not in self.known:
            done = subprocess.run([self.path, verb, '--help'], capture_output=True, text=True)
            # Without such a verb the help is that of the program.
            self.known[verb] = done.stdout if done.returncode == 0 and done.stdout != self.of_all else None
        return self.known[verb]


def wrong_in(command, program, presets):
    for use in re.finditer(r'(?:^|[;&|(]\s*)(?:[\w./$-]*/)?fxdyn ([a-z_]+)([^;&|#]*)', command):
        said = program.help_of(use[1])
        if said is None:
            yield f'"fxdyn {use[1]}": no such verb'
            continue
        for option in re.findall(r'(?<=[\s\[])--[a-z-]+', use[2]):
            if not re.search(rf'{option}\b(?!-)', said):
                yield f'"fxdyn {use[1]} {option}": no such option'
    for path in re.findall(rf'(?<![\w/])(?:\$(?:FXDYN|PWD)/)?((?:{"|".join(FOLDERS)})/[\w./-]+)', command):
        if not (ROOT / path.rstrip('.')).exists():
            yield f'"{path}": no such file'
    for preset in re.findall(r'--preset ([\w-]+)', command) + re.findall(r'configure\.sh ([\w-]+)', command):
        if preset not in presets:
            yield f'"--preset {preset}": no such preset'


def main():
    program = Program(pathlib.Path(sys.argv[1]).resolve())
    presets = {preset['name'] for preset in json.loads((ROOT / 'CMakePresets.json').read_text())['configurePresets']}
    failures, count = [], 0
    for page in docs.user_pages(ROOT):
        for line, command in commands_of(page):
            count += 1
            failures += [f'{page.name}:{line}: {wrong}' for wrong in wrong_in(command, program, presets)]
    # The script itself: what is wrong must be found.
    for command in ('fxdyn nosuchverb x', 'fxdyn run p.toml --nosuch', 'toolchains/nosuch.sh', 'cmake --preset nosuch'):
        if not list(wrong_in(command, program, presets)):
            failures.append(f'this test does not see what is wrong with "{command}"')
    print('\n'.join(failures) or f'{count} lines of commands')
    return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
