#!/usr/bin/env python3
"""solver_test.py FXDYN: a simulated arm, from its logs to a plug-in of inverse_dynamics_solver. The written package is
compiled against the interface alone (ROS is not here) and evaluated over the held-out log: its terms are those of the
true arm, by formulas of the test's own, and its loss is the certificate's. Errors in the written tables and source show."""
import json
import math
import pathlib
import re
import shutil
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
    flags = ('-std=c++20', '-O1', '-Wall', '-Wextra', '-Werror', '-I', work, '-I', root, '-isystem', '/usr/include/eigen3')
    if not (work / 'main.o').exists():
        run('g++', *flags, '-c', work / 'main.cpp', '-o', work / 'main.o')
    run('g++', *flags, '-I', package / 'src', package / 'src/solver.cpp', work / 'main.o', '-o', work / 'solver')
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


def check_terms(states, terms, right):
    for name, off in terms_off(states, terms, right).items():
        check(off < MOST_OFF[name], f'{name}: off by {off}')


# Errors in what is written. Numbers of tables.hpp and the terms that have to show them; no two of a group share a term.
NUMBERS = [
    {r'\n *(-?\d+), // elbow: viscous': ('friction',), r'\n *(-?\d+), -?\d+, // elbow: spring': ('gravity',),
     r'\{-?\d+, \{-?\d+, -?\d+, -?\d+\}, (-?\d+),[^\n]*// link 2': ('inertia',)},
    {r'\n *(-?\d+), // elbow: coulomb': ('friction',),
     r'\{-?\d+, \{(-?\d+), [^\n]*// link 2': ('gravity', 'coriolis', 'inertia')},
]
# 57.3 times as much does not fit the tables.
ERRORS = {'another sign': lambda x: -x, 'a 57.3th': math.radians, "the motor's side": lambda x: x / 50}
# Of solver.cpp: what stands there, what may stand there by mistake, and the terms that have to show it.
MISTAKES = [
    ('return x;', 'return x * (3.14159265358979 / 180);', ('gravity', 'coriolis', 'inertia', 'friction')),
    ('return x;', 'return x.reverse();', ('gravity', 'coriolis', 'inertia', 'friction')),
    ('terms_.torque_without_friction(', 'terms_.torque(', ('sum',)),
]


def check_errors_in_the_package(package, work, states, right):
    """Each is written into a copy of the package, which is compiled and evaluated as the package itself."""
    copy = work / 'with_error'
    shutil.copytree(package, copy)

    def check_shown(shown, what):
        off = terms_off(states, evaluated(compiled(copy, work), states)[0], right)
        for term in shown:
            check(off[term] > MOST_OFF[term], f'{what} shows in {term}: {off}')

    tables, source = copy / 'src/tables.hpp', copy / 'src/solver.cpp'
    text = tables.read_text()
    for what, how in ERRORS.items():
        for group in NUMBERS:
            wrong = text
            for place in group:
                found = re.search(place, wrong)
                wrong = wrong[:found.start(1)] + str(round(how(int(found.group(1))))) + wrong[found.end(1):]
            tables.write_text(wrong)
            check_shown([term for terms in group.values() for term in terms], f'{list(group)} {what}')
    tables.write_text(text)
    text = source.read_text()
    for stands, mistake, shown in MISTAKES:
        check(text.count(stands) == 1, f'{stands} stands once')
        source.write_text(text.replace(stands, mistake))
        check_shown(shown, mistake)


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
    right = true_terms(states, work / 'arm.urdf')
    check_terms(states, terms, right)
    check_errors_in_the_package(package, work, states, right)
    truth = {row['t']: row for row in replay.rows(work / 'logs/a.truth.csv')}
    for j, joint in enumerate(certificate['joints']):
        # What the path after a reversal was worth, and nothing at the joint without it.
        loss = rms([truth[row['t']][f'tau{j + 1}'] - term['torques'][j] - term['friction'][j] for row, term in zip(log, terms)])
        check(abs(loss - joint['cannot_say']) < 0.1 * joint['cannot_say'] + 0.02, f'{joint["joint"]}: {loss}, said {joint["cannot_say"]}')
    check(certificate['joints'][0]['cannot_say'] > 0.1 > certificate['joints'][1]['cannot_say'], certificate['joints'])
sys.exit(bool(failed))
