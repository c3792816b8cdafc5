#!/usr/bin/env python3
"""memory_test.py FXDYN [--two-million]: what a row more of a log costs a diagnosis in memory. Columns at full rate that
are held all at once, a copy of a log, or rows kept for every candidate show in the difference of two logs' peaks. Logs
beyond what a diagnosis has room for are searched in windows: what a row costs there is its own columns.
--two-million: the peak and the time with 2 000 000 rows of six joints instead, and the time with 200 000 (4 min, and
2.5 GB for the simulated log)."""
import os
import subprocess
import sys
import tempfile
import time

FXDYN = os.path.abspath(sys.argv[1])
ROWS = (20_000, 60_000)
LONG_ROWS = (250_000, 400_000)  # beyond what a diagnosis has room for at 80 rows a second: it looks at windows
MOST = 1600  # bytes a row of two joints: 1290 measured, 1670 with a motion for each linearisation
LONG_MOST = 560  # likewise, of which a search sees windows only: 440 measured
MANY_ROWS = (200_000, 2_000_000)
MANY_MOST = 500e6  # bytes, six joints
MANY_TIMES = 4  # the time of the fewer: 1.9 measured

SCENARIO = """seed = 2
[robot]
urdf = "../arm.urdf"
rated_torque = [60, 20]
acceleration = [8, 8]
[sensors]
sample_s = 0.002
encoder_bits = 18
torque_noise = 0.01
[[effect]]
name = "viscous"
joint = "all"
parameters = {{ coefficient = 1.0 }}
[[effect]]
name = "coulomb"
joint = "all"
parameters = {{ amplitude = 1.5, width = 0.02 }}
[[effect]]
name = "presliding"
joint = 1
parameters = {{ distance = 0.004, amplitude = 1.5 }}
[[log]]
name = "long"
duration_s = {seconds}
period_s = 10
speed = 0.8
seed = 1
[[log]]
name = "short"
duration_s = 20
period_s = 10
speed = 0.7
seed = 2
"""

# Windows, errors and figures as ever; what the search itself takes is in the short logs.
NO_SEARCH = """[signals]
torque_cutoff_hz = 40
[diagnose]
max_effects = 0
"""

PROJECT = """[robot]
urdf = "arm.urdf"
rated_torque = [60, 20]
[identify]
effects = ["viscous", "coulomb", "offset", "rotor_inertia"]
[[log]]
file = "{rows}/long.csv"
role = "train"
[[log]]
file = "{rows}/short.csv"
role = "test"
"""

URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/>
<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
</robot>
"""


def peak_bytes(command):
    """Runs it; the most memory that it held."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        sys.exit(f"FAILED: {' '.join(command)}: {errors}")
    return 1024 * usage.ru_maxrss


def bytes_of_row(work, sizes, more):
    """Of the longer log, beside the shorter one. more: lines of the project."""
    def write(name, text):
        path = os.path.join(work, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    write("arm.urdf", URDF)
    peaks = []
    for rows in sizes:
        scenario = write(f"{rows}/scenario.toml", SCENARIO.format(seconds=rows * 0.002))
        peak_bytes([FXDYN, "simulate", scenario, "--out", os.path.join(work, str(rows))])
        project = write(f"{rows}.toml", PROJECT.format(rows=rows) + more)
        peaks.append(peak_bytes([FXDYN, "diagnose", project, "--out", os.path.join(work, f"out{rows}")]))
        print(f"{rows} rows: {peaks[-1] / 1e6:.0f} MB", flush=True)
    return (peaks[1] - peaks[0]) / (sizes[1] - sizes[0])


UR10 = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "excite", "ur10_like.urdf")


def six_joints(text):
    return text.replace("[60, 20]", "[330, 330, 150, 54, 54, 54]").replace("[8, 8]", "[8, 8, 8, 8, 8, 8]")


def two_million():
    seconds = []
    with tempfile.TemporaryDirectory() as work:
        os.symlink(os.path.abspath(UR10), os.path.join(work, "arm.urdf"))
        for rows in MANY_ROWS:
            os.mkdir(os.path.join(work, str(rows)))
            scenario, project = os.path.join(work, str(rows), "scenario.toml"), os.path.join(work, f"{rows}.toml")
            with open(scenario, "w", encoding="utf-8") as file:
                file.write(six_joints(SCENARIO.format(seconds=rows * 0.002)))
            with open(project, "w", encoding="utf-8") as file:
                file.write(six_joints(PROJECT.format(rows=rows)))
            peak_bytes([FXDYN, "simulate", scenario, "--out", os.path.join(work, str(rows))])
            start = time.monotonic()
            peak = peak_bytes([FXDYN, "diagnose", project, "--out", os.path.join(work, f"out{rows}")])
            seconds.append(time.monotonic() - start)
            print(f"{rows} rows: {peak / 1e6:.0f} MB, {seconds[-1]:.0f} s", flush=True)
    return peak > MANY_MOST or seconds[1] > MANY_TIMES * seconds[0]


def main():
    if "--two-million" in sys.argv:
        sys.exit(two_million())
    failed = False
    for sizes, more, most in (ROWS, "", MOST), (LONG_ROWS, NO_SEARCH, LONG_MOST):
        with tempfile.TemporaryDirectory() as work:
            of_row = bytes_of_row(work, sizes, more)
        print(f"{of_row:.0f} bytes a row more, at most {most}")
        failed |= of_row > most
    sys.exit(failed)


if "--two-million" not in sys.argv:
    os.environ["FXDYN_THREADS"] = "1"  # each thread holds columns of its own
main()
