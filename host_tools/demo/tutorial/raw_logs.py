#!/usr/bin/env python3
"""raw_logs.py LOGS OUT: the scenario's logs as a drive's own logger would have written them: no line of names, stamps in milliseconds
since it was switched on, currents in A in place of torques, and two seconds of standstill at both ends."""
import pathlib
import random
import sys

# Torque constant x gear ratio of each joint [N*m/A]: figures of the size that a robot like this has.
GAINS = [15.5, 18.0, 9.0, 6.5, 6.0, 6.5]
JOINTS = len(GAINS)
STEP_S = 0.002
REST_ROWS = 1000
SWITCHED_ON_S = 3600.0


def raw_rows(text, noise):
    rows = [[float(field) for field in line.split(',')] for line in text.split('\n')[1:] if line]
    at_rest = lambda row: row[:1 + JOINTS] + [tau + noise.gauss(0, 0.01 * gain) for tau, gain in zip(row[1 + JOINTS:], GAINS)]
    rows = [at_rest(rows[0]) for _ in range(REST_ROWS)] + rows + [at_rest(rows[-1]) for _ in range(REST_ROWS)]
    for k, row in enumerate(rows):
        currents = [tau / gain for tau, gain in zip(row[1 + JOINTS:1 + 2 * JOINTS], GAINS)]
        yield [f'{1000 * (SWITCHED_ON_S + k * STEP_S):.0f}'] + [f'{x:.9f}' for x in row[1:1 + JOINTS]] + [f'{x:.5f}' for x in currents]


def main():
    logs, out = map(pathlib.Path, sys.argv[1:3])
    out.mkdir(parents=True, exist_ok=True)
    noise = random.Random(1)
    for name in ('fast', 'slow', 'middle', 'other'):
        rows = raw_rows((logs / f'{name}.csv').read_text(), noise)
        (out / f'{name}.csv').write_text('\n'.join(','.join(row) for row in rows) + '\n')


if __name__ == '__main__':
    main()
