#!/usr/bin/env python3
"""history_test.py FXDYN: eight sessions of an arm whose friction grows at joint 2, simulated and identified."""
import json
import pathlib
import subprocess
import sys
import tempfile

fxdyn = pathlib.Path(sys.argv[1]).resolve()
root = pathlib.Path(__file__).resolve().parents[2]
failed = []


def check(condition, what):
    if not condition:
        failed.append(what)
        print('FAILED:', what)


def run(*words, code=0):
    done = subprocess.run([str(fxdyn), *map(str, words)], capture_output=True, text=True)
    check(done.returncode == code, f'{" ".join(map(str, words))}: exit code {done.returncode}: {done.stderr.strip()}')
    return done


SCENARIO = '''seed = {seed}
[sensors]
encoder_bits = 20
torque_noise = 0.005
[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
acceleration = [8, 8]
[[effect]]
name = "viscous"
joint = "all"
parameters = {{ coefficient = [1.5, 0.6] }}
[[effect]]
name = "coulomb"
joint = "all"
parameters = {{ amplitude = [3.0, {coulomb}], width = 0.02 }}
[[log]]
name = "a"
duration_s = 8
period_s = 4
seed = {seed}
'''
PROJECT = '''[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
[[log]]
file = "{log}/a.csv"
role = "train"
to_s = 5.9
[[log]]
file = "{log}/a.csv"
role = "test"
from_s = 6
'''
with tempfile.TemporaryDirectory() as name:
    work = pathlib.Path(name)
    (work / 'arm.urdf').write_text((root / 'tests/support/elastic_arm/arm.urdf').read_text())
    folders = []
    for i in range(8):
        day = f'2026-0{i + 1}-15'
        (work / 'scenario.toml').write_text(SCENARIO.format(seed=i + 1, coulomb=1.0 + 0.05 * i))
        run('simulate', work / 'scenario.toml', '--out', work / f'logs{i}')
        (work / f'{i}.toml').write_text(PROJECT.format(log=f'logs{i}'))
        folders.append(work / 'out' / day)
        run('identify', work / f'{i}.toml', '--out', folders[-1])
    friction = 'coulomb amplitude'
    joints = [j['joint'] for j in json.loads((folders[0] / 'metrics.json').read_text())['logs'][0]['joints']]
    said = run('history', *reversed(folders), '--out', work / 'history', '--limit', f'{joints[1]} {friction}=1.6').stdout
    page = (work / 'history/history.html').read_text()
    result = json.loads((work / 'history/history.json').read_text())
    check([s['date'] for s in result['sessions']][::7] == ['2026-01-15', '2026-08-15'], 'sessions are in the order of days')
    changing = [s for s in result['series'] if s['changes']]
    check([(s['joint'], s['quantity']) for s in changing] == [(joints[1], friction)], f'what changes: {changing}')
    if changing:
        drift = changing[0]
        # 0.05 a month, 0.35 in the 212 days between the first and the last; 1.6 is reached 12 months after the first
        slope = drift['course']['slope'] * 212
        check(abs(slope - 0.35) < 0.035, f'slope {slope}')
        reached = drift['limit_reached']
        days = reached['at'] - drift['values'][0]['at']
        check(abs(days - 364) < 30, f'limit reached after {days} days')
        check(reached['earliest'] <= reached['at'] <= reached['latest'], f'interval {reached}')
        check(drift['sentence'] in said and drift['sentence'] in page, 'the sentence is on the terminal and on the page')
    check('<svg' in page and 'http' not in page.replace('http://www.w3.org', ''), 'pictures, and nothing from elsewhere')
    again = work / 'again'
    run('history', *folders, '--out', again, '--limit', f'{joints[1]} {friction}=1.6')
    check((again / 'history.html').read_text() == page, 'the order of the folders changes nothing')

    run('history', folders[0], '--out', again, code=2)
    run('history', folders[0], work, '--out', again, code=2)
    done = run('history', *folders, '--out', again, '--limit', 'elbow friction', code=2)
    check('--limit elbow friction: expected' in done.stderr, done.stderr)
sys.exit(bool(failed))
