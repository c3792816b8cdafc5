#!/usr/bin/env python3
"""Positions from voltages by the friction models M1 to M6 that BAM publishes for the servo of bam_servo_pendulum.

  bam_models.py DATA_FOLDER [--out FILE.json]

Duclusaud, Passault et al., "Extended Friction Models for the Physics Simulation of Servo Actuators", arXiv 2410.08650.
The parameters are those of github.com/Rhoban/bam, params/xl330 (m1, m2, m6: commit 16837b34; m3, m4, m5_old: ca760c63),
under Apache-2.0; the code is written here after the equations of the paper. As `fxdyn forward` does it: the recorded
voltage drives the model, the first 20 samples are given, and a parabola through them says where it starts.
Nothing is fitted here. BAM judges by another figure: MAE in closed loop, its own controller simulated.
"""
import argparse
import csv
import json
import math
import pathlib
import sys

MASS, LENGTH, GRAVITY = 0.49, 0.1, 9.80665  # kg, m (logs.json), m/s^2
GIVEN = 20
LONGEST_STEP = 0.001  # s
# kt [N*m/A], R [Ohm], armature [kg*m^2], q_offset [rad]; base and Stribeck friction [N*m], of the load [1], its square
# [1/(N*m)]; Stribeck velocity [rad/s] and exponent; viscous [N*m*s/rad]
MODELS = {
    'M1': dict(kt=0.30289755582162975, R=3.3684302037392664, armature=0.0017252511613451657, q_offset=0.018329850738874692,
               base=0.02056180265843287, viscous=0.007824871088049171),
    'M2': dict(kt=0.3000720069538782, R=3.422351469701773, armature=0.0018351949338899591, q_offset=0.022592190159599387,
               base=0.0019886188548530657, stribeck=0.005585354519563084, velocity=1.9506211404437368,
               alpha=1.691409215272971, viscous=0.011955233153630796),
    'M3': dict(kt=0.38042022855161584, R=3.380066954773944, armature=0.001917772275220315, q_offset=0.029439576907685533,
               base=0.008881712972862601, load=0.12166455532811028, viscous=0.004379099756757558),
    'M4': dict(kt=0.3861709980035537, R=3.402572641173151, armature=0.0018954552619850965, q_offset=0.02807245876562081,
               base=0.008758627618365112, stribeck=7.508873888400355e-17, load=0.06803357334088644,
               load_stribeck=0.07381180834784251, velocity=2.5577016869227474, alpha=0.7601158768377835,
               viscous=0.004621034970462603),
    'M5': dict(kt=0.37052089910035324, R=2.977837607674783, armature=0.0018837443992737585, q_offset=0.03306998659783944,
               base=0.006701603330043059, stribeck=0.002383033174546291, motor=0.21974502017212783,
               external=0.004833156767796903, motor_stribeck=0.14944957898413452,
               external_stribeck=0.2863011897058181, velocity=0.3938223715371345, alpha=1.858368927238327,
               viscous=0.0062093363785171414),
    'M6': dict(kt=0.303609876267925, R=2.444951107725838, armature=0.0020566024734211697, q_offset=0.02113563649978374,
               base=0.0004496236724962162, stribeck=8.98236594176617e-05, motor=0.28425109160327744,
               external=0.13631427926858256, motor_stribeck=0.000962295552186495, external_stribeck=0.07756269586185101,
               motor_quad=0.0052586872345423965, external_quad=0.009015695123707009, velocity=0.7791999762669103,
               alpha=1.8121453469382847, viscous=0.008178654749130088),
}
LOGS = [f'xl330_{motion}_kp{gain}' for motion in ('sin_sin', 'sin_time_square', 'up_and_down') for gain in (200, 800)]


def friction(model, motor, external, dq):
    """The most torque that friction can hold against, Coulomb's part and viscous [N*m]."""
    p = model.get
    bell = math.exp(-abs(dq / p('velocity')) ** p('alpha')) if 'velocity' in model else 0
    loss = p('base') + bell * p('stribeck', 0)
    if 'load' in model:
        loss += (p('load') + bell * p('load_stribeck', 0)) * abs(external - motor)
    if 'motor' in model:
        loss += abs(external * p('external') - motor * p('motor'))
        loss += bell * abs(external * p('external_stribeck') - motor * p('motor_stribeck'))
    if 'motor_quad' in model and external * motor < 0:
        if abs(external) < abs(motor):
            loss += bell * p('external_quad') * external ** 2
        else:
            loss += bell * p('motor_quad') * motor ** 2
    return loss + p('viscous') * abs(dq)


def parabola(t, q):
    """Position and velocity at the last of some samples, of the parabola through them."""
    x = [one - t[-1] for one in t]
    sums = [sum(one ** k for one in x) for k in range(5)]
    a = [[sums[i + j] for j in range(3)] + [sum(y * one ** i for one, y in zip(x, q))] for i in range(3)]
    for i in range(3):  # elimination
        a[i] = [v / a[i][i] for v in a[i]]
        for j in range(3):
            if j != i:
                a[j] = [v - a[j][i] * w for v, w in zip(a[j], a[i])]
    return a[0][3], a[1][3]


def simulate(model, t, q, u):
    """Positions at the log's samples; those of the first GIVEN are the log's."""
    at, dq = parabola(t[:GIVEN], q[:GIVEN])
    at += model['q_offset']
    inertia = MASS * LENGTH ** 2 + model['armature']
    out = list(q[:GIVEN])
    for k in range(GIVEN - 1, len(t) - 1):
        steps = max(1, math.ceil((t[k + 1] - t[k]) / LONGEST_STEP))
        h = (t[k + 1] - t[k]) / steps
        for s in range(steps):
            volts = u[k] + (u[k + 1] - u[k]) * (s + 0.5) / steps
            motor = model['kt'] / model['R'] * (volts - model['kt'] * dq)
            external = -MASS * GRAVITY * LENGTH * math.sin(at)
            net = motor + external
            # Friction stops the joint within the step if it can, and else takes what it has.
            to_stop = inertia / h * dq + net
            net -= math.copysign(min(abs(to_stop), friction(model, motor, external, dq)), to_stop)
            before = dq
            dq += net / inertia * h
            at += 0.5 * (before + dq) * h
        out.append(at - model['q_offset'])
    return out


def read(file):
    with open(file, newline='') as text:
        rows = list(csv.DictReader(text))
    return [[float(row[key]) for row in rows] for key in ('t', 'q1', 'u1')]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('data', type=pathlib.Path, help='the folder that holds bam_servo_pendulum')
    parser.add_argument('--out', type=pathlib.Path)
    options = parser.parse_args()
    result = {'given': GIVEN, 'unit': 'rad', 'models': []}
    for name, model in MODELS.items():
        errors = {}
        for log in LOGS:
            t, q, u = read(options.data / 'bam_servo_pendulum' / f'{log}.csv')
            found = simulate(model, t, q, u)
            errors[log] = math.sqrt(sum((a - b) ** 2 for a, b in zip(found[GIVEN:], q[GIVEN:])) / (len(q) - GIVEN))
        median = sorted(errors.values())
        result['models'].append({'name': name, 'open_rmse': errors, 'mean': sum(median) / len(median),
                                 'median': (median[2] + median[3]) / 2})
        print(name, *(f'{value:8.4f}' for value in errors.values()), f'mean {result["models"][-1]["mean"]:.4f}')
    if options.out:
        options.out.write_text(json.dumps(result, indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
