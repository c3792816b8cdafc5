#!/usr/bin/env python3
"""next_motion_study.py FXDYN --out DIR [--cases N] [--seed S] [--jobs J]: how long a robot has to move until the effect
that it has is named, with the motion that `excite --after` plans, and with the standard one of `excite`.

A case is a robot with one hidden effect, all drawn at random from its seed, and two slow logs to fit and one to judge.
Where the diagnosis of these does not establish the effect, but leaves a question, new motion joins the train logs: so
many seconds of it that the effect is established, to the nearest of STEPS_S. Planned motion is planned again once it is
all there. Prints a table; DIR/results.json has every case."""
import argparse
import concurrent.futures
import json
import math
import os
import random
import statistics
import subprocess
import sys

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
ROBOTS = {  # URDF: rated torque, acceleration
    "tests/campaign/arm.urdf": ([60, 20], [8, 8]),
    "tests/campaign/scara.urdf": ([70, 31, 80, 4], [20, 25, 5, 40]),
    "tests/excite/ur10_like.urdf": ([165, 165, 75, 27, 27, 27], [6, 6, 8, 10, 10, 10]),
}
STEPS_S = [3, 4, 5, 6, 8, 10, 12, 14, 16, 18, 20, 25, 30, 40, 50, 60]
MOST_PLANS = 3  # one after the other
SIZE = (0.15, 1.5)  # times the torque noise: RMS of the effect in the first of the slow logs
LARGEST = 0.03  # of rated torque: at most, RMS at full speed
SIMPLE = ("viscous", "coulomb")


def effects_of(draw, limits):
    """What may be hidden at a joint: name, shapes, linear parameters of which only the common size is scaled."""
    speed, span = limits
    sine = draw.uniform(0, 2 * math.pi)
    waves = {"cos": math.cos(sine), "sin": math.sin(sine)}
    return {
        "viscous_quadratic": ({}, {"coefficient": 1}),
        "viscous_cubic": ({}, {"coefficient": 1}),
        "stribeck": ({"velocity": draw.uniform(0.02, 0.08) * speed}, {"amplitude": 1}),
        "presliding": ({"distance": min(draw.uniform(0.002, 0.01) * span, 0.02)}, {"amplitude": 1}),
        "asymmetric_friction": ({}, {"coulomb": 1, "viscous": draw.uniform(-0.5, 0.5) / speed}),
        "load_friction": ({}, {"coefficient": 1}),
        "torque_gain": ({}, {"gain": 1}),
        "ripple": ({"wavenumber": draw.uniform(6, 30) * 2 * math.pi / span}, waves),
        "spring": ({}, {"stiffness": 1, "offset": 0}),
        "gravity_compensator": ({}, waves),
    }


class Case:
    def __init__(self, fxdyn, seed, folder):
        self.fxdyn, self.seed, self.folder = fxdyn, seed, folder
        draw = random.Random(seed)
        os.makedirs(folder, exist_ok=True)
        self.urdf = draw.choice(sorted(ROBOTS))
        self.rated, self.acceleration = ROBOTS[self.urdf]
        self.joint = draw.randrange(len(self.rated))
        self.healthy = {
            "viscous": [draw.uniform(0.005, 0.03) * r / v for r, (v, _) in zip(self.rated, self.limits())],
            "coulomb": [draw.uniform(0.01, 0.05) * r for r in self.rated],
        }
        self.width = [draw.uniform(0.003, 0.01) * v for v, _ in self.limits()]
        effects = effects_of(draw, self.limits()[self.joint])
        self.effect = draw.choice(sorted(effects))
        shape, linear = effects[self.effect]
        self.size = math.exp(draw.uniform(math.log(SIZE[0]), math.log(SIZE[1])))
        self.speeds = [draw.uniform(0.08, 0.3) for _ in range(3)]
        self.bits = draw.choice([17, 18, 20, 22])
        self.noise = draw.uniform(0.004, 0.01)
        size = self.size_of({**shape, **linear})
        self.parameters = {**shape, **{k: v * size for k, v in linear.items()}}

    def limits(self):
        """Velocity and range by joint."""
        out = []
        for line in open(os.path.join(ROOT, self.urdf)).read().split("<limit")[1:]:
            value = {k: float(line.split(f'{k}="')[1].split('"')[0]) for k in ("lower", "upper", "velocity")}
            out.append((value["velocity"], value["upper"] - value["lower"]))
        return out

    def run(self, *arguments):
        return subprocess.run([self.fxdyn, *arguments], cwd=self.folder, capture_output=True, text=True)

    def simulate(self, name, logs, effect=True, noise=True):
        """logs: tables of the scenario, by name."""
        text = f'seed = {self.seed}\n[robot]\nurdf = "{os.path.join(ROOT, self.urdf)}"\n'
        text += f"rated_torque = {self.rated}\nacceleration = {self.acceleration}\n[sensors]\n"
        if noise:
            text += f"encoder_bits = {self.bits}\ntorque_noise = {self.noise}\n"
        for of in SIMPLE:
            key = "coefficient" if of == "viscous" else "amplitude"
            width = f", width = {self.width}" if of == "coulomb" else ""
            text += f'[[effect]]\nname = "{of}"\njoint = "all"\nparameters = {{ {key} = {self.healthy[of]}{width} }}\n'
        if effect:
            values = ", ".join(f"{k} = {v!r}" for k, v in self.parameters.items())
            text += f'[[effect]]\nname = "{self.effect}"\njoint = {self.joint + 1}\nparameters = {{ {values} }}\n'
        for log, table in logs.items():
            text += f'[[log]]\nname = "{log}"\n{table}\n'
        open(os.path.join(self.folder, name + ".toml"), "w").write(text)
        done = self.run("simulate", name + ".toml", "--out", ".")
        if done.returncode != 0:
            sys.exit(f"{self.folder}: {done.stderr}")

    def size_of(self, parameters):
        """What scales an effect's linear parameters to its size in the first log."""
        slow = self.size * self.noise / self.share_in(self.slow(0), parameters)
        return min(slow, LARGEST / self.share_in("duration_s = 10\nperiod_s = 10\nspeed = 1\nseed = 99", parameters))

    def share_in(self, log, parameters):
        """RMS of an effect's torque over a log, of rated torque."""
        torque = []
        for scale in (0, 1):
            self.parameters = parameters
            self.simulate(f"size{scale}", {f"size{scale}": log}, effect=scale == 1, noise=False)
            rows = open(os.path.join(self.folder, f"size{scale}.csv")).read().split("\n")
            at = rows[0].split(",").index(f"tau{self.joint + 1}")
            torque.append([float(row.split(",")[at]) for row in rows[1:] if row])
        power = statistics.fmean((a - b) ** 2 for a, b in zip(*torque))
        return max(math.sqrt(power), 1e-15) / self.rated[self.joint]

    def project(self, name, logs, more=""):
        """logs: (file, role, seconds or None)."""
        text = f'[robot]\nurdf = "{os.path.join(ROOT, self.urdf)}"\nrated_torque = {self.rated}\n'
        text += f"[limits]\nacceleration = {self.acceleration}\n{more}"
        for file, role, seconds in logs:
            text += f'[[log]]\nfile = "{file}.csv"\nrole = "{role}"\n'
            text += f"to_s = {seconds}\n" if seconds is not None else ""
        open(os.path.join(self.folder, name + ".toml"), "w").write(text)

    def established(self, name, logs):
        """Whether a diagnosis of these logs names the effect, its output in the folder `name`."""
        self.project(name, logs)
        done = self.run("diagnose", name + ".toml", "--out", name)
        if done.returncode != 0:
            return False
        joint = json.load(open(os.path.join(self.folder, name, "diagnosis.json")))["joints"][self.joint]
        return any(e["effect"] == self.effect and e["certainty"] == "established" for e in joint["effects"])

    def slow(self, i):
        return f"duration_s = 10\nperiod_s = 5\nspeed = {self.speeds[i]}\nseed = {i + 1}"

    def first_logs(self):
        self.simulate("before_logs", {f"slow{i}": self.slow(i) for i in range(3)})
        return [("slow0", "train", None), ("slow1", "train", None), ("slow2", "validate", None)]

    def record(self, plan, logs):
        """Plays what a folder of `excite` has. @returns the logs' names and seconds"""
        trajectories = json.load(open(os.path.join(self.folder, plan, "excite.json")))["trajectories"]
        trajectories = [one for one in trajectories if "static" not in one["name"]]  # no series: the simulator has none
        tables, out = {}, []
        for i, one in enumerate(trajectories):
            log = f"{plan}{i}"
            tables[log] = (f'plan = "{plan}/excite.json"\ntrajectory = "{one["name"]}"\n'
                           f'duration_s = {one["duration_s"]}\nseed = {i + 40}')
            out.append((log, one["duration_s"]))
        self.simulate(plan + "_logs", tables)
        return logs + out

    def seconds_until(self, name, before, motion):
        """The least of STEPS_S of this motion that establishes the effect; none: all of it does not."""
        def with_seconds(seconds):
            logs, left = list(before), seconds
            for log, duration in motion:
                if left < 2.5:  # no log is shorter
                    break
                logs.append((log, "train", min(left, duration) if left < duration else None))
                left -= duration
            return self.established(f"{name}_{seconds}", logs)
        total = sum(duration for _, duration in motion)
        steps = [s for s in STEPS_S if s < total - 0.5] + [round(total, 3)]
        if not with_seconds(steps[-1]):
            return None
        low, high = -1, len(steps) - 1  # establishes at high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if with_seconds(steps[middle]) else (middle, high)
        return steps[high]

    def planned(self, before):
        motion, after = [], "before"
        for i in range(MOST_PLANS):
            done = self.run("excite", after + ".toml", "--after", after, "--out", f"next{i}_")
            plan = os.path.join(self.folder, f"next{i}_", "excite.json")
            if done.returncode != 0 or not json.load(open(plan))["trajectories"]:
                return None, sum(d for _, d in motion), (done.stderr or done.stdout).strip().split("\n")[-1]
            motion = self.record(f"next{i}_", motion)
            seconds = self.seconds_until(f"planned{i}", before, motion)
            if seconds is not None:
                return seconds, sum(d for _, d in motion), ""
            after = f"planned{i}_{round(sum(d for _, d in motion), 3)}"
        return None, sum(d for _, d in motion), ""

    def standard(self, before):
        motion = []
        for i in range(2):
            name = f"standard{i}_"
            self.project(name, before, f"[excite]\nseed = {i + 1}\n")
            plan = self.run("excite", name + ".toml", "--out", name)
            if plan.returncode != 0:
                return None, 0, plan.stderr.strip()
            motion = self.record(name, motion)
        return self.seconds_until("standard", before, motion), sum(d for _, d in motion), ""

    def judge(self):
        out = {"seed": self.seed, "robot": self.urdf, "effect": self.effect, "joint": self.joint + 1,
               "size": self.size, "parameters": self.parameters}
        before = self.first_logs()
        if self.established("before", before):
            return {**out, "status": "named at once"}
        planned, planned_s, why = self.planned(before)
        if planned_s == 0:
            return {**out, "status": "no plan", "why": why}
        standard, standard_s, why = self.standard(before)
        if standard_s == 0:
            return {**out, "status": "no standard motion", "why": why}
        return {**out, "status": "open", "planned": planned, "planned_s": planned_s, "standard": standard,
                "standard_s": standard_s}


def judged(arguments):
    fxdyn, seed, out = arguments
    done = os.path.join(out, f"{seed}.json")
    if not os.path.exists(done):
        result = Case(fxdyn, seed, os.path.join(out, str(seed))).judge()
        with open(done + ".new", "w") as file:
            json.dump(result, file, indent=1)
        os.rename(done + ".new", done)
    return json.load(open(done))


def table(results):
    opened = [r for r in results if r["status"] == "open"]
    count = {s: sum(r["status"] == s for r in results) for s in ("named at once", "no plan", "no standard motion", "open")}
    print(", ".join(f"{n} {s}" for s, n in count.items()))
    print("| seed | robot | joint | effect | planned, s | standard, s |\n|---|---|---|---|---|---|")
    for r in opened:
        of = [str(r[k]) if r[k] else f"> {r[k + '_s']:.0f}" for k in ("planned", "standard")]
        print(f"| {r['seed']} | {os.path.basename(r['robot'])[:-5]} | {r['joint']} | {r['effect']} | {of[0]} | {of[1]} |")
    # Not established counts as twice as long as all that was recorded.
    both = [r for r in opened if r["planned"] or r["standard"]]
    ratios = [(r["planned"] or 2 * r["planned_s"]) / (r["standard"] or 2 * r["standard_s"]) for r in both]
    if ratios:
        print(f"established by planned motion {sum(r['planned'] is not None for r in opened)}, by standard motion "
              f"{sum(r['standard'] is not None for r in opened)} of {len(opened)}; planned / standard seconds, median of "
              f"the {len(both)} that either establishes: {statistics.median(ratios):.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fxdyn")
    parser.add_argument("--out", required=True)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()
    out = os.path.abspath(args.out)
    os.makedirs(out, exist_ok=True)
    tasks = [(os.path.abspath(args.fxdyn), args.seed + i, out) for i in range(args.cases)]
    results = []
    with concurrent.futures.ProcessPoolExecutor(args.jobs) as pool:
        for i, result in enumerate(pool.map(judged, tasks)):
            results.append(result)
            print(f"[{i + 1}/{args.cases}] {result['seed']} {result['effect']}: {result['status']}", file=sys.stderr)
    with open(os.path.join(out, "results.json"), "w") as file:
        json.dump(results, file, indent=1)
    table(results)


if __name__ == "__main__":
    main()
