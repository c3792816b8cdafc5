#!/usr/bin/env python3
"""fleet_test.py FXDYN [TEST..]: fleets of robots through `fxdyn fleet`. FXDYN_FLEET_KILLS: how many kills at random
moments (default 3). Where robots have to end at a certain moment, fake_program.sh takes the place of fxdyn."""
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.dont_write_bytecode = True
import small_fleet

HERE = pathlib.Path(__file__).resolve().parent
FXDYN = None
FAKE = str(HERE / "fake_program.sh")


def fxdyn(folder, *words, env=None, timeout=120):
    return subprocess.run([FXDYN, *map(str, words)], cwd=folder, env={**os.environ, **(env or {})}, text=True,
                          capture_output=True, timeout=timeout)


class Fleets(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.common = tempfile.TemporaryDirectory()
        cls.made = small_fleet.make_folder(pathlib.Path(cls.common.name) / "made")
        small_fleet.make_robot(FXDYN, cls.made, "well", 1)
        small_fleet.make_robot(FXDYN, cls.made, "loaded", 2, "payload")
        for name in ("well", "loaded"):
            done = fxdyn(cls.made, "diagnose", f"{name}.toml", "--out", f"out_{name}")
            if done.returncode != 0:
                raise RuntimeError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.common.cleanup()

    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = small_fleet.make_folder(self.temporary.name)
        self.env = {"FAKE_RESULTS": str(self.made / "out_well"), "FAKE_SECONDS": "0"}
        calls = pathlib.Path(self.env["FAKE_RESULTS"] + ".calls")
        calls.unlink(missing_ok=True)
        self.calls = calls

    def robots(self, *names):
        """Projects on one log; what they come to is fake_program.sh's business."""
        for log in self.made.glob("well_*.csv"):
            target = self.folder / log.name
            if not target.exists():
                shutil.copy(log, target)
        for name in names:
            shutil.copy(self.made / "well.toml", self.folder / f"{name}.robot")

    def fleet(self, text='projects = "*.robot"\n', name="fleet.toml"):
        (self.folder / name).write_text(text)

    def run_fleet(self, *words, env=None, **more):
        return fxdyn(self.folder, "fleet", "fleet.toml", "--out", "out", *words, env={**self.env, **(env or {})}, **more)

    def fake(self, *words, env=None, **more):
        return self.run_fleet("--program", FAKE, *words, env=env, **more)

    def result(self):
        return json.loads((self.folder / "out/fleet.json").read_text())

    def robot(self, name):
        return next(robot for robot in self.result()["robots"] if robot["id"] == name)

    def complains(self, done, code, *parts):
        said = [line for line in done.stderr.splitlines() if line.startswith("fxdyn: ")]
        self.assertEqual((done.returncode, len(said)), (code, 1), done.stderr)
        for part in parts:
            self.assertIn(part, said[0])
        self.assertEqual(list(self.folder.rglob("*.tmp")), [])

    def count_calls(self):
        return len(self.calls.read_text().splitlines()) if self.calls.exists() else 0

    # One machine
    def test_drifting_robots_come_first_and_a_restart_does_only_what_is_missing(self):
        for file in self.made.glob("*.csv"):
            shutil.copy(file, self.folder)
        for name in ("well", "loaded"):
            shutil.copy(self.made / f"{name}.toml", self.folder)
        self.fleet('projects = ["well.toml", "loaded.toml"]\n[[robot]]\nid = "missing"\nproject = "missing.toml"\n')
        done = self.run_fleet()
        self.complains(done, 1, "the same command tries these again")
        self.assertEqual([r["id"] for r in self.result()["robots"]], ["missing", "loaded", "well"])
        self.assertIn("the project is gone: bring it back", self.robot("missing")["error"])
        loaded = self.robot("loaded")
        self.assertTrue(loaded["drifts"])
        self.assertIn("payload", [f["effect"] for f in loaded["findings"] if f["new"] and f["discovered"]])
        self.assertFalse(self.robot("well")["drifts"])
        page = (self.folder / "out/fleet.html").read_text()
        self.assertLess(page.index("loaded"), page.index("robots/well/out/diagnosis.json"))
        self.assertEqual(loaded["notes"], json.loads(
            (self.folder / "out/robots/loaded/out/diagnosis.json").read_text())["notes"])
        for link in loaded["files"]:
            self.assertTrue((self.folder / "out" / link).is_file(), link)
        # the same bytes from another folder, and none of the work twice
        first = (self.folder / "out/fleet.json").read_bytes()
        again = self.run_fleet()
        self.assertIn("0 of 3 robots to do", again.stderr)
        self.assertEqual((self.folder / "out/fleet.json").read_bytes(), first)
        log = self.folder / "well_today_a.csv"
        lines = log.read_text().splitlines(keepends=True)
        log.write_text("".join(lines[:-1]))
        self.assertIn("1 of 3 robots to do", self.run_fleet().stderr)

    def test_planted_drifts_are_found_and_no_others(self):
        kinds = {"r1": "payload", "r3": "ripple", "r4": "stribeck"}
        for k in range(6):
            small_fleet.make_robot(FXDYN, self.folder, f"r{k}", 500 + k, kinds.get(f"r{k}"))
        self.fleet('projects = "r*.toml"\n')
        done = self.run_fleet()
        self.assertEqual(done.returncode, 0, done.stderr)
        drifting = {robot["id"]: {f["effect"] for f in robot["findings"] if f["new"] and f["discovered"]}
                    for robot in self.result()["robots"] if robot["drifts"]}
        self.assertEqual(drifting, {robot: {kind} for robot, kind in kinds.items()})

    def test_a_robot_that_fails_costs_nobody_else(self):
        self.robots("a", "b", "slow", "memory", "silent", "crash", "nothing", "other")
        self.fleet('projects = "*.robot"\n[limits]\ntime_s = 1.5\nmemory_mb = 500\n')
        started = time.monotonic()
        self.complains(self.fake("--jobs", 3), 1, "robots failed")
        self.assertLess(time.monotonic() - started, 30)
        expected = {"slow": "took longer than 1.5 s", "memory": "MemoryError", "silent": "exit code 3",
                    "crash": "signal 11", "nothing": "did not write it", "other": "model.json: not as fxdyn writes it"}
        for robot in self.result()["robots"]:
            if robot["id"] in expected:
                self.assertIn(expected[robot["id"]], robot["error"])
                self.assertNotIn("\n", robot["error"])
            else:
                self.assertIsNone(robot["error"])
        self.assertEqual(subprocess.run(["pgrep", "-f", str(self.folder)], capture_output=True).stdout, b"")
        self.assertIn("6 of 8 robots to do", self.fake().stderr)

    def interrupted(self, number, after_s):
        """Whether it was still at work when the signal came."""
        with subprocess.Popen([FXDYN, "fleet", "fleet.toml", "--out", "out", "--program", FAKE, "--jobs", "2"],
                              cwd=self.folder, env={**os.environ, **self.env, "FAKE_SECONDS": "0.1"},
                              stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as run:
            try:
                run.wait(after_s)
            except subprocess.TimeoutExpired:
                run.send_signal(number)
            said = run.stderr.read()
            return run.wait(), said

    def test_ctrl_c_leaves_a_state_that_continues(self):
        self.robots(*(f"r{k}" for k in range(12)))
        self.fleet()
        code, said = self.interrupted(signal.SIGINT, 0.6)
        self.assertEqual(code, 1, said)
        self.assertIn("the same command goes on from there", said)
        self.assertFalse((self.folder / "out/fleet.json").exists())
        done = self.fake()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("12 of 12", done.stderr)
        self.assertEqual(self.result()["count"], 12)

    def test_kills_at_random_moments_change_no_byte(self):
        self.robots(*(f"r{k:02}" for k in range(10)))
        self.fleet()
        done = self.fake()
        self.assertEqual(done.returncode, 0, done.stderr)
        expected = (self.folder / "out/fleet.json").read_bytes()
        whole_s = self.measured(lambda: shutil.rmtree(self.folder / "out"), lambda: self.interrupted(signal.SIGKILL, 60))
        draw = random.Random(5)
        wanted = int(os.environ.get("FXDYN_FLEET_KILLS", "3"))
        kills = 0
        while kills < wanted:
            shutil.rmtree(self.folder / "out")
            for _ in range(2):  # the second hits what goes on from the first
                code, said = self.interrupted(signal.SIGKILL, draw.uniform(0.05, 0.6) * whole_s)
                kills += code == -signal.SIGKILL
            code, said = self.interrupted(signal.SIGKILL, 60)
            self.assertEqual(code, 0, said)
            self.assertEqual((self.folder / "out/fleet.json").read_bytes(), expected)
            self.assertEqual(list(self.folder.rglob("*.tmp")), [])
        print(f"{kills} kills")

    @staticmethod
    def measured(before, action):
        """Seconds that the action takes."""
        before()
        started = time.monotonic()
        action()
        return time.monotonic() - started

    # The accepted state
    def test_an_accepted_state_is_the_new_baseline(self):
        self.robots("a", "b")
        self.fleet()
        self.env["FAKE_RESULTS"] = str(self.made / "out_loaded")
        self.complains(self.run_fleet("--accept", "a"), 2, "no result of today's logs")
        self.assertEqual(self.fake().returncode, 0)
        self.assertEqual(self.result()["drifting"], 2)
        self.assertEqual([c["ids"] for c in self.result()["clusters"] if c["effect"] == "payload"], [["a", "b"]])
        before = self.result()
        self.complains(self.run_fleet("--accept", "aa"), 2, "nearest is 'a'")
        done = self.run_fleet("--accept", "a")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.result()["drifting"], self.robot("a")["drifts"]), (1, False))
        self.assertRegex(self.robot("a")["accepted"]["at"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        self.assertTrue(self.robot("a")["accepted"]["by"])
        payload = next(f for f in self.robot("a")["findings"] if f["effect"] == "payload")
        self.assertEqual([p["value"] for p in payload["parameters"]], [p["accepted"] for p in payload["parameters"]])
        # what was not accepted is as it was
        after = self.result()
        self.assertEqual([r for r in after["robots"] if r["id"] == "b"], [r for r in before["robots"] if r["id"] == "b"])
        # what was accepted and is gone is told
        shutil.copytree(self.made / "out_well", self.folder / "healed")
        (self.folder / "a.robot").write_text((self.folder / "a.robot").read_text() + "# repaired\n")
        self.assertEqual(self.fake(env={"FAKE_RESULTS": str(self.folder / "healed")}).returncode, 0)
        self.assertTrue(any("payload" in gone for gone in self.robot("a")["gone"]))

    def test_a_baseline_of_another_robot_is_its_complaint_alone(self):
        self.robots("a", "b")
        self.fleet()
        self.assertEqual(self.fake().returncode, 0)
        self.assertEqual(self.run_fleet("--accept", "all").returncode, 0)
        accepted = self.folder / "out/accepted"
        state = json.loads((accepted / "a.json").read_text())
        state["state"]["joints"][1]["joint"] = "wrist"
        (accepted / "a.json").write_text(json.dumps(state))
        self.complains(self.fake(), 1, "robots failed")
        self.assertIn("accepted/a.json: is the baseline of another robot", self.robot("a")["error"])
        self.assertIn("--accept a", self.robot("a")["error"])
        self.assertEqual((self.robot("b")["error"], self.robot("b")["reference"]), (None, "accepted"))
        quiet = self.fake("--quiet")
        self.assertEqual((quiet.returncode, quiet.stdout), (1, ""))
        self.assertTrue(quiet.stderr.startswith("a failed: accepted/a.json: is the baseline"), quiet.stderr)
        shutil.copy(accepted / "b.json", accepted / "a.json")
        self.complains(self.fake(), 1, "robots failed")
        self.assertIn("a.json: is no accepted state of 'a'", self.robot("a")["error"])

    def test_a_result_that_is_cut_is_made_again(self):
        self.robots("a", "b")
        self.fleet()
        self.assertEqual(self.fake().returncode, 0)
        page = (self.folder / "out/fleet.json").read_bytes()
        (self.folder / "out/robots/a/result.json").write_text("")
        done = self.fake()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("1 of 2 robots to do", done.stderr)
        self.assertEqual((self.folder / "out/fleet.json").read_bytes(), page)

    def test_all_that_are_done_are_accepted_and_the_others_told(self):
        self.robots("a", "b")
        self.fleet()
        self.assertEqual(self.fake().returncode, 0)
        (self.folder / "a.robot").write_text((self.folder / "a.robot").read_text() + "# changed\n")
        done = self.run_fleet("--accept", "all")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("a: has no result of today's logs: not accepted", done.stderr)
        self.assertEqual([r["id"] for r in self.result()["robots"] if r["accepted"]], ["b"])

    def test_overrides_and_baselines_reach_the_project(self):
        self.robots("a")
        shutil.copy(self.folder / "well_healthy_c.csv", self.folder / "other.csv")
        self.fleet('[[robot]]\nid = "a"\nproject = "a.robot"\nbaseline = "other.csv"\n'
                   "overrides = { diagnose = { max_effects = 1 } }\n")
        done = self.run_fleet()
        self.assertEqual(done.returncode, 0, done.stderr)
        text = (self.folder / "out/robots/a/project.toml").read_text()
        self.assertIn("max_effects = 1", text)
        model = json.loads((self.folder / "out/robots/a/out/model.json").read_text())
        self.assertIn(("other.csv", "baseline"), [(pathlib.Path(log["file"]).name, log["role"]) for log in model["logs"]])

    # Bad input
    def test_bad_input_is_one_line_with_the_cure(self):
        self.robots("a")
        self.fleet('[[robot]]\nid = "a"\nproject = "a.robot"\n[[robot]]\nid = "a"\nproject = "a.robot"\n')
        self.complains(self.run_fleet(), 2, "fleet.toml:4", "two robots have the id 'a'", "an id of its own")
        self.assertFalse((self.folder / "out").exists())
        self.fleet()
        self.complains(self.run_fleet("--program", "gone"), 2, "--program", "can be started")
        self.complains(self.run_fleet("--slurm", env={"PATH": "/nonexistent"}), 2, "no sbatch", "leave out --slurm")
        self.complains(fxdyn(self.folder, "fleet-worker", "fleet.toml", "--out", "elsewhere", "--chunk", 0), 2,
                       "where all nodes see the same folder")
        self.complains(fxdyn(self.folder, "fleet-worker", "fleet.toml", "--out", "out", "--chunk", 2, "--of", 2), 2,
                       "expected 0 .. 1")

    def test_two_fleets_do_not_share_a_folder(self):
        self.robots("a")
        self.fleet()
        with subprocess.Popen([FXDYN, "fleet", "fleet.toml", "--out", "out", "--program", FAKE], cwd=self.folder,
                              env={**os.environ, **self.env, "FAKE_SECONDS": "3"}, stderr=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL) as first:
            while not (self.folder / "out/robots/a/output.txt").exists():
                time.sleep(0.02)
            self.complains(self.fake(), 2, "another fxdyn fleet works in it")
            self.assertEqual(first.wait(), 0)

    def test_a_full_disk_is_one_line_and_the_rest_goes_on_later(self):
        self.robots("a", "b", "c")
        self.fleet()
        script = ('mkdir -p out && mount -t tmpfs -o size=64k none out || exit 77; "$@"; code=$?; '
                  'find out -name "*.tmp" | grep -q . && exit 99; exit $code')
        done = subprocess.run(["unshare", "-m", "bash", "-c", script, "-", FXDYN, "fleet", "fleet.toml", "--out", "out",
                               "--program", FAKE], cwd=self.folder, env={**os.environ, **self.env}, text=True,
                              capture_output=True)
        if done.returncode == 77 or "unshare failed" in done.stderr:
            self.skipTest("no file system can be mounted here")
        self.complains(done, 2, "No space left on device", "free some")

    # A cluster
    def slurm(self, *words, **env):
        state = self.folder / "slurm_state"
        state.mkdir(exist_ok=True)
        return self.fake("--slurm", *words, env={"PATH": f"{HERE / 'fake_slurm'}:{os.environ['PATH']}",
                                                 "FAKE_SLURM": str(state), **env})

    def test_a_cluster_comes_to_the_same_bytes_though_it_loses_tasks(self):
        self.robots(*(f"r{k}" for k in range(7)))
        self.fleet()
        self.assertEqual(self.fake().returncode, 0)
        expected = (self.folder / "out/fleet.json").read_bytes()
        shutil.rmtree(self.folder / "out")
        done = self.slurm("--chunk-size", "2", "--slurm-args", "--partition=night --mem=4G", FAKE_SLURM_LOSES="2")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("3 robots are missing: submitted again", done.stderr)
        self.assertEqual((self.folder / "out/fleet.json").read_bytes(), expected)
        arguments = (self.folder / "slurm_state/arguments").read_text()
        for word in ("--partition=night\n--mem=4G", "--array=0-3", "--array=0-1"):
            self.assertIn(word, arguments)

    def test_a_killed_submitter_costs_nothing(self):
        self.robots(*(f"r{k}" for k in range(6)))
        self.fleet()
        self.assertEqual(self.fake().returncode, 0)
        expected = (self.folder / "out/fleet.json").read_bytes()
        shutil.rmtree(self.folder / "out")
        state = self.folder / "slurm_state"
        state.mkdir()
        with subprocess.Popen([FXDYN, "fleet", "fleet.toml", "--out", "out", "--slurm", "--chunk-size", "3", "--program",
                               FAKE], cwd=self.folder, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              env={**os.environ, **self.env, "FAKE_SECONDS": "0.3", "FAKE_SLURM": str(state),
                                   "PATH": f"{HERE / 'fake_slurm'}:{os.environ['PATH']}"}) as submitter:
            while not list((self.folder / "out/robots").glob("*/result.json")):
                self.assertIsNone(submitter.poll())
                time.sleep(0.02)
            submitter.kill()
        # its array goes on
        done = self.slurm("--chunk-size", "3", FAKE_SECONDS="0.3")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "out/fleet.json").read_bytes(), expected)
        self.assertIn("job 1 of before goes on", done.stderr)
        self.assertEqual(len(list(state.glob("job.*"))), 1)
        while list(state.glob("runs.*")):
            time.sleep(0.05)

    def test_the_size_of_chunks_comes_from_a_measured_time(self):
        self.robots("a", "b", "c")
        self.fleet()
        done = self.slurm()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("1 tasks", done.stderr)

    def test_a_cluster_that_does_not_see_the_folder_is_told(self):
        self.robots("a", "b")
        self.fleet()
        self.complains(self.slurm("--chunk-size", "1", FAKE_SLURM_ELSEWHERE="1"), 1,
                       "put --out where all nodes see the same folder")
        self.complains(self.slurm("--chunk-size", "1", "--slurm-args", "--partition=gone"), 2, "sbatch refuses",
                       "--slurm-args")

    def test_parts_without_a_submitter(self):
        self.robots(*(f"r{k}" for k in range(5)))
        self.fleet()
        for part in range(2):
            done = fxdyn(self.folder, "fleet-worker", "fleet.toml", "--out", "out", "--chunk", part, "--of", 2,
                         "--program", FAKE, env=self.env)
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.count_calls(), 5)
        self.assertIn("0 of 5 robots to do", self.fake().stderr)


if __name__ == "__main__":
    FXDYN = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=2)
