#!/usr/bin/env python3
"""measured_mistakes.py FXDYN [--only SET]: puts mistakes into the measured robots' logs, one at a time, and counts which of them
`fxdyn check` finds. The mistakes are made by the project's keys: the check reads the wrong data as it would from a wrong file.

found: something is said of columns, signs, zeros, gravity, gains or units; named: the mistake itself is, first or after an "or".
Two URDFs for each robot: as published, without masses; and with the masses that `identify` finds in another part of the logs,
where each link is then 30 % too heavy or too light in turns. Needs FXDYN_DATA."""

import argparse
import collections
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

JOINTS = 6
# name, URDF, windows for the masses, windows that are checked: file, from, to [s]
SETS = {
    "UR10": ("ur10_unisa/ur10.urdf", [("ur10_unisa/exciting_trajectory.csv", 0, 9)], [("ur10_unisa/exciting_trajectory.csv", 9, 27)]),
    "TX40": ("staubli_tx40/staubli_tx40.urdf", [("staubli_tx40/excitation_9s_5kHz.csv", 0, 4)],
             [("staubli_tx40/excitation_9s_5kHz.csv", 4, 9)]),
    "KR300": ("kuka_kr300/kuka_kr300.urdf", [("kuka_kr300/traj_A_train.csv", None, None)],
              [("kuka_kr300/traj_B_train.csv", None, None), ("kuka_kr300/traj_C_validation.csv", None, None)]),
}
ZERO, TURN, GAIN = math.radians(30), math.radians(45), 1.5  # the issue's: at least 20 degrees, 30 degrees, 30 %
KINDS = {"swapped_joints", "swapped_motion", "swapped_torques", "mirrored_motion", "mirrored_torque", "mirrored_joint", "zero", "axis",
         "gravity", "torque_gain", "torque_unit", "position_unit", "torque_lead", "exchanged"}


def ones(joint, value):
    return [value if j == joint else 1.0 for j in range(JOINTS)]


def columns(signals, a, b):
    """Keys that give joint a the columns of b, and b those of a."""
    order = list(range(1, JOINTS + 1))
    order[a], order[b] = order[b], order[a]
    return {"columns": "{ " + ", ".join(f"{s} = [" + ", ".join(f'"{s}{j}"' for j in order) + "]" for s in signals) + " }"}


def mistakes(has_dq):
    """(kind, what `check` has to say of it, keys of [signals], gravity); the joint is part of the words."""
    motion = ["q", "dq"] if has_dq else ["q"]
    for j in range(JOINTS):
        mirrored, name = ones(j, -1.0), f"joint {j + 1} ("
        yield "mirrored joint", [("mirrored_joint", name)], {"position_gain": mirrored, "torque_gain": mirrored}, None
        yield "mirrored motion", [("mirrored_motion", name)], {"position_gain": mirrored}, None
        yield "mirrored torque", [("mirrored_torque", name)], {"torque_gain": mirrored}, None
        for sign in (1, -1):
            offset = [sign * ZERO if k == j else 0.0 for k in range(JOINTS)]
            yield "zero, 30 degrees", [("zero", name)], {"position_offset": offset}, None
        for gain in (GAIN, 1 / GAIN):
            yield "gain, factor 1.5", [("torque_gain", name)], {"torque_gain": ones(j, gain)}, None
        yield "degrees", [("position_unit", name)], {"position_gain": ones(j, 180 / math.pi)}, None
        for other in range(j + 1, JOINTS):
            pair = f"joint {j + 1} ("
            yield "swapped joints", [("swapped_joints", pair)], columns([*motion, "tau"], j, other), None
            yield "swapped torques", [("swapped_torques", pair)], columns(["tau"], j, other), None
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        gravity = [9.81 * math.sin(TURN) * x, 9.81 * math.sin(TURN) * y, -9.81 * math.cos(TURN)]
        yield "gravity, 45 degrees", [("gravity", "gravity")], {}, gravity


def project(urdf, logs, signals, gravity, role):
    lines = ["[robot]", f'urdf = "{urdf}"']
    if gravity:
        lines.append(f"gravity = {gravity}")
    lines.append("[signals]")
    lines += [f"{key} = {value}" for key, value in signals.items()]
    for file, begin, end in logs:
        lines += ["[[log]]", f'file = "{file}"', f'role = "{role}"']
        if begin is not None:
            lines += [f"from_s = {begin}", f"to_s = {end}"]
    return "\n".join(lines) + "\n"


def findings(program, folder, text):
    file = folder / "project.toml"
    file.write_text(text)
    result = subprocess.run([program, "check", file, "--json"], capture_output=True, text=True, check=False)
    if result.returncode not in (0, 1):
        raise SystemExit(f"{file}: exit code {result.returncode}: {result.stderr}")
    return [f for f in json.loads(result.stdout)["findings"] if f["kind"] in KINDS]


WORDS = {"mirrored_joint": "looks mirrored", "mirrored_motion": "runs against", "mirrored_torque": "has the wrong sign",
         "zero": "the zero of", "torque_gain": "times too", "position_unit": "is not in", "swapped_joints": "the columns of",
         "swapped_torques": "torques of", "gravity": "gravity points"}


def names(found, kind, name):
    """Whether a finding, or an "or" of it, is the mistake: both the words of its kind and the joint in one part."""
    for finding in found:
        parts = re.split(r"; or ", finding["text"])
        if any(WORDS[kind] in part and name in part for part in parts):
            return True
    return False


def with_masses(program, folder, urdf, logs):
    """The URDF that `identify` writes, each link's mass and inertia 30 % off, up and down in turns."""
    file = folder / "masses.toml"
    file.write_text(project(urdf, logs, {}, None, "train"))
    out = folder / "masses"
    subprocess.run([program, "identify", file, "--out", out], capture_output=True, text=True, check=True)
    text, count = (out / "identified.urdf").read_text(), 0

    def scaled(block):
        nonlocal count
        factor, count = (1.3 if count % 2 == 0 else 0.7), count + 1
        return re.sub(r'((?:value|i[xyz]{2})=")([^"]*)"', lambda m: f'{m[1]}{float(m[2]) * factor:.9g}"', block[0])

    changed = folder / "off.urdf"
    changed.write_text(re.sub(r"<inertial>.*?</inertial>", scaled, text, flags=re.S))
    return changed


def count_set(program, folder, urdf, logs, has_dq):
    tally = collections.defaultdict(lambda: [0, 0, 0])
    sound = findings(program, folder, project(urdf, logs, {}, None, "train"))
    tally["none"] = [1, len(sound), 0]
    for finding in sound:
        print("  without a mistake:", finding["text"])
    for kind, said, signals, gravity in mistakes(has_dq):
        found = findings(program, folder, project(urdf, logs, signals, gravity, "train"))
        named = any(names(found, *one) for one in said)
        for i, value in enumerate((1, bool(found), named)):
            tally[kind][i] += value
        if not named:
            print(f"  {kind} {signals or gravity}: {[f['text'] for f in found]}")
    return tally


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--only", choices=SETS)
    arguments = parser.parse_args()
    data = pathlib.Path(os.environ["FXDYN_DATA"])
    for name, (urdf, of_masses, checked) in SETS.items():
        if arguments.only not in (None, name):
            continue
        windows = [[(data / file, *window) for file, *window in logs] for logs in (of_masses, checked)]
        has_dq = "dq1" in (data / checked[0][0]).open().readline()
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for label, used in (("without masses", data / urdf), ("masses 30 % off", with_masses(arguments.program, folder, data / urdf, windows[0]))):
                tally = count_set(arguments.program, folder, used, windows[1], has_dq)
                print(f"{name}, {label}")
                for kind, (cases, found, named) in tally.items():
                    print(f"  {kind:<22}{cases:>5} found {found:>3} named {named:>3}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
