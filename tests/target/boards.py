#!/usr/bin/env python3
"""boards.py [ROOT]: what a board of toolchains/boards.txt has to bring: its preset in CMakePresets.json, its folder in hal/ with a
startup.cpp, its linker script, the mains of its images, and a row of firmware/budget.csv for what is measured."""
import json
import pathlib
import sys

COLUMNS = ('board', 'preset', 'folder', 'processor', 'linker_script', 'openocd', 'tests')
TESTS = {'golden': 'golden', 'kernels': 'rnea', 'node': 'node', 'node_built': 'node'}  # and the image of its row in the budget


def boards_of(root):
    for line in (root / 'toolchains/boards.txt').read_text().splitlines():
        if line[:1].islower():
            fields = line.split()
            board = dict(zip(COLUMNS, fields))
            yield board | {'tests': board['tests'].split(','), 'mains': [f.split('=')[1].split(',')[0] for f in fields[7:]]}


def presets_of(root):
    """name -> FXDYN_CPU, of those that can be configured and built"""
    content = json.loads((root / 'CMakePresets.json').read_text())
    built = {p['configurePreset'] for p in content['buildPresets']}
    return {p['name']: p['cacheVariables']['FXDYN_CPU'] for p in content['configurePresets']
            if 'FXDYN_CPU' in p.get('cacheVariables', {}) and p['name'] in built}


def complaints(root):
    boards, presets = list(boards_of(root)), presets_of(root)
    rows = {tuple(line.split(',')[1:3]) for line in (root / 'firmware/budget.csv').read_text().splitlines()}
    lines = []
    for b in boards:
        name, preset = b['board'], b['preset']
        if presets.get(preset) != preset:
            entry = json.dumps({'name': preset, 'inherits': 'arm', 'cacheVariables': {'FXDYN_CPU': preset}})
            lines.append(f'CMakePresets.json: add to configurePresets {entry} and a build preset for it ({name})')
        files = [f'hal/{b["folder"]}/startup.cpp', f'toolchains/linker/{b["linker_script"]}']
        files += [f'firmware/{main}' for main in b['mains']]
        lines += [f'{file}: missing, {name} needs it' for file in files if not (root / file).exists()]
        lines += [f'toolchains/boards.txt: {name}: no test "{test}"; known: {", ".join(TESTS)}' for test in b['tests'] if test not in TESTS]
        lines += [f'firmware/budget.csv: no row for {name}, {TESTS[test]}: tests/target/budget.sh adds it'
                  for test in b['tests'] if test in TESTS and (name, TESTS[test]) not in rows]
    known = {b['preset'] for b in boards}
    return lines + [f'CMakePresets.json: {name} is no preset of toolchains/boards.txt' for name in presets if name not in known]


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2])
    lines = complaints(root)
    print('\n'.join(lines) or f'{len(list(boards_of(root)))} boards, nothing missing')
    return 1 if lines else 0


if __name__ == '__main__':
    sys.exit(main())
