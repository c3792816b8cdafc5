#!/usr/bin/env python3
"""slurm_test.py FXDYN [--kills N] [--robots N]: a fleet on the Slurm that runs (one_node_slurm.sh starts one) comes to the
bytes that it has without. kill -9 of controller, workers and submitter at random moments; the time against processes of
this machine. Exit code 77: FXDYN_SLURM_ROOT, the folder of Slurm's packages, is not set."""
import argparse
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import figures
import small_fleet

HERE = pathlib.Path(__file__).resolve().parent
PROGRAM = ["--program", str(HERE / "fake_program.sh")]


def workers(folder):
    """Processes of this folder's fleet only."""
    found = []
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if "fleet-worker" in words and str(folder / "out") in words:
            found.append(int(process.name))
    return found


def killed_run(fxdyn, folder, env, kills, victims, draw):
    """Kills, then lets it end; what was killed."""
    words = [fxdyn, "fleet", str(folder / "fleet.toml"), "--out", str(folder / "out"), "--slurm", "--chunk-size", "2"]
    start = lambda: subprocess.Popen([*words, *PROGRAM], env={**os.environ, **env}, stdout=subprocess.DEVNULL)
    submitter, done = start(), []
    while len(done) < kills and submitter.poll() is None:
        time.sleep(draw.uniform(0.5, 4))
        what = draw.choice(victims)
        if what == "controller":
            subprocess.run([os.environ["SLURM_TEST_CONTROLLER"]], check=True)
        elif what == "submitter":
            submitter.kill()
            submitter.wait()
            submitter = start()
        else:
            running = workers(folder)
            if not running:
                continue
            try:
                os.kill(draw.choice(running), signal.SIGKILL)
            except ProcessLookupError:
                continue
        done.append(what)
    if submitter.wait() != 0:
        sys.exit(f"FAILED: exit code {submitter.returncode} after {done}")
    return done


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fxdyn")
    parser.add_argument("--kills", type=int, default=3)
    parser.add_argument("--what", nargs="+", default=["controller", "worker", "submitter"], help="is killed")
    parser.add_argument("--robots", type=int, default=12)
    parser.add_argument("--time", action="store_true", help="only the time against processes of this machine")
    options = parser.parse_args()
    fxdyn = os.path.abspath(options.fxdyn)
    if "SLURM_TEST_CONTROLLER" not in os.environ:
        if "FXDYN_SLURM_ROOT" not in os.environ:
            sys.exit(77)
        with tempfile.TemporaryDirectory() as state:
            sys.exit(subprocess.run([HERE / "one_node_slurm.sh", os.environ["FXDYN_SLURM_ROOT"], state, sys.executable,
                                     __file__, *sys.argv[1:]]).returncode)
    with tempfile.TemporaryDirectory() as temporary:
        folder = small_fleet.make_folder(temporary)
        figures.copies(fxdyn, folder, options.robots)
        subprocess.run([fxdyn, "diagnose", folder / "well.toml", "--out", folder / "results"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(folder / "fleet.toml", "a") as file:
            file.write("[limits]\ntime_s = 5\n")  # a second's work; how long a task is believed to run that does not
        env = {"FAKE_RESULTS": str(folder / "results"), "FAKE_SECONDS": "1"}
        here_s, *_ = figures.fleet(fxdyn, folder, *PROGRAM, env=env)
        expected = (folder / "out/fleet.json").read_bytes()
        shutil.rmtree(folder / "out")
        if options.time:
            there_s, *_ = figures.fleet(fxdyn, folder, "--slurm", *PROGRAM, env=env)
            print(f"{options.robots} projects of a second: {here_s:.1f} s here, {there_s:.1f} s by Slurm: "
                  f"{there_s / here_s:.2f} times")
        else:
            print("killed:", *killed_run(fxdyn, folder, env, options.kills, options.what, random.Random(7)))
        if (folder / "out/fleet.json").read_bytes() != expected:
            sys.exit("FAILED: other bytes")
        print("the same bytes")


if __name__ == "__main__":
    main()
