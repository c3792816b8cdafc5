#!/usr/bin/env python3
"""check.py BENCH: runs the benchmarks, prints them, and fails where fxdyn is slower than asked beside its peers.

Only ratios of processor times within one run are checked: they hold on any machine, times do not."""
import json
import subprocess
import sys

LIMITS = [("rnea_fxdyn", "rnea_kdl", 0.6), ("rnea_fxdyn", "rnea_mujoco", 0.4), ("regressor_fxdyn", "rnea_kdl", 1.15),
          ("ridge_sweep_moments", "ridge_sweep_dense", 0.1), ("held_out_sweep", "held_out_sweep_dense_from_motion", 0.1),
          ("held_out_sweep", "held_out_sweep_dense", 0.35)]

run = subprocess.run([sys.argv[1], "--benchmark_format=json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
times = {}
for entry in json.loads(run.stdout)["benchmarks"]:
    times[entry["name"].split("/")[0]] = entry["cpu_time"]
    print(f"{entry['name']:<50} {entry['real_time']:10.1f} {entry['time_unit']}")
failed = False
for ours, peer, limit in LIMITS:
    ratio = times[ours] / times[peer]
    print(f"{ours} / {peer}: {ratio:.3f} (at most {limit})")
    failed |= ratio > limit
sys.exit(failed)
