#!/usr/bin/env python3
"""export_to_test.py FXDYN: a simulated arm, from its logs to the files of simulators and their certificates."""
import json
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

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


VISCOUS, COULOMB = [1.5, 0.6], [3.0, 1.0]
SCENARIO = f'''seed = 3
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
parameters = {{ coefficient = {VISCOUS} }}
[[effect]]
name = "coulomb"
joint = "all"
parameters = {{ amplitude = {COULOMB}, width = 0.02 }}
[[log]]
name = "a"
duration_s = 8
period_s = 4
seed = 3
'''
PROJECT = '''[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
[[log]]
file = "logs/a.csv"
role = "train"
to_s = 5.9
[[log]]
file = "logs/a.csv"
role = "{other}"
from_s = 6
[train]
enabled = false
'''
with tempfile.TemporaryDirectory() as name:
    work = pathlib.Path(name)
    (work / 'arm.urdf').write_text((root / 'tests/support/elastic_arm/arm.urdf').read_text())
    (work / 'scenario.toml').write_text(SCENARIO)
    run('simulate', work / 'scenario.toml', '--out', work / 'logs')
    project, out = work / 'arm.toml', work / 'out'
    project.write_text(PROJECT.format(other='test'))
    said = run('export', '--to', 'urdf,mjcf,sdf', project, '--out', out).stdout
    check(not (out / 'tables.bin').exists(), 'no tables are written')
    # what was identified: how near that is to what was simulated is for the tests of identify
    fits = [{e['effect']: e['parameters'] for e in j['effects']} for j in json.loads((out / 'model.json').read_text())['joints']]
    value = lambda joint, effect, name: next(p['value'] for p in fits[joint][effect] if p['name'] == name)
    for form, file in ('urdf', 'simulator.urdf'), ('mjcf', 'simulator.xml'), ('sdf', 'simulator.sdf'):
        certificate = json.loads((out / f'certificate_{form}.json').read_text())
        check(certificate['as_meant'] and certificate['role'] == 'test', f'{form}: {certificate}')
        tree = xml.parse(out / file)
        check(file in said, f'{file} on the terminal')
        for i, joint in enumerate(certificate['joints']):
            check(f'{joint["joint"]} ' in said and f'{joint["cannot_say"]:.4g}' in said, f'{form}: a line for {joint["joint"]}')
            found = tree.find(f".//joint[@name='{joint['joint']}']")
            if form == 'sdf':
                dynamics = found.find('axis/dynamics')
                damping, dry = dynamics.findtext('damping'), dynamics.findtext('friction')
            else:
                found = found.find('dynamics') if form == 'urdf' else found
                damping, dry = found.get('damping'), found.get('friction' if form == 'urdf' else 'frictionloss')
            # Damping and dry friction share what the file can't say, so neither is the model's alone; their torque is.
            for speed in (0.5, 1.0):
                torque = float(damping) * speed + float(dry)
                model = value(i, 'viscous', 'coefficient') * speed + value(i, 'coulomb', 'amplitude')
                check(abs(torque - model) < 0.03 * model, f'{form}: friction at {speed} rad/s {torque}, model {model}')
            check(joint['file_rmse'] >= joint['model_rmse'] * 0.9, f'{form}: {joint}')
            check(joint['cannot_say'] < COULOMB[i], f'{form}: {joint}')
    first = (out / 'simulator.xml').read_bytes()
    run('export', project, '--out', out, '--to', 'mjcf')
    check((out / 'simulator.xml').read_bytes() == first, 'the same bytes again')

    project.write_text(PROJECT.format(other='baseline'))
    done = run('export', project, '--out', out, '--to', 'mjcf', code=2)
    check('no held-out log' in done.stderr and done.stderr.count('\n') == 1, done.stderr)
sys.exit(bool(failed))
