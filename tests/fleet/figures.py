#!/usr/bin/env python3
"""figures.py FXDYN overhead|parallel|planted [--robots N] [--folder DIR]: the figures of docs/guide/fleet.md.

overhead   N projects whose program only copies results: time a project beyond that program's own, restart with all done,
           memory of the parent
parallel   N projects of real size (the demo's PUMA 560, six joints, 60 s of train and 40 s of validate logs at 500 Hz), one at
           a time and two: how far two are from twice as fast
planted    N robots of which a few drift, in three kinds: how many are found, and how many are listed that do not
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import small_fleet

HERE = pathlib.Path(__file__).resolve().parent


def fleet(program, folder, *words, env=None, out="out"):
    """Wall time [s], processor time [s] and peak memory [MB] of it and of its programs, exit code."""
    started = time.monotonic()
    process = os.spawnvpe(os.P_NOWAIT, program, [program, "fleet", str(folder / "fleet.toml"), "--out",
                                                 str(folder / out), *words], {**os.environ, **(env or {})})
    _, status, usage = os.wait4(process, 0)
    return time.monotonic() - started, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)


def copies(program, folder, count):
    """One robot's logs under so many projects."""
    small_fleet.make_robot(program, folder, "well", 1)
    text = (folder / "well.toml").read_text()
    for k in range(count):
        (folder / f"r{k:04}.robot").write_text(text + f"# {k}\n")
    (folder / "fleet.toml").write_text('projects = "*.robot"\n')


def seconds_alone(folder, env, runs=100):
    started = time.monotonic()
    for k in range(runs):
        subprocess.run([HERE / "fake_program.sh", "diagnose", folder / "well.toml", "--out", folder / "alone" / str(k)],
                       env={**os.environ, **env}, check=True)
    return (time.monotonic() - started) / runs


def overhead(program, folder, count):
    copies(program, folder, count)
    os.spawnvp(os.P_WAIT, program, [program, "diagnose", str(folder / "well.toml"), "--out", str(folder / "results")])
    words = ["--program", str(HERE / "fake_program.sh"), "--jobs", "1"]
    env = {"FAKE_RESULTS": str(folder / "results")}
    # Others work on these cores, too: the program alone is timed right before and right after.
    alone_s = [seconds_alone(folder, env)]
    first_s, first_own_s, first_mb, code = fleet(program, folder, *words, env=env)
    alone_s.append(seconds_alone(folder, env))
    # Files that changed less than 3 s before they were read are read once more.
    fleet(program, folder, *words, env=env)
    again_s, again_own_s, again_mb, code_again = fleet(program, folder, *words, env=env)
    if (code, code_again) != (0, 0):
        sys.exit(f"exit codes {code}, {code_again}")
    print(f"{count} projects: {first_s / count:.4f} s a project, the copying program alone {sum(alone_s) / 2:.4f} s, overhead "
          f"{first_s / count - sum(alone_s) / 2:.4f} s; processor time of both {first_own_s / count:.4f} s; restart with all done {again_s:.2f} s, of which it computes "
          f"{again_own_s:.2f} s; memory {max(first_mb, again_mb):.0f} MB")


def parallel(program, folder, count):
    demo = HERE.parent.parent / "host_tools/demo"
    for name in ("puma560.urdf", "scenario.toml"):
        shutil.copy(demo / name, folder)
    subprocess.run([program, "simulate", "scenario.toml", "--out", "."], cwd=folder, check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    roles = {"train_fast_1": "train", "train_fast_2": "train", "train_slow": "train", "validate_fast": "validate",
             "validate_slow": "validate"}
    text = '[robot]\nurdf = "puma560.urdf"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\n' + "".join(
        f'[[log]]\nfile = "{log}.csv"\nrole = "{role}"\n' for log, role in roles.items())
    for k in range(count):
        (folder / f"r{k:04}.robot").write_text(text + f"# {k}\n")
    (folder / "fleet.toml").write_text('projects = "*.robot"\n')
    wall, computed, busy = {}, {}, {}
    for jobs in (1, 2):
        out = f"out{jobs}"
        wall[jobs], computed[jobs], _, code = fleet(program, folder, "--jobs", str(jobs), env={"FXDYN_THREADS": "1"},
                                                    out=out)
        if code != 0:
            sys.exit(f"exit code {code}")
        seconds = [json.loads(file.read_text())["seconds"] for file in (folder / out).glob("robots/*/timing.json")]
        busy[jobs] = sum(seconds) / (jobs * wall[jobs])
        print(f"{count} projects, {jobs} at a time: {wall[jobs]:.1f} s, processor {computed[jobs] / count:.2f} s a project, "
              f"{100 * busy[jobs]:.1f} % of the time at work; load of the machine {os.getloadavg()[0]:.1f}")
    print(f"two at a time: {wall[1] / wall[2] / 2:.3f} of twice as fast; without what others took of the cores: "
          f"{computed[1] / computed[2] * busy[2] / busy[1]:.3f}")


def planted(program, folder, count, of_logs):
    kinds = sorted(small_fleet.DRIFTS)
    every = max(1, count // 12)
    drifts = {f"r{k:04}": kinds[k // every % len(kinds)] for k in range(0, count, every)}
    if len(drifts) > 12:
        drifts = dict(list(drifts.items())[:12])
    for k in range(count):
        name = f"r{k:04}"
        small_fleet.make_robot(program, folder, name, k + 1, drifts.get(name), **of_logs)
    (folder / "fleet.toml").write_text('projects = "r*.toml"\n')
    fleet(program, folder)
    result = json.loads((folder / "out/fleet.json").read_text())
    listed = {robot["id"] for robot in result["robots"] if robot["drifts"]}
    for robot in result["robots"]:
        if robot["drifts"] != (robot["id"] in drifts) or robot["error"]:
            print(robot["id"], drifts.get(robot["id"]), json.dumps(robot))
    print(f"{count} robots, {len(drifts)} drift in {len(kinds)} kinds: {len(listed & set(drifts))} found, "
          f"{len(listed - set(drifts))} falsely listed, {result['failed']} failed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fxdyn")
    parser.add_argument("figure", choices=["overhead", "parallel", "planted"])
    parser.add_argument("--robots", type=int)
    parser.add_argument("--duration", type=float, default=10, help="of each of a session's three logs [s] (planted)")
    parser.add_argument("--sample", type=float, default=0.005, help="their sampling time [s] (planted)")
    parser.add_argument("--folder", help="is kept; default: a temporary one")
    options = parser.parse_args()
    program = os.path.abspath(options.fxdyn)
    with tempfile.TemporaryDirectory() as temporary:
        folder = small_fleet.make_folder(options.folder or temporary)
        if options.figure == "overhead":
            overhead(program, folder, options.robots or 1000)
        if options.figure == "parallel":
            parallel(program, folder, options.robots or 100)
        if options.figure == "planted":
            planted(program, folder, options.robots or 200,
                    {"duration_s": options.duration, "sample_s": options.sample})


if __name__ == "__main__":
    main()
