"""Torque of a chain of joints, from a URDF and from files of simulators: formulas of its own, nothing of fxdyn's.

URDF: Newton and Euler's recursion in the links' frames. Files: read as their own documentation has it, in the documented
units, by a reader that shares nothing with the writer."""
import csv
import json
import math
import re
import sys
import types
import xml.etree.ElementTree as xml

GRAVITY = 9.81


def rows(path):
    """A log, row by row."""
    with open(path) as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def add(a, b): return [x + y for x, y in zip(a, b)]
def scale(s, a): return [s * x for x in a]
def dot(a, b): return sum(x * y for x, y in zip(a, b))
def cross(a, b): return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
def times(m, a): return [dot(row, a) for row in m]
def turned(m): return [list(column) for column in zip(*m)]
def product(a, b): return turned([times(a, column) for column in turned(b)])


def about(axis, angle):
    """Rotation by Rodrigues' formula."""
    c, s, (x, y, z) = math.cos(angle), math.sin(angle), axis
    return [[c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s],
            [y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s],
            [z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)]]


def roll_pitch_yaw(r, p, y):
    return product(product(about([0, 0, 1], y), about([0, 1, 0], p)), about([1, 0, 0], r))


def numbers(element, name, default='0 0 0'):
    return [float(x) for x in (element.get(name, default) if element is not None else default).split()]


class Chain:
    """Revolute joints in the file's order, each on the link of the one before."""

    def __init__(self, urdf):
        root = xml.parse(urdf).getroot()
        links = {link.get('name'): link for link in root.findall('link')}
        self.joints = []
        for joint in root.findall('joint'):
            body = links[joint.find('child').get('link')].find('inertial')
            tensor = {k: float(v) for k, v in body.find('inertia').attrib.items()}
            local = [[tensor['ixx'], tensor['ixy'], tensor['ixz']], [tensor['ixy'], tensor['iyy'], tensor['iyz']],
                     [tensor['ixz'], tensor['iyz'], tensor['izz']]]
            turn = roll_pitch_yaw(*numbers(body.find('origin'), 'rpy'))
            self.joints.append({
                'name': joint.get('name'), 'axis': numbers(joint.find('axis'), 'xyz', '1 0 0'),
                'at': numbers(joint.find('origin'), 'xyz'), 'turn': roll_pitch_yaw(*numbers(joint.find('origin'), 'rpy')),
                'mass': float(body.find('mass').get('value')), 'centre': numbers(body.find('origin'), 'xyz'),
                'tensor': product(product(turn, local), turned(turn))})

    def torque(self, q, dq, ddq):
        """Of the bodies alone [N m]."""
        w, dw, a, steps = [0.0] * 3, [0.0] * 3, [0.0, 0.0, GRAVITY], []
        for j, joint in enumerate(self.joints):
            back = turned(product(joint['turn'], about(joint['axis'], q[j])))  # parent's frame -> link's frame
            a = times(back, add(a, add(cross(dw, joint['at']), cross(w, cross(w, joint['at'])))))
            w, dw = times(back, w), times(back, dw)
            spin = scale(dq[j], joint['axis'])
            dw = add(add(dw, scale(ddq[j], joint['axis'])), cross(w, spin))
            w = add(w, spin)
            c, tensor = joint['centre'], joint['tensor']
            force = scale(joint['mass'], add(a, add(cross(dw, c), cross(w, cross(w, c)))))
            moment = add(times(tensor, dw), cross(w, times(tensor, w)))
            steps.append((back, force, add(moment, cross(c, force))))
        out, force, moment = [0.0] * len(steps), [0.0] * 3, [0.0] * 3
        for j in reversed(range(len(steps))):
            force, moment = add(steps[j][1], force), add(steps[j][2], moment)
            out[j] = dot(moment, self.joints[j]['axis'])
            to_parent = turned(steps[j][0])
            force, moment = times(to_parent, force), times(to_parent, moment)
            moment = add(moment, cross(self.joints[j]['at'], force))
        return out


def sign(x): return (x > 0) - (x < 0)


def run_python(path):
    """The names of a Python file, with configurations that keep what they are given."""
    class Strict:
        known = ()

        def __init__(self, **given):
            unknown = set(given) - set(self.known)
            if unknown:
                raise TypeError(f'{type(self).__name__} knows no {sorted(unknown)}')
            self.__dict__.update(given)

    class IdealPDActuatorCfg(Strict):
        known = ('joint_names_expr', 'effort_limit', 'velocity_limit', 'effort_limit_sim', 'velocity_limit_sim', 'stiffness',
                 'damping', 'armature', 'friction', 'dynamic_friction', 'viscous_friction')

    class IdealPdActuatorCfg(Strict):
        known = ('target_names_expr', 'stiffness', 'damping', 'effort_limit', 'armature', 'velocity_limit', 'frictionloss',
                 'viscous_damping')

    for name, classes in ('isaaclab', {}), ('isaaclab.actuators', {'IdealPDActuatorCfg': IdealPDActuatorCfg}), \
            ('mjlab', {}), ('mjlab.actuator', {'IdealPdActuatorCfg': IdealPdActuatorCfg}):
        module = types.ModuleType(name)
        module.__dict__.update(classes)
        sys.modules[name] = module
    names = {'__name__': 'simulator'}
    exec(compile(path.read_text(), str(path), 'exec'), names)
    return names


def drake_joint(path, joint):
    """MultibodyPlant: damping of the joint, the rotor times the square of its gear ratio, no dry friction; no drive where the
    effort is 0."""
    root = xml.parse(path).getroot()
    said = next(e for e in root.findall('joint') if e.get('name') == joint)
    assert root.tag == 'robot' and float(said.find('dynamics').get('friction')) == 0
    damping, limit = float(said.find('dynamics').get('damping')), said.find('limit')
    drives = [e for e in root.findall('transmission') if e.find('joint').get('name') == joint]
    assert len(drives) == 1 and 'SimpleTransmission' in drives[0].find('type').text
    assert limit is None or float(limit.get('effort', 'inf')) > 0
    value = lambda name: float(drives[0].find('actuator/{http://drake.mit.edu}' + name).get('value'))
    assert damping >= 0  # Drake refuses it
    return lambda dq, ddq, *_: damping * dq + value('gear_ratio') ** 2 * value('rotor_inertia') * ddq


def isaaclab_joint(names, joint):
    """tau = armature ddq + dynamic_friction sign(dq) + viscous_friction dq: of PhysX, SI units."""
    found = [a for a in names['isaaclab_actuators']().values() if any(re.fullmatch(e, joint) for e in a.joint_names_expr)]
    assert len(found) == 1, f'{joint}: {len(found)} actuators'
    cfg = found[0]
    assert cfg.stiffness == 0 and cfg.damping == 0 and cfg.friction >= cfg.dynamic_friction
    return lambda dq, ddq, *_: cfg.armature * ddq + cfg.dynamic_friction * sign(dq) + cfg.viscous_friction * dq


def mjlab_joint(names, joint):
    """tau = armature ddq + frictionloss sign(dq) + viscous_damping dq: of MuJoCo."""
    found = [a for a in names['mjlab_actuators']() if any(re.fullmatch(e, joint) for e in a.target_names_expr)]
    assert len(found) == 1, f'{joint}: {len(found)} actuators'
    cfg = found[0]
    return lambda dq, ddq, *_: cfg.armature * ddq + cfg.frictionloss * sign(dq) + cfg.viscous_damping * dq


def bam_friction(said, motor, external, dq):
    """bam/model.py: frictionloss and viscous friction, both against the motion [N m]."""
    bell = math.exp(-abs(dq / said['dtheta_stribeck']) ** said['alpha']) if 'alpha' in said else 0
    loss = said['friction_base'] + bell * said.get('friction_stribeck', 0) + said['friction_viscous'] * abs(dq)
    if said['model'] in ('m3', 'm4'):
        loss += (said['load_friction_base'] + bell * said.get('load_friction_stribeck', 0)) * abs(external - motor)
    if said['model'] in ('m5', 'm6'):
        loss += abs(external * said['load_friction_external'] - motor * said['load_friction_motor'])
        loss += bell * abs(external * said['load_friction_external_stribeck'] - motor * said['load_friction_motor_stribeck'])
    if said['model'] == 'm6' and sign(external) != sign(motor):
        if abs(external) < abs(motor):
            loss += bell * said['load_friction_external_quad'] * external ** 2
        else:
            loss += bell * said['load_friction_motor_quad'] * motor ** 2
    return loss


def bam_joint(path, joint):
    """The motor's torque moves body and rotor against friction, which grows with the motor's torque in m3 to m6: by
    bisection. External is the torque of gravity and velocity, as bam/mujoco.py has it."""
    said = json.loads(path.read_text())[joint]
    assert said['model'] in ('m1', 'm2', 'm3', 'm4', 'm5', 'm6')

    def torque(dq, ddq, body, still):
        low, high = -1e4, 1e4
        for _ in range(60):
            motor = (low + high) / 2
            if motor - body - said['armature'] * ddq < sign(dq) * bam_friction(said, motor, -still, dq):
                low = motor
            else:
                high = motor
        return motor - body
    return torque


def usd_joint(path, joint):
    """PhysxJointAxisAPI: efforts in N m, armature in kg m^2, the viscous coefficient times dq in degrees a second."""
    block = re.search(r'over "%s" \(.*?\{(.*?)\}' % re.escape(joint), path.read_text(), re.S).group(1)
    value = lambda name: float(re.search(r'physxJointAxis:angular:%s = (\S+)' % name, block).group(1))
    assert value('staticFrictionEffort') >= value('dynamicFrictionEffort')
    assert float(re.search(r'drive:angular:physics:damping = (\S+)', block).group(1)) == 0
    return lambda dq, ddq, *_: (value('armature') * ddq + value('dynamicFrictionEffort') * sign(dq) +
                            value('viscousFrictionCoefficient') * math.degrees(dq))
