#!/usr/bin/env python3
"""Stands in for `fxdyn diagnose`: reads the truth beside the case and says it, so that campaign and scorer can be tried
without a diagnosis (campaign --program tests/diagnosis/oracle.py). MODE=wrong|silent|crash in ORACLE changes what it says."""
import json
import os
import shutil
import sys

project, out = sys.argv[2], sys.argv[4]
case = os.path.dirname(os.path.dirname(os.path.abspath(project)))
truth_dir = os.path.join(os.path.dirname(os.path.dirname(case)), "truth", os.path.basename(case))
truth = json.load(open(os.path.join(truth_dir, "truth.json")))
mode = os.environ.get("ORACLE", "right")
if mode == "crash":
    os.abort()
joints = [{"index": i + 1, "verdict": "nothing_missing", "effects": []} for i in range(len(truth["rated_torque"]))]
robot = []
for number, effect in enumerate(truth["effects"] if mode != "silent" else []):
    name = effect["effect"] if mode == "right" else "offset"
    entry = {"effect": name, "score": 100.0 - number, "alternatives": []}
    if effect.get("outside") and mode == "right":
        joints[effect["joint"] - 1]["verdict"] = "unexplained"
    elif "joint" in effect:
        joints[effect["joint"] - 1]["effects"].append(entry)
        joints[effect["joint"] - 1]["verdict"] = "effects_found"
    else:
        robot.append(entry)
verdicts = {j["verdict"] for j in joints} | ({"effects_found"} if robot else set())
verdict = next((v for v in ("unexplained", "effects_found") if v in verdicts), "nothing_missing")
os.makedirs(out, exist_ok=True)
baseline = os.path.join(truth_dir, "baseline.json")
measured = os.path.join(truth_dir, "measured.json")
shutil.copy(baseline if os.path.exists(baseline) else measured, os.path.join(out, "nominal.json"))
shutil.copy(measured, os.path.join(out, "model.json"))
json.dump({"schema": "fxdyn.diagnosis/1", "verdict": verdict, "joints": joints, "robot_effects": robot},
          open(os.path.join(out, "diagnosis.json"), "w"))
