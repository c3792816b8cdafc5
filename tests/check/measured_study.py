#!/usr/bin/env python3
"""measured_study.py FXDYN CHECK_TOLD: mistakes put into the projects of the measured robots, which of them the data show at all
(check_told), and which of them `fxdyn check` names. Needs FXDYN_DATA; without it the test is skipped (exit code 77). The figures
stand in docs/guide/check.md; fewer than there fail."""

import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SETS = {
    "UR10": ("ur10_unisa/ur10.urdf", ["ur10_unisa/exciting_trajectory.csv"], "to_s = 19.0\n"),
    "TX40": ("staubli_tx40/staubli_tx40.urdf", ["staubli_tx40/excitation_9s_5kHz.csv"], "to_s = 6.0\n"),
    "KR300": ("kuka_kr300/kuka_kr300.urdf", ["kuka_kr300/traj_A_train.csv", "kuka_kr300/traj_B_train.csv"], ""),
}
JOINTS = range(1, 7)
ZERO = math.radians(30)
# What the guide says: of the cases that can be told, at least so many are named first or as an alternative, of all sets together.
LEAST = {
    "torques swapped": 15,
    "motion swapped": 15,
    "joints swapped": 8,
    "torque mirrored": 18,
    "motion mirrored": 18,
    "joint mirrored": 5,
    "degrees": 18,
    "torque times 2": 4,
    "gravity turned": 6,
}


def per_joint(joint, value, other):
    return "[" + ", ".join(str(float(value if i == joint else other)) for i in JOINTS) + "]"


def swapped(prefix, joint):
    order = [joint + 1 if i == joint else joint if i == joint + 1 else i for i in JOINTS]
    return f"{prefix} = [" + ", ".join(f'"{prefix}{i}"' for i in order) + "]"


def mistakes(signals):
    """Yields name, the kinds that are right, its joints, lines of [robot], lines of [signals]; signals: those of motion."""
    motion = [lambda joint, p=prefix: swapped(p, joint) for prefix in signals]
    for joint in list(JOINTS)[:-1]:
        pair = [joint, joint + 1]
        torque = swapped("tau", joint)
        of_motion = ", ".join(swap(joint) for swap in motion)
        yield "torques swapped", {"swapped_torques"}, pair, "", f"columns = {{ {torque} }}"
        yield "motion swapped", {"swapped_motion"}, pair, "", f"columns = {{ {of_motion} }}"
        yield "joints swapped", {"swapped_joints"}, pair, "", f"columns = {{ {of_motion}, {torque} }}"
    for joint in JOINTS:
        at = [joint]
        yield "torque mirrored", {"mirrored_torque"}, at, "", f"torque_gain = {per_joint(joint, -1, 1)}"
        yield "motion mirrored", {"mirrored_motion"}, at, "", f"position_gain = {per_joint(joint, -1, 1)}"
        yield (
            "joint mirrored", {"mirrored_joint", "axis"}, at, "",
            f"position_gain = {per_joint(joint, -1, 1)}\ntorque_gain = {per_joint(joint, -1, 1)}",
        )
        for off in (ZERO, -ZERO):
            yield "zero off by 30 degrees", {"zero"}, at, "", f"position_offset = {per_joint(joint, off, 0)}"
        yield "degrees", {"position_unit"}, at, "", f"position_gain = {per_joint(joint, math.degrees(1), 1)}"
        yield "torque times 2", {"torque_gain", "torque_unit"}, at, "", f"torque_gain = {per_joint(joint, 2, 1)}"
    for gravity in ("[9.81, 0.0, 0.0]", "[0.0, 9.81, 0.0]", "[0.0, 0.0, 9.81]"):
        yield "gravity turned", {"gravity"}, [], f"gravity = {gravity}\n", ""


def check(program, project):
    """Findings, and whether the project was refused before anything was compared."""
    run = subprocess.run([program, "check", project, "--json"], capture_output=True, text=True, check=False)
    if run.returncode != 2:
        return json.loads(run.stdout)["findings"], False
    column = re.search(r" q(\d+) looks like degrees", run.stderr)
    if not column:
        raise SystemExit(f"{project}: {run.stderr}")
    return [{"kind": "position_unit", "joint": int(column[1]), "severity": "error"}], True


def told(program, right, wrong, *more):
    """Whether the data show the mistake, and the nats that say so."""
    run = subprocess.run([program, right, wrong, *more], capture_output=True, text=True, check=True)
    nats = json.loads(run.stdout)
    return nats["gained"] >= nats["needed"], nats


class Row:
    def __init__(self):
        self.all = self.told = self.first = self.among = self.other = self.hidden = 0

    def cell(self):
        return f"{self.first} {self.among} {self.told} {self.all} ({self.hidden} {self.other})"


def judge(row, findings, kinds, joints, shows):
    """Counts one case; returns whether all is as it should be."""
    def is_right(finding):
        return finding["kind"] in kinds and (not joints or finding.get("joint") in joints)

    first = any(is_right(f) for f in findings)
    among = first or any(is_right(other) for f in findings for other in f.get("or", []))
    row.all += 1
    row.told += shows
    row.first += first and shows
    row.among += among and shows
    row.hidden += among and not shows
    row.other += bool(findings) and not among
    return first


def project_text(data, urdf, logs, window, robot="", lines=""):
    text = f'[robot]\nurdf = "{data / urdf}"\n{robot}[signals]\n{lines}\n'
    return text + "".join(f'[[log]]\nfile = "{data / log}"\nrole = "train"\n{window}' for log in logs)


def study(data, fxdyn, check_told):
    """Prints what is not named first; returns the rows by mistake and set, and the sets that get a warning without any."""
    table, warned = {}, []
    with tempfile.TemporaryDirectory() as folder:
        right, wrong = pathlib.Path(folder) / "right.toml", pathlib.Path(folder) / "wrong.toml"
        for name, (urdf, logs, window) in SETS.items():
            header = (data / logs[0]).open().readline().strip().split(",")
            signals = ["q"] + (["dq"] if "dq1" in header else [])
            right.write_text(project_text(data, urdf, logs, window))
            findings, _ = check(fxdyn, right)
            if any(f["severity"] != "note" for f in findings):
                warned.append(name)
            for what, kinds, joints, robot, lines in mistakes(signals):
                wrong.write_text(project_text(data, urdf, logs, window, robot, lines))
                findings, refused = check(fxdyn, wrong)
                shows, nats = (True, "refused") if refused else told(check_told, right, wrong)
                row = table.setdefault(what, {}).setdefault(name, Row())
                if judge(row, findings, kinds, joints, shows) or not (findings or shows):
                    continue
                if findings and not refused:  # of another mistake: does it explain them better?
                    _, nats = told(check_told, right, wrong, "all")
                said = "; ".join(f"{f['kind']} {f.get('joint')} {f.get('or', '')}" for f in findings) or "nothing"
                print(f"{name}: {what} {joints} {robot.strip()}: {nats}: {said}", flush=True)
    return table, warned


def main():
    if "FXDYN_DATA" not in os.environ:
        print("FXDYN_DATA is not set: no measured logs, skipped")
        return 77
    table, warned = study(pathlib.Path(os.environ["FXDYN_DATA"]), sys.argv[1], sys.argv[2])
    print("\nof those that can be told: named first, first or as an alternative, all; all cases (named although they can't be told, another named)")
    print(f"{'':24s}" + "".join(f"{name:>20s}" for name in SETS))
    failed = len(warned)
    for what, row in table.items():
        print(f"{what:24s}" + "".join(f"{row[name].cell():>20s}" for name in SETS))
        named = sum(row[name].among for name in SETS)
        if named < LEAST.get(what, 0):
            failed += 1
            print(f"FAILED: {what}: {named} named, {LEAST[what]} before")
        for name in (name for name in SETS if row[name].other):
            failed += 1
            print(f"FAILED: {name}: {what}: only something else named")
    for name in warned:
        print(f"FAILED: {name}: a warning without any mistake")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
