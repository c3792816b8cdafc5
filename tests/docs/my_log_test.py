#!/usr/bin/env python3
"""my_log_test.py FXDYN: makes a log of each kind of docs/guide/my-log.md out of one simulated robot, and runs the commands of its
section in a folder of their own. They have to end well, `check` must not find anything wrong, and what it has read of each joint has to be
the robot's range and torque: then columns, units and signs came through."""
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / 'tests/support'))
import matlab_files
import parquet_files
import ros2_bags
PAGE = ROOT / 'docs/guide/my-log.md'
DEMO = ROOT / 'host_tools/demo'
JOINTS = 6
TOLERANCE = 0.01  # share: check prints three digits, and a torque in per mille of rated is rounded
SECONDS = 8  # of the log, of which every other row is kept: 250 Hz

UR_GAINS = [13.58, 14.30, 11.37, 11.24, 11.77, 11.77]
KUKA_GAINS = [20, 20, 15, 5, 5, 5]
STAUBLI = [[32, 0, 0, 0, 0, 0], [0, 32, 0, 0, 0, 0], [0, 0, 45, 0, 0, 0],
           [0, 0, 0, 48, 0, 0], [0, 0, 0, 0, 45, 0], [0, 0, 0, 0, 32, 32]]
ODRIVE_RATIO, ODRIVE_CONSTANT = [50, 50, 50, 20, 20, 20], 8.27 / 270
CAN_COUNTS, CAN_RATIO, CAN_RATED = 2**17, [50] * 6, [2.0, 4.0, 2.0, 0.5, 0.4, 0.4]
# In an order of their own, as drivers send them.
ROS_ORDER = [2, 1, 0, 3, 4, 5]


def joint_names():
    urdf = (DEMO / 'puma560.urdf').read_text()
    return re.findall(r'<joint name="([^"]+)" type="(?:revolute|continuous|prismatic)"', urdf)


def rows_of(log):
    lines = log.read_text().split('\n')[1:]
    rows = [[float(field) for field in line.split(',')] for line in lines if line][::2]
    return [(row[0], row[1:1 + JOINTS], row[1 + JOINTS:1 + 2 * JOINTS]) for row in rows if row[0] < SECONDS]


def table(path, header, rows, separator=','):
    path.write_text(header + '\n' + '\n'.join(separator.join(f'{x:.10g}' for x in row) for row in rows) + '\n')


def velocities(rows):
    out = []
    for k in range(len(rows)):
        before, after = rows[max(k - 1, 0)], rows[min(k + 1, len(rows) - 1)]
        out.append([(b - a) / (after[0] - before[0]) for a, b in zip(before[1], after[1])])
    return out


def universal_robots(folder, rows):
    names = ['timestamp'] + [f'actual_q_{j}' for j in range(JOINTS)] + [f'actual_current_{j}' for j in range(JOINTS)]
    table(folder / 'ur.csv', ' '.join(names), [[1e5 + t, *q, *(x / g for x, g in zip(tau, UR_GAINS))] for t, q, tau in rows], ' ')


def franka(folder, rows):
    part = lambda name: ', '.join(f'{name}[{j}]' for j in range(JOINTS))
    header = 'time, success_rate, ' + ','.join(map(part, ('state.q', 'state.q_d', 'state.dq', 'state.tau_J', 'state.tau_ext_hat_filtered',
                                                           'cmd.tau_J_d')))
    table(folder / 'franka.csv', header,
          [[1000 * t, 1, *q, *q, *dq, *tau, *[0.1] * JOINTS, *[0.0] * JOINTS] for (t, q, tau), dq in zip(rows, velocities(rows))])


def kuka(folder, rows):
    axes = lambda tag, values: f'<{tag} ' + ' '.join(f'A{j + 1}="{x:.6f}"' for j, x in enumerate(values)) + ' />'
    (folder / 'rsi.xml').write_text(''.join(
        '<Rob Type="KUKA"><RIst X="0.0" Y="0.0" Z="0.0" A="0.0" B="0.0" C="0.0" />' + axes('AIPos', [math.degrees(x) for x in q]) +
        axes('MACur', [x / g for x, g in zip(tau, KUKA_GAINS)]) + f'<Delay D="0" /><IPOC>{4208163634 + round(1000 * t)}</IPOC></Rob>\n'
        for t, q, tau in rows))


def staubli(folder, rows):
    lines = []
    for t, q, tau in rows:
        motor_q = [sum(n * x for n, x in zip(row, q)) for row in STAUBLI]
        motor_tau = [0.0] * JOINTS
        for j in reversed(range(JOINTS)):  # N^T is upper triangular
            motor_tau[j] = (tau[j] - sum(STAUBLI[k][j] * motor_tau[k] for k in range(j + 1, JOINTS))) / STAUBLI[j][j]
        lines.append(','.join(f'{x:.10g}' for x in [t, *motor_q, *motor_tau]))
    (folder / 'staubli.csv').write_text('\n'.join(lines) + '\n')


def ros_2(folder, rows):
    names = [joint_names()[j] for j in ROS_ORDER]
    pick = lambda values: [values[j] for j in ROS_ORDER]
    (folder / 'my_bag').mkdir()
    (folder / 'my_bag/metadata.yaml').write_text('rosbag2_bagfile_information:\n  relative_file_paths:\n    - my_bag_0.db3\n')
    messages = []
    for (t, q, tau), dq in zip(rows, velocities(rows)):
        stamp = 1700000000 * 10**9 + round(t * 1e9)
        messages.append((stamp + 200000, ros2_bags.joint_state(stamp, names, pick(q), pick(dq), pick(tau))))
    ros2_bags.database(folder / 'my_bag/my_bag_0.db3', messages)


def matlab(folder, rows):
    matrix = matlab_files.matrix
    # A row a joint, but for the torque.
    (folder / 'run1.mat').write_bytes(matlab_files.file(
        matrix('time', [[row[0]] for row in rows]), matrix('q', list(zip(*(row[1] for row in rows)))),
        matrix('qd', list(zip(*velocities(rows)))), matrix('torque', [row[2] for row in rows]), matrix('rate', [[250.0]])))


def lerobot(folder, rows):
    """Version 3: two episodes in one file, of floats; the first is the whole motion. Names are beside it."""
    episodes = [rows, rows[:len(rows) // 2]]
    of = lambda value: [value(e, row, k) for e, some in enumerate(episodes) for k, row in enumerate(some)]
    columns = {
        'observation.state': (parquet_files.FLOAT, of(lambda e, row, k: row[1])),
        'observation.effort': (parquet_files.FLOAT, of(lambda e, row, k: row[2])),
        'action': (parquet_files.FLOAT, of(lambda e, row, k: [x + 0.1 for x in row[1]])),
        'timestamp': (parquet_files.FLOAT, of(lambda e, row, k: row[0])),
        'frame_index': (parquet_files.INT64, of(lambda e, row, k: k)),
        'episode_index': (parquet_files.INT64, of(lambda e, row, k: e))}
    chunk = folder / 'my_data/data/chunk-000'
    chunk.mkdir(parents=True)
    (chunk / 'file-000.parquet').write_bytes(parquet_files.file(columns))
    (folder / 'my_data/meta').mkdir()
    names = [f'{name}.pos' for name in joint_names()]
    (folder / 'my_data/meta/info.json').write_text(json.dumps(
        {'codebase_version': 'v3.0', 'fps': 250, 'features': {'observation.state': {'dtype': 'float32', 'shape': [JOINTS], 'names': names},
                                                             'action': {'dtype': 'float32', 'shape': [JOINTS], 'names': names}}}))


def odrive(folder, rows):
    names = ['t'] + [f'pos{j + 1}' for j in range(JOINTS)] + [f'iq{j + 1}' for j in range(JOINTS)]
    table(folder / 'odrive.csv', ','.join(names), [[t, *(x * r / (2 * math.pi) for x, r in zip(q, ODRIVE_RATIO)),
                                                    *(x / r / ODRIVE_CONSTANT for x, r in zip(tau, ODRIVE_RATIO))] for t, q, tau in rows])


def moteus(folder, rows):
    names = ['time'] + [f'{signal}_{j + 1}' for signal in ('position', 'velocity', 'torque') for j in range(JOINTS)]
    turns = lambda values: [x / (2 * math.pi) for x in values]
    table(folder / 'moteus.csv', ','.join(names), [[t, *turns(q), *turns(dq), *tau] for (t, q, tau), dq in zip(rows, velocities(rows))])


def can_sniffer(folder, rows):
    lines = []
    for t, q, tau in rows:
        lines.append(f'({1700000000 + t:.6f}) can0 080#')
        for j in range(JOINTS):
            counts = round(q[j] / (2 * math.pi) * CAN_COUNTS * CAN_RATIO[j])
            per_mille = round(tau[j] / CAN_RATIO[j] / CAN_RATED[j] * 1000)
            data = struct.pack('<ih', counts, per_mille).hex().upper()
            lines.append(f'({1700000000 + t + 0.0001 * (j + 1):.6f}) can0 {0x181 + j:03X}#{data}')
    (folder / 'bus.log').write_text('\n'.join(lines) + '\n')


KINDS = {'Universal Robots (RTDE)': universal_robots, 'Franka (libfranka)': franka, 'KUKA (RSI)': kuka, 'Staubli': staubli,
         'ROS 2': ros_2, 'MATLAB and HDF5': matlab, 'Parquet and LeRobot': lerobot,
         'ODrive': odrive, 'moteus': moteus, 'A CAN sniffer (CiA 402)': can_sniffer}


def commands_of(page):
    """The sh blocks of each section."""
    out = {}
    for part in re.split(r'^## ', page, flags=re.M)[1:]:
        title = part.split('\n', 1)[0]
        out[title] = '\n'.join(re.findall(r'^```sh\n(.*?)^```', part, flags=re.M | re.S))
    return out


def run(command, folder, program):
    path = f'{program.parent}:/usr/bin:/bin'
    return subprocess.run(['bash', '-euo', 'pipefail', '-c', command], cwd=folder, capture_output=True, text=True, timeout=120,
                          env={'PATH': path, 'HOME': str(folder)})


def failures_of(title, commands, make, rows, program, work):
    folder = work / re.sub(r'\W+', '_', title)
    folder.mkdir()
    (folder / 'robot.urdf').write_text((DEMO / 'puma560.urdf').read_text())
    make(folder, rows)
    done = run(commands, folder, program)
    said = done.stdout + done.stderr
    if done.returncode != 0:
        return [f'{title}: exit code {done.returncode}: {said[-1500:]}']
    return [f'{title}: {wrong}' for wrong in read_differently(said, rows)]


def read_differently(said, rows):
    """What check has read of each joint, against the robot's motion and torque. That signs are right, check says itself."""
    for j in range(JOINTS):
        line = re.search(rf'^joint_{j + 1} +(\S+) +\.\. (\S+) +rad .* ([\d.e-]+) +\d+ %$', said, flags=re.M)
        if not line:
            yield f'check tells nothing of joint {j + 1}'
            continue
        q, tau = [row[1][j] for row in rows], [row[2][j] for row in rows]
        read, true = [float(line[k]) for k in (1, 2, 3)], [min(q), max(q), max(map(abs, tau))]
        if any(abs(a - b) > TOLERANCE * max(map(abs, true[:2] if k < 2 else true[2:])) for k, (a, b) in enumerate(zip(read, true))):
            yield f'joint {j + 1} is read as {read}, the robot has {true}'


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    commands = commands_of(PAGE.read_text())
    failures = [f'{title}: no such section on the page' for title in KINDS if title not in commands]
    failures += [f'{title}: has no made-up file in this test' for title, text in commands.items() if text and title not in KINDS]
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        done = run(f'fxdyn simulate {DEMO}/scenario.toml --out logs', work, program)
        if done.returncode != 0:
            sys.exit(done.stderr)
        rows = rows_of(work / 'logs/train_fast_1.csv')
        for title, make in KINDS.items():
            if title in commands:
                failures += failures_of(title, commands[title], make, rows, program, work)
    print('\n'.join(failures) or f'{len(KINDS)} kinds of logs read')
    return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
