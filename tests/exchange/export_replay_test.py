#!/usr/bin/env python3
"""export_replay_test.py FXDYN: a simulated arm whose spring no simulator's joint can say, from its logs to the formats
without a library here. robot_replay.py reads the files and replays the held-out log: the loss is the certificate's, and
errors of sign, unit and side of the gear in the files are seen. Then a trajectory with its torque, as it is."""
import csv
import json
import math
import pathlib
import random
import re
import subprocess
import sys
import tempfile

import robot_replay as replay

fxdyn = pathlib.Path(sys.argv[1]).resolve()
root = pathlib.Path(__file__).resolve().parents[2]
failed = []


def check(condition, what):
    if not condition:
        failed.append(what)
        print('FAILED:', what)


def run(*words):
    done = subprocess.run([str(fxdyn), *map(str, words)], capture_output=True, text=True)
    check(done.returncode == 0, f'{" ".join(map(str, words))}: exit code {done.returncode}: {done.stderr.strip()}')
    return done.stdout


VISCOUS, COULOMB, ROTOR, SPRING = [1.5, 0.6], [3.0, 1.0], 0.12, 12.0
HELD_OUT_S, END_S, JOINTS = 8, 16, ('shoulder', 'elbow')
SCENARIO = f'''seed = 3
[sensors]
exact_motion = true
torque_noise = 0.002
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
parameters = {{ amplitude = {COULOMB}, width = 0.005 }}
[[effect]]
name = "rotor_inertia"
joint = 2
parameters = {{ inertia = {ROTOR} }}
[[effect]]
name = "spring"
joint = 2
parameters = {{ stiffness = {SPRING}, offset = 0 }}
[[log]]
name = "a"
duration_s = {END_S}
period_s = 4
seed = 3
'''
PROJECT = f'''[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
[[log]]
file = "logs/a.csv"
role = "train"
to_s = {HELD_OUT_S - 0.1}
[[log]]
file = "logs/a.csv"
role = "test"
from_s = {HELD_OUT_S}
[check]
columns = false
[train]
enabled = false
'''


class Replay:
    """The held-out log through a file: RMS of true torque minus the file's, joint by joint [N m]."""

    def __init__(self, work, every=2):
        edge = json.loads((work / 'out/model.json').read_text())['filter']['edge_s']  # the certificate drops it, too
        self.log = [row for row in replay.rows(work / 'logs/a.csv') if HELD_OUT_S + edge <= row['t'] < END_S - edge][::every]
        truth = {row['t']: row for row in replay.rows(work / 'logs/a.truth.csv')}
        self.tau = [[truth[row['t']][f'tau{j}'] for row in self.log] for j in (1, 2)]

    def bodies(self, urdf):
        """With and without the acceleration."""
        chain = replay.Chain(urdf)
        columns = lambda row, name: [row[f'{name}1'], row[f'{name}2']]
        return [[chain.torque(columns(row, 'q'), columns(row, 'dq'), ddq) for ddq in (columns(row, 'ddq'), [0, 0])]
                for row in self.log]

    def torques(self, bodies, joints):
        return [[body[j] + torque(row[f'dq{j + 1}'], row[f'ddq{j + 1}'], body[j], still[j])
                 for row, (body, still) in zip(self.log, bodies)] for j, torque in enumerate(joints)]

    @staticmethod
    def rms(some, others):
        return [math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)) / len(a)) for a, b in zip(some, others)]

    def loss(self, torques):
        return self.rms(self.tau, torques)

    def loss_in_motion(self, torques, least):
        """Without what is lost where a joint is slower than that [rad/s]."""
        kept = [[x if abs(row[f'dq{j}']) > w else y for row, x, y in zip(self.log, of, true)]
                for j, (of, true, w) in enumerate(zip(torques, self.tau, least), 1)]
        return self.loss(kept)


READERS = {
    'drake': ('simulator_drake.urdf', lambda path: [replay.drake_joint(path, j) for j in JOINTS]),
    'isaaclab': ('simulator_isaaclab.py', lambda path: (lambda names: [replay.isaaclab_joint(names, j) for j in JOINTS])(replay.run_python(path))),
    'mjlab': ('simulator_isaaclab.py', lambda path: (lambda names: [replay.mjlab_joint(names, j) for j in JOINTS])(replay.run_python(path))),
    'bam': ('simulator_bam.json', lambda path: [replay.bam_joint(path, j) for j in JOINTS]),
    'usd': ('simulator_usd.usda', lambda path: [replay.usd_joint(path, j) for j in JOINTS]),
}
# what stands before the elbow's numbers: viscous and dry friction, rotor
PLACES = {
    'drake': (r'<joint name="elbow".*?damping="', r'<actuator name="elbow">.*?rotor_inertia value="'),
    'isaaclab': (r'\nVISCOUS_FRICTION = .*?"elbow":', r'\nFRICTION = .*?"elbow":', r'\nARMATURE = .*?"elbow":'),
    'bam': (r'"elbow".*?"friction_viscous": ', r'"elbow".*?"friction_base": ', r'"elbow".*?"armature": '),
    'usd': (r'over "elbow".*?viscousFrictionCoefficient = ', r'over "elbow".*?dynamicFrictionEffort = ',
            r'over "elbow".*?armature = '),
}
PLACES['mjlab'] = PLACES['isaaclab']
ERRORS = {'another sign': lambda x: -x, '57.3 times': math.degrees, 'a 57.3th': math.radians,
          'at the motor': lambda x: x / 50, 'at the motor, squared': lambda x: x / 2500}


def changed(path, place, how):
    """The file with one number changed, under another name."""
    text = path.read_text()
    found = re.search('(%s)([-+.0-9e]+)' % place, text, re.S)
    other = path.with_name('changed' + path.suffix)
    other.write_text(text[:found.start(2)] + repr(how(float(found.group(2)))) + text[found.end(2):])
    return other


def read_or_refused(log, bodies, read, path):
    try:
        return log.torques(bodies, read(path))
    except AssertionError:  # what the format's own rules exclude
        return None


def check_format(form, out, log):
    name, read = READERS[form]
    path = out / name
    certificate = json.loads((out / f'certificate_{"isaaclab" if form == "mjlab" else form}.json').read_text())
    check(certificate['as_meant'] and certificate['read_back_by'] == 'fxdyn itself', f'{form}: {certificate}')
    bodies = log.bodies(path.with_suffix('.urdf'))
    loss = log.loss(log.torques(bodies, read(path)))
    check('spring' in certificate['joints'][1]['left_out'], f'{form}: the spring is left out')
    check(loss[1] > 1, f'{form}: the spring has a torque')
    # The certificate is below the torque's cut-off, and the log has noise: 3 %.
    said = certificate['joints'][1]['cannot_say']
    check(abs(loss[1] - said) < 0.03 * said, f'{form}: {loss[1]} N m are lost, the certificate says {said}')
    for place in PLACES[form]:
        for what, how in ERRORS.items():
            torque = read_or_refused(log, bodies, read, changed(path, place, how))
            wrong = math.inf if torque is None else log.loss(torque)[1]
            check(abs(wrong - loss[1]) > 0.005 * loss[1], f'{form}: {place} {what} shows: {wrong}')


def effect(name, joint, **parameters):
    values = ', '.join(f'{key} = {value}' for key, value in parameters.items())
    return f'[[effect]]\nname = "{name}"\njoint = {joint}\nparameters = {{ {values} }}\n'


# BAM's models of shoulder and elbow, and what makes them: Stribeck friction (amplitude, velocity) and load friction of
# each joint, accelerations, axes of both joints.
LOADED = {
    ('m1', 'm5'): ({}, {2: 0.2}, [8, 8], '0 1 0'),
    # hardly any gravity: acceleration makes most of the load
    ('m2', 'm3'): ({1: (1.5, 0.2)}, {2: 0.2}, [30, 40], '0 0.2 0.98'),
    ('m4', 'm4'): ({1: (1.5, 0.2), 2: (0.6, 0.3)}, {1: 0.2, 2: 0.2}, [30, 40], '0 0.2 0.98'),
    ('m6', 'm5'): ({1: (2.0, 0.4), 2: (1.0, 0.4)}, {1: 0.3, 2: 0.4}, [8, 8], '0 1 0'),
}


def loaded_project(work, stribeck, load, acceleration, axis):
    work.mkdir()
    urdf = (root / 'tests/support/elastic_arm/arm.urdf').read_text()
    assert urdf.count('axis xyz="0 1 0"') == 2
    (work / 'arm.urdf').write_text(urdf.replace('axis xyz="0 1 0"', f'axis xyz="{axis}"'))
    spring = f'[[effect]]\nname = "spring"\njoint = 2\nparameters = {{ stiffness = {SPRING}, offset = 0 }}\n'
    assert spring in SCENARIO and 'acceleration = [8, 8]' in SCENARIO
    effects = ''.join(effect('stribeck', j, amplitude=a, velocity=v) for j, (a, v) in stribeck.items())
    effects += ''.join(effect('load_friction', j, coefficient=c) for j, c in load.items())
    if 1 not in load:  # so that the shoulder, too, has something that BAM can't say
        effects += effect('spring', 1, stiffness=SPRING / 12, offset=0)
    (work / 'scenario.toml').write_text(SCENARIO.replace(spring, effects).replace(
        'acceleration = [8, 8]', f'acceleration = {acceleration}'))
    # what BAM can't say turns with the motion: a low cut-off would hide a part of it from the certificate
    (work / 'arm.toml').write_text(PROJECT + '[signals]\ntorque_cutoff_hz = 100\n')


def numbers_that_can_be_wrong(joint, entry):
    """Each with its errors. What is 0 stays 0; so does the sign of what stands alone within |external - motor|, and that of
    the velocity in the bell. The shoulder has no rotor."""
    for key, value in entry.items():
        if key in ('model', 'alpha', 'dtheta_stribeck') or value == 0 or (joint, key) == ('shoulder', 'armature'):
            continue
        other = key.replace('motor', 'external') if 'motor' in key else key.replace('external', 'motor')
        alone = other != key and not key.endswith('_quad') and entry[other] == 0
        for what, how in ERRORS.items():
            if not (alone and what == 'another sign'):
                yield key, what, how


def coulomb_width(joint):
    """Of tanh(dq / width), the model's sign [rad/s]."""
    coulomb = next(effect for effect in joint['effects'] if effect['effect'] == 'coulomb')
    return next(p['value'] for p in coulomb['parameters'] if p['name'] == 'width')


def check_loaded(work, models):
    """Friction that grows with the load: BAM says most of it, and the others lose it. Every one of BAM's models is replayed."""
    stribeck, load = LOADED[models][:2]
    loaded_project(work, *LOADED[models])
    run('simulate', work / 'scenario.toml', '--out', work / 'logs')
    printed = run('export', work / 'arm.toml', '--out', work / 'out', '--to', 'bam,usd')
    held_out, path = Replay(work, 6), work / 'out/simulator_bam.json'
    bam, usd = (json.loads((work / f'out/certificate_{form}.json').read_text())['joints'] for form in ('bam', 'usd'))
    said = json.loads(path.read_text())
    bodies, read = held_out.bodies(path.with_suffix('.urdf')), READERS['bam'][1]
    right = held_out.torques(bodies, read(path))
    least = [3 * coulomb_width(joint) for joint in json.loads((work / 'out/model.json').read_text())['joints']]
    for j, (joint, model) in enumerate(zip(JOINTS, models)):
        of = f'{joint} of {models}'
        check(said[joint]['model'] == model and bam[j]['friction_model'] == model, f'{of}: {said[joint]}')
        check(re.search(rf'{joint} .* {model} ', printed), f'{of}: the model on the terminal: {printed}')
        loss, lost = held_out.loss_in_motion(right, least)[j], bam[j]['cannot_say_in_motion']
        check(abs(loss - lost) < 0.03 * lost, f'{of}: {loss} N m are lost, the certificate says {lost}')
        if j + 1 in load:
            check('load_friction' in usd[j]['left_out'] and 'load_friction' not in bam[j]['left_out'], f'{of}: {bam[j]} {usd[j]}')
            # not all: the motor's torque, which BAM's load is made of, has friction and rotor in it
            check(lost < 0.95 * usd[j]['cannot_say_in_motion'], f'{of}: {lost} N m are lost, USD loses {usd[j]}')
            check(bam[j]['cannot_say_without_load_friction'] < 0.2 * lost, f'{of}: the load is what is lost: {bam[j]}')
        for key, what, how in numbers_that_can_be_wrong(joint, said[joint]):
            torque = read_or_refused(held_out, bodies, read, changed(path, rf'"{joint}".*?"{key}": ', how))
            off = math.inf if torque is None else held_out.rms(torque, right)[j]
            check(off > 0.1 * loss, f'{of}: {key} {what} shows: {off} N m, {loss} are lost')


def check_draws(path):
    names = replay.run_python(path)
    chance = random.Random(5)
    for joint in JOINTS:
        known = names['RANGES'][joint]
        size = len(known['parameters'])
        check(size == (3 if joint == 'elbow' else 2), f'{joint}: {known["parameters"]}')
        check(all(0 < s < 0.1 * m for s, m in zip(known['std'], known['mean'])), f'{joint}: {known}')
        drawn = [names['draw'](joint, chance) for _ in range(4000)]
        scaled = [[(d[p] - m) / s for p, m, s in zip(known['parameters'], known['mean'], known['std'])] for d in drawn]
        moment = lambda i, k: sum(z[i] * z[k] for z in scaled) / len(scaled)
        # uniform in an ellipsoid: covariance = radius^2 / (size + 2) of the matrix that shapes it
        for i in range(size):
            check(max(abs(z[i]) for z in scaled) <= known['radius'] * 1.000001, f'{joint}: inside')
            for k in range(size):
                expected = known['correlation'][i][k] * known['radius'] ** 2 / (size + 2)
                check(abs(moment(i, k) - expected) < 0.06 * known['radius'] ** 2 / (size + 2), f'{joint}: {i} {k}')
        check(names['isaaclab_actuators']({j: drawn[0] for j in JOINTS})['elbow'].armature == drawn[0]['armature'],
              'drawn numbers are used')


def read_trajectory(path):
    """Joint names and points, line by line: every list is one of JSON, and every number in it has a point."""
    names, points = [], []
    for line in path.read_text().splitlines():
        key, _, value = line.lstrip(' -').partition(': ')
        if key == 'joint_names':
            names = json.loads(value)
        elif key in ('positions', 'velocities', 'accelerations', 'effort'):
            if key == 'positions':
                points.append({})
            check(all('.' in word for word in value.strip('[]').split(', ')), f'{key}: YAML 1.1 takes them for numbers')
            points[-1][key] = json.loads(value)
        elif key == 'time_from_start':
            sec, nanosec = re.fullmatch(r'\{sec: (\d+), nanosec: (\d+)\}', value).groups()
            points[-1]['t'] = int(sec) + 1e-9 * int(nanosec)
    return names, points


def check_trajectory(work):
    """The whole model's torque, so nothing is lost: what is there is the true torque, but for friction's turns, which
    the torque's cut-off rounds off."""
    plan, log = work / 'plan.csv', replay.rows(work / 'logs/a.csv')
    names = ['t', 'q1', 'q2', 'dq1', 'dq2', 'ddq1', 'ddq2']
    with open(plan, 'w') as file:
        csv.writer(file).writerows([names] + [[row[name] if name != 't' else row[name] + 5 for name in names] for row in log])
    run('predict', '--model', work / 'out/model.json', '--log', plan, '--out', work / 'plan', '--trajectory', '--raw')
    joints, points = read_trajectory(work / 'plan/plan.yaml')
    check(joints == list(JOINTS) and len(points) == len(log), f'{joints}, {len(points)} points')
    truth = replay.rows(work / 'logs/a.truth.csv')
    middle = range(500, len(log) - 500)
    check(all(abs(points[k]['t'] - log[k]['t']) < 1e-9 for k in middle), 'time counts from the first point')
    for key, (off, most) in trajectory_off(points, log, truth, middle).items():
        check(off < most, f'{key}: off by {off}, {most} at most')


def trajectory_off(points, log, truth, middle):
    """Per kind and joint: RMS of what is off, and how much it may be."""
    rms, out = lambda values: math.sqrt(sum(x * x for x in values) / len(middle)), {}
    for j in range(2):
        for key, rows, column, share in (('positions', log, 'q', 1e-3), ('velocities', log, 'dq', 1e-3),
                                         ('accelerations', log, 'ddq', 1e-3), ('effort', truth, 'tau', 0.01)):
            true = [rows[k][f'{column}{j + 1}'] for k in middle]
            out[key, j] = (rms([points[k][key][j] - x for k, x in zip(middle, true)]), share * rms(true))
    return out


with tempfile.TemporaryDirectory() as name:
    work = pathlib.Path(name)
    (work / 'arm.urdf').write_text((root / 'tests/support/elastic_arm/arm.urdf').read_text())
    (work / 'scenario.toml').write_text(SCENARIO)
    (work / 'arm.toml').write_text(PROJECT)
    run('simulate', work / 'scenario.toml', '--out', work / 'logs')
    run('export', work / 'arm.toml', '--out', work / 'out', '--to', 'drake,isaaclab,bam,usd')
    held_out = Replay(work)
    for form in READERS:
        check_format(form, work / 'out', held_out)
    check_draws(work / 'out/simulator_isaaclab.py')
    check_trajectory(work)
    for models in LOADED:
        check_loaded(work / '_'.join(models), models)
    check({model for models in LOADED for model in models} == {f'm{k}' for k in range(1, 7)}, 'every one of BAM')
sys.exit(bool(failed))
