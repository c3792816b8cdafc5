#!/usr/bin/env python3
"""solver_test.py FXDYN: a simulated arm, from its logs to a plug-in of inverse_dynamics_solver. The written package is
compiled against the interface alone (ROS is not here) and evaluated over the held-out log: its terms are those of the
true arm, by formulas of the test's own, and its loss is the certificate's."""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

import robot_replay as replay

fxdyn = pathlib.Path(sys.argv[1]).resolve()
root = pathlib.Path(__file__).resolve().parents[2]
failed = []


def check(condition, what):
    if not condition:
        failed.append(what)
        print('FAILED:', what)


def run(*words, code=0):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    check(done.returncode == code, f'{" ".join(map(str, words))}: exit code {done.returncode}: {done.stderr.strip()}')
    return done


VISCOUS, COULOMB, DISTANCE, SPRING = [1.5, 0.6], [3.0, 1.0], 0.02, 5.0
HELD_OUT_S, END_S = 8, 16
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
name = "presliding"
joint = 1
parameters = {{ amplitude = {COULOMB[0]}, distance = {DISTANCE} }}
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
# The interface as its package has it, as far as a plug-in sees it.
STUBS = {
    'rclcpp/node_interfaces/node_parameters_interface.hpp': '''#pragma once
#include <memory>
namespace rclcpp::node_interfaces {
struct NodeParametersInterface { using ConstSharedPtr = std::shared_ptr<const NodeParametersInterface>; };
}
''',
    'rclcpp/logging.hpp': '''#pragma once
#include <cstdio>
namespace rclcpp { inline const char* get_logger(const char* name) { return name; } }
#define RCLCPP_WARN_ONCE(logger, text) std::fprintf(stderr, "%s: %s\\n", logger, text)
''',
    'pluginlib/class_list_macros.hpp': '''#pragma once
#define PLUGINLIB_EXPORT_CLASS(type, base) base* created() { return new type; }
''',
    'inverse_dynamics_solver/inverse_dynamics_solver.hpp': '''#pragma once
#include <Eigen/Core>
#include <rclcpp/node_interfaces/node_parameters_interface.hpp>
#include <string>
namespace inverse_dynamics_solver {
class InverseDynamicsSolver {
 public:
  using V = Eigen::VectorXd;
  virtual ~InverseDynamicsSolver() = default;
  virtual void initialize(rclcpp::node_interfaces::NodeParametersInterface::ConstSharedPtr parameters = nullptr,
                          const std::string& name_space = "", const std::string& robot_description = "") = 0;
  virtual Eigen::MatrixXd getInertiaMatrix(const V&) const = 0;
  virtual V getCoriolisVector(const V&, const V&) const = 0;
  virtual V getGravityVector(const V&) const = 0;
  virtual V getFrictionVector(const V&) const = 0;
  virtual V getTorques(const V&, const V&, const V&) const { return {}; }
};
}
''',
    'main.cpp': '''#include <inverse_dynamics_solver/inverse_dynamics_solver.hpp>
#include <iostream>
#include <stdexcept>
inverse_dynamics_solver::InverseDynamicsSolver* created();
int main() {
  auto* solver = created();
  solver->initialize();
  std::cout.precision(12);
  Eigen::VectorXd q(2), dq(2), ddq(2);
  while (std::cin >> q[0] >> q[1] >> dq[0] >> dq[1] >> ddq[0] >> ddq[1]) {
    const Eigen::MatrixXd m = solver->getInertiaMatrix(q);
    std::cout << solver->getTorques(q, dq, ddq).transpose() << ' ' << solver->getFrictionVector(dq).transpose() << ' '
              << solver->getCoriolisVector(q, dq).transpose() << ' ' << solver->getGravityVector(q).transpose() << ' '
              << m(0, 0) << ' ' << m(0, 1) << ' ' << m(1, 0) << ' ' << m(1, 1) << std::endl;
  }
  try {
    solver->getGravityVector(Eigen::VectorXd(3));
  } catch (const std::invalid_argument& error) {
    std::cout << error.what() << std::endl;
  }
}
''',
}


def compiled(package, work):
    """The plug-in as a program that reads states and writes terms."""
    for name, text in STUBS.items():
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_text(text)
    run('g++', '-std=c++20', '-O1', '-Wall', '-Wextra', '-Werror', '-I', work, '-I', root, '-isystem', '/usr/include/eigen3',
        '-I', package / 'src', package / 'src/solver.cpp', work / 'main.cpp', '-o', work / 'solver')
    return work / 'solver'


def evaluated(program, states):
    """Per state torques, friction, Coriolis, gravity, inertia row by row; and what is said of a third joint."""
    text = '\n'.join(' '.join(f'{x:.12g}' for x in state) for state in states)
    done = subprocess.run([str(program)], input=text, capture_output=True, text=True, check=True)
    *lines, refused = done.stdout.splitlines()
    table = [[float(x) for x in line.split()] for line in lines]
    return [{'torques': r[0:2], 'friction': r[2:4], 'coriolis': r[4:6], 'gravity': r[6:8], 'inertia': r[8:12]} for r in table], \
        refused, done.stderr


def rms(values): return (sum(x * x for x in values) / len(values)) ** 0.5


def true_terms(states, urdf):
    """Bodies by Newton and Euler's recursion, spring and friction by their formulas."""
    chain, zero, out = replay.Chain(urdf), [0.0, 0.0], []
    for state in states:
        q, dq = state[0:2], state[2:4]
        rest, moved = chain.torque(q, zero, zero), chain.torque(q, dq, zero)
        columns = [[a - b for a, b in zip(chain.torque(q, zero, unit), rest)] for unit in ([1, 0], [0, 1])]
        out.append({'gravity': [rest[0], rest[1] + SPRING * q[1]], 'coriolis': [b - a for a, b in zip(rest, moved)],
                    'inertia': [columns[i][j] for j in range(2) for i in range(2)],
                    'friction': [VISCOUS[j] * dq[j] + COULOMB[j] * replay.sign(dq[j]) for j in range(2)]})
    return out


MOST_OFF = {'gravity': 0.03, 'coriolis': 0.02, 'inertia': 0.01, 'friction': 0.05, 'sum': 1e-3, 'symmetric': 1e-4}


def terms_off(states, terms, right):
    """RMS of what each term is off."""
    off = {name: [] for name in MOST_OFF}
    for state, term, true in zip(states, terms, right):
        dq, ddq = state[2:4], state[4:6]
        for name in ('gravity', 'coriolis', 'inertia'):
            off[name] += [a - b for a, b in zip(term[name], true[name])]
        for j in range(2):
            if abs(dq[j]) > 0.1:  # beyond: friction slides and the path has settled
                off['friction'].append(term['friction'][j] - true['friction'][j])
            inertial = sum(term['inertia'][2 * j + i] * ddq[i] for i in range(2))
            off['sum'].append(term['torques'][j] - inertial - term['coriolis'][j] - term['gravity'][j])
        off['symmetric'].append(term['inertia'][1] - term['inertia'][2])
    return {name: rms(values) for name, values in off.items()}


def check_terms(program, states, terms, urdf):
    right = true_terms(states, urdf)
    for name, off in terms_off(states, terms, right).items():
        check(off < MOST_OFF[name], f'{name}: off by {off}')
    gear = 50
    for name in ('gravity', 'coriolis', 'inertia', 'friction'):
        for what, factor in {'another sign': -1, '57.3 times': 57.3, 'a 57.3th': 1 / 57.3, "the motor's side": 1 / gear}.items():
            wrong = [{**term, name: [factor * x for x in term[name]]} for term in terms]
            off = terms_off(states, wrong, right)[name]
            check(off > MOST_OFF[name], f'{name}: {what} shows: off by {off}')
    for k, what in enumerate(('positions', 'velocities')):  # read as degrees
        turned = [[x * math.pi / 180 if at // 2 == k else x for at, x in enumerate(state)] for state in states]
        off = terms_off(states, evaluated(program, turned)[0], right)
        check(any(off[name] > MOST_OFF[name] for name in ('gravity', 'friction')), f'{what} in degrees show: {off}')


with tempfile.TemporaryDirectory() as name:
    work = pathlib.Path(name)
    (work / 'arm.urdf').write_text((root / 'tests/support/elastic_arm/arm.urdf').read_text())
    (work / 'scenario.toml').write_text(SCENARIO)
    (work / 'arm.toml').write_text(PROJECT)
    run(fxdyn, 'simulate', work / 'scenario.toml', '--out', work / 'logs')
    out = work / 'out'
    words = (fxdyn, 'export', work / 'arm.toml', '--out', out, '--to', 'inverse_dynamics_solver')
    check('run `fxdyn run' in run(*words, code=2).stderr, 'without tables: what to do')
    run(fxdyn, 'export', work / 'arm.toml', '--out', out)
    said = run(*words).stdout
    package = out / 'inverse_dynamics_solver'
    manifest, plugins = xml.parse(package / 'package.xml'), xml.parse(package / 'plugins.xml')
    check(manifest.findtext('name') == 'fxdyn_arm_solver', manifest.findtext('name'))
    check(plugins.find('class').get('type') == 'fxdyn_arm_solver::Solver', 'the class by its name')
    check((package / 'src/tables.hpp').read_bytes() == (out / 'tables.hpp').read_bytes(), "the drive's own tables")

    certificate = json.loads((out / 'certificate_inverse_dynamics_solver.json').read_text())
    check(certificate['as_meant'], certificate)
    check([joint['left_out'] for joint in certificate['joints']] == [['presliding'], []], certificate)
    check(f'{certificate["joints"][0]["cannot_say"]:.4g}' in said, said)

    edge = json.loads((out / 'model.json').read_text())['filter']['edge_s']
    log = [row for row in replay.rows(work / 'logs/a.csv') if HELD_OUT_S + edge <= row['t'] < END_S - edge][::5]
    states = [[row[f'{x}{j}'] for x in ('q', 'dq', 'ddq') for j in (1, 2)] for row in log]
    program = compiled(package, work)
    terms, refused, warned = evaluated(program, states)
    check(refused == 'fxdyn_arm_solver: 3 joints instead of 2: shoulder, elbow', refused)
    check('limited' not in warned, 'within the limits')
    check('limited' in evaluated(program, [[9, 0, 0, 0, 0, 0]])[2], 'a state beyond the limits')
    check_terms(program, states, terms, work / 'arm.urdf')
    truth = {row['t']: row for row in replay.rows(work / 'logs/a.truth.csv')}
    for j, joint in enumerate(certificate['joints']):
        # What the path after a reversal was worth, and nothing at the joint without it.
        loss = rms([truth[row['t']][f'tau{j + 1}'] - term['torques'][j] - term['friction'][j] for row, term in zip(log, terms)])
        check(abs(loss - joint['cannot_say']) < 0.1 * joint['cannot_say'] + 0.02, f'{joint["joint"]}: {loss}, said {joint["cannot_say"]}')
    check(certificate['joints'][0]['cannot_say'] > 0.1 > certificate['joints'][1]['cannot_say'], certificate['joints'])
sys.exit(bool(failed))
