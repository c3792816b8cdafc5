#!/usr/bin/env python3
"""How far the UR10 model that Petrone et al. released is off on our test window: docs/findings/benchmarks.md, "UR10".

  ur10_published.py DATA_FOLDER --clone FOLDER [--out FILE.json]
  ur10_published.py DATA_FOLDER --cut FILE.csv
  ur10_published.py DATA_FOLDER --torque FILE.csv [--out FILE.json]

FOLDER is a clone of github.com/unisa-acg/inverse-dynamics-solver (BSD-3-Clause). Its code is no part of this project: it is
compiled here as it is, and its friction parameters are read from it. --torque judges another torque (t, tau1..tau6, as
`fxdyn predict` writes it) instead, over the same window by the same filter, without theirs. --cut writes the log's window alone,
for friction that remembers where it starts.

Window and filter are those of tests/real/published/ur10_unisa.toml: 19 to 27 s, Butterworth of order 4 forwards and backwards,
20 Hz for the position and 12 Hz for torques, 0.25 s dropped at both ends.
"""
import argparse
import csv
import ctypes
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

JOINTS = 6
FROM_S, TO_S, EDGE_S = 19.0, 27.0, 0.25
POSITION_HZ, TORQUE_HZ = 20.0, 12.0
GAINS = (13.5841, 14.2959, 11.3716, 11.2408, 11.7681, 11.7682)  # N*m/A, as in the set's README.txt
PACKAGE = 'ur10_inverse_dynamics_solver'


def sections(cutoff_hz, step_s):
    """Butterworth of order 4 as two sections b0, b1, b2, a1, a2, by the bilinear transform."""
    k = math.tan(math.pi * cutoff_hz * step_s)
    for q in (1 / (2 * math.sin(math.pi / 8)), 1 / (2 * math.sin(3 * math.pi / 8))):
        norm = 1 / (1 + k / q + k * k)
        yield k * k * norm, 2 * k * k * norm, k * k * norm, 2 * (k * k - 1) * norm, (1 - k / q + k * k) * norm


def one_way(x, section):
    b0, b1, b2, a1, a2 = section
    # at rest at the first value: the section's gain is 1 there
    s1, s2 = x[0] * (1 - b0), x[0] * (b2 - a2)
    out = []
    for value in x:
        y = b0 * value + s1
        s1, s2 = b1 * value - a1 * y + s2, b2 * value - a2 * y
        out.append(y)
    return out


def filtered(x, cutoff_hz, step_s):
    for section in list(sections(cutoff_hz, step_s)):
        x = one_way(one_way(x, section)[::-1], section)[::-1]
    return x


def derivative(x, step_s):
    inner = [(b - a) / (2 * step_s) for a, b in zip(x, x[2:])]
    return [inner[0], *inner, inner[-1]]


def columns(file, names):
    with open(file, newline='') as text:
        rows = [[float(row[name]) for name in names] for row in csv.DictReader(text)]
    rows = [row for row in rows if FROM_S <= row[0] < TO_S]
    if not rows:
        sys.exit(f'ur10_published.py: {file} has no rows from {FROM_S} to {TO_S} s')
    return [list(column) for column in zip(*rows)]


def friction_of(source):
    """Their sigmoid, its parameters read from their source [A]."""
    def numbers(name):
        found = dict(re.findall(rf'\b{name}\((\d)\)\s*=\s*([-0-9.eE]+);', source))
        if len(found) != JOINTS:
            sys.exit(f'ur10_published.py: {PACKAGE}.cpp has {len(found)} values of {name}, not {JOINTS}')
        return [float(found[str(j)]) for j in range(JOINTS)]
    viscous, offset, coulomb, slope, shift = (numbers(name) for name in ('f_v', 'f_o', 'f_c', 'alpha', 'ni'))
    return lambda j, dq: viscous[j] * dq + offset[j] + coulomb[j] / (1 + math.exp(min(700, -slope[j] * (dq + shift[j]))))


def released_torque(clone, q, step_s):
    """Of their model on a motion [N*m]."""
    package = clone / PACKAGE
    header = package / 'include' / PACKAGE / 'getCurrents.hpp'
    if not header.is_file():
        sys.exit(f'ur10_published.py: there is no {header}: give a clone of github.com/unisa-acg/inverse-dynamics-solver')
    friction = friction_of((package / 'src' / f'{PACKAGE}.cpp').read_text())
    with tempfile.TemporaryDirectory() as work:
        glue, library = pathlib.Path(work) / 'glue.cpp', pathlib.Path(work) / 'theirs.so'
        glue.write_text(f'#include "{PACKAGE}/getCurrents.hpp"\nextern "C" void currents(const double* q, const double* dq, '
                        f'const double* ddq, double* out) {{ {PACKAGE}::getCurrents(q, dq, ddq, out); }}\n')
        subprocess.run(['g++', '-O1', '-shared', '-fPIC', f'-I{package / "include"}', glue, package / 'src' / 'getCurrents.cpp',
                        '-o', library], check=True)
        call = ctypes.CDLL(str(library)).currents
        motion = [[filtered(column, POSITION_HZ, step_s) for column in q]]
        for _ in range(2):
            motion.append([derivative(column, step_s) for column in motion[-1]])
        torque = []
        for row in zip(*(zip(*part) for part in motion)):
            out = (ctypes.c_double * JOINTS)()
            call(*((ctypes.c_double * JOINTS)(*values) for values in row), out)
            torque.append([gain * (out[j] + friction(j, row[1][j])) for j, gain in enumerate(GAINS)])
    return [list(column) for column in zip(*torque)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('data', type=pathlib.Path, help='the folder that holds ur10_unisa')
    parser.add_argument('--clone', type=pathlib.Path)
    parser.add_argument('--torque', type=pathlib.Path)
    parser.add_argument('--cut', type=pathlib.Path)
    parser.add_argument('--out', type=pathlib.Path)
    options = parser.parse_args()
    if [options.clone, options.torque, options.cut].count(None) != 2:
        parser.error('give --clone, --torque or --cut')
    log_file = options.data / 'ur10_unisa' / 'exciting_trajectory.csv'
    if options.cut:
        head, *rows = log_file.read_text().splitlines(keepends=True)
        at = head.strip().split(',').index('t')
        options.cut.write_text(head + ''.join(row for row in rows if FROM_S <= float(row.split(',')[at]) < TO_S))
        return 0
    names = [f'{kind}{j + 1}' for kind in ('q', 'tau') for j in range(JOINTS)]
    t, *log = columns(log_file, ['t', *names])
    step_s = (t[-1] - t[0]) / (len(t) - 1)
    if options.torque:
        ours_t, *torque = columns(options.torque, ['t', *names[JOINTS:]])
        if len(ours_t) != len(t):
            sys.exit(f'ur10_published.py: {options.torque} has {len(ours_t)} rows in the window, the log {len(t)}')
    else:
        torque = released_torque(options.clone, log[:JOINTS], step_s)
    edge = math.ceil(EDGE_S / step_s)
    rmse = []
    for theirs, measured in zip(torque, log[JOINTS:]):
        error = [a - b for a, b in zip(filtered(theirs, TORQUE_HZ, step_s), filtered(measured, TORQUE_HZ, step_s))][edge:-edge]
        rmse.append(math.sqrt(sum(value * value for value in error) / len(error)))
    print(*(f'{value:.4f}' for value in rmse))
    if options.out:
        options.out.write_text(json.dumps({'unit': 'N*m', 'rmse': rmse}) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
