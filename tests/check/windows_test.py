#!/usr/bin/env python3
"""windows_test.py FXDYN: `fxdyn check` on windows of the measured robots' logs, also such that move little: nothing is wrong with
their columns. Needs FXDYN_DATA; without it the test is skipped (exit code 77)."""

import os
import pathlib
import subprocess
import sys
import tempfile

LOGS = [
    ("ur10_unisa/ur10.urdf", "ur10_unisa/exciting_trajectory.csv", [(0, 27), (3, 13), (9, 19), (12, 27), (15, 25)]),
    ("staubli_tx40", "staubli_tx40/excitation_9s_5kHz.csv", [(0, 4.99), (1, 7), (2, 7.4)]),
    ("kuka_kr300", "kuka_kr300/traj_A_train.csv", [None]),
    ("kuka_kr300", "kuka_kr300/traj_B_train.csv", [None]),
    ("kuka_kr300", "kuka_kr300/traj_C_validation.csv", [None]),
]


def urdf_of(data, name):
    return data / name if name.endswith(".urdf") else next((data / name).glob("*.urdf"))


def check(program, folder, urdf, log, window):
    project = folder / "project.toml"
    cut = "" if window is None else f"from_s = {window[0]}\nto_s = {window[1]}\n"
    project.write_text(f'[robot]\nurdf = "{urdf}"\n[[log]]\nfile = "{log}"\nrole = "train"\n{cut}')
    return subprocess.run([program, "check", project], capture_output=True, text=True, check=False)


def main():
    if "FXDYN_DATA" not in os.environ:
        print("FXDYN_DATA is not set: no measured logs, skipped")
        return 77
    data = pathlib.Path(os.environ["FXDYN_DATA"])
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for urdf, log, windows in LOGS:
            for window in windows:
                result = check(sys.argv[1], pathlib.Path(folder), urdf_of(data, urdf), data / log, window)
                if result.returncode != 0 or "nothing looks wrong" not in result.stdout:
                    failed += 1
                    print(f"{log} {window}: exit code {result.returncode}\n{result.stdout}{result.stderr}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
