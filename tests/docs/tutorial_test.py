#!/usr/bin/env python3
"""tutorial_test.py FXDYN WORK: runs the commands of docs/guide/tutorial.md in their order, as a reader would, results in WORK; and
compares what came out with the figures and the words that the page promises. Blocks after `<!-- test: not run` are left out: they build the
program that runs this test."""
import json
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs/guide/tutorial.md'


def number(text):
    return float(text.split()[0])


def rows_after(page, line):
    """Cells of the first row of the table after a line, and of its further ones."""
    table = page.split(line, 1)[1].lstrip().split('\n\n', 1)[0]
    return [[cell.strip() for cell in row.strip('|').split('|')] for row in table.split('\n')[2:]]


def close(written, measured):
    """The page's figure has three digits."""
    return abs(written - measured) <= 0.006 * abs(written)


def figures_that_differ(page, out):
    metrics = json.loads((out / 'metrics.json').read_text())
    rmse = {}
    for stage in metrics['stages']:
        for log in stage['logs']:
            if log['role'] == 'test':
                rmse[stage['stage']] = log['joints'][0]['rmse']
    written = [number(cell) for cell in rows_after(page, '<!-- test: row joint_1 -->')[0]]
    for stage, figure in zip(('rigid', 'friction', 'diagnosed'), written):
        if not close(figure, rmse[stage]):
            yield f'RMSE of {stage} is {rmse[stage]:.4g}, the page says {figure}'
    diagnosis = json.loads((out / 'diagnosis.json').read_text())
    if diagnosis['verdict'] != 'explained':
        yield f"the verdict is {diagnosis['verdict']}"
    found = {}
    for joint in diagnosis['joints']:
        names = sorted(effect['effect'] for effect in joint['effects'])
        if names != ['presliding', 'stribeck']:
            yield f"{joint['joint']} has {names}"
        if joint['index'] == 1:
            found = {f"{effect['effect']} {p['name']}": p['value'] for effect in joint['effects'] for p in effect['parameters']}
    for name, value, _ in rows_after(page, 'The simulated robot knows the truth. Compare:'):
        key = name.replace('Stribeck', 'stribeck')
        if key not in found or not close(number(value), found[key]):
            yield f'{name} is {found.get(key)}, the page says {value}'


def main():
    program, work = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    shutil.rmtree(work, ignore_errors=True)
    page = PAGE.read_text()
    run = re.sub(r'^<!-- test: not run.*?-->\n```sh\n.*?^```', '', page, flags=re.M | re.S)
    blocks = re.findall(r'^```sh\n(.*?)^```', run, flags=re.M | re.S)
    script = '\n'.join(blocks).replace('out/tutorial', str(work)).replace('$PWD/build/host/host_tools/cli', str(program.parent))
    done = subprocess.run(['bash', '-euxo', 'pipefail', '-c', script], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        print(done.stdout[-3000:], done.stderr[-3000:])
        return 1
    failures = []
    for words in ('about 10 times too small', 'time_unit = "ms"   # by the steps', 'nothing looks wrong in these logs'):
        if words not in done.stdout + done.stderr:
            failures.append(f'nothing says "{words}"')
    replay = json.loads((work / 'out/replay.json').read_text())
    if not replay['bit_exact'] or not replay['logs']:
        failures.append('the firmware is not the host, bit for bit')
    written = float(re.search(r'takes about (\d+) instructions', page)[1])
    measured = replay['logs'][0]['instructions_per_tick']['most']
    if abs(measured - written) > 0.05 * written:  # the compiler's and the kernels' may change a little
        failures.append(f'a tick takes {measured} instructions, the page says {written:.0f}')
    failures += figures_that_differ(page, work / 'out')
    print('\n'.join(failures) or 'the tutorial does what it says')
    return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
