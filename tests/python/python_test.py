#!/usr/bin/env python3
"""python_test.py FXDYN FOLDER: the module in FOLDER does what the program FXDYN does, byte for byte; takes and gives arrays; says
what is wrong as the program does; leaves Python's lock to others; its stub is that of its functions; the script of the guide runs."""
import ast
import inspect
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest

FXDYN, MODULE = (str(pathlib.Path(argument).resolve()) for argument in sys.argv[1:3])
ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path[:0] = [MODULE, str(ROOT / "tests/mistakes")]
import good  # noqa: E402: after its path is known
import numpy as np  # noqa: E402

import fxdyn  # noqa: E402


def program(*arguments):
    return subprocess.run([FXDYN, *map(str, arguments)], capture_output=True, text=True)


class Stopped(Exception):
    pass


class Module(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.before = os.getcwd()
        os.chdir(cls.folder)
        for name, text in good.files().items():
            pathlib.Path(name).write_text(text)
        done = program("run", "robot.toml", "--out", "cli", "--quiet")
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        os.chdir(cls.before)
        cls.temporary.cleanup()

    def same(self, name, folder="cli", other="python"):
        self.assertEqual(pathlib.Path(folder, name).read_bytes(), pathlib.Path(other, name).read_bytes(), name)

    def test_run_writes_the_bytes_of_the_program(self):
        result = fxdyn.run("robot.toml", "python")
        for name in ("model.json", "metrics.json", "diagnosis.json", "export.json", "tables.bin", "tables.hpp", "report.html"):
            self.same(name)
        self.assertEqual(set(result), {"model", "metrics", "diagnosis", "export"})
        self.assertEqual(program("verify", "python").returncode, 0)

    def test_identify_writes_the_bytes_of_the_program_and_tells_each_step(self):
        self.assertEqual(program("identify", "robot.toml", "--out", "identified", "--quiet").returncode, 0)
        told = []
        result = fxdyn.identify(pathlib.Path("robot.toml"), pathlib.Path("too"), progress=lambda *step: told.append(step))
        for name in ("model.json", "metrics.json"):
            self.same(name, "identified", "too")
        self.assertEqual([joint["joint"] for joint in result["model"]["joints"]], ["shoulder", "elbow"])
        begun = [stage for stage, step, _ in told if step == 0]
        self.assertIn("reading and filtering the logs", begun)
        self.assertGreater(len(begun), 2)
        for stage, step, total in told:
            self.assertTrue(0 <= step <= total, (stage, step, total))

    def test_predict_gives_what_the_program_writes(self):
        for numbers in ("real", "fixed"):
            folder = f"predicted_{numbers}"
            done = program("predict", "--model", "cli/model.json", "--log", "test.csv", "--numbers", numbers, "--out", folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            predicted = fxdyn.predict("cli/model.json", "test.csv", numbers=numbers, out=folder + "_too")
            for name in ("test.csv", "metrics.json"):
                self.same(name, folder, folder + "_too")
            rows = np.loadtxt(f"{folder}/test.csv", delimiter=",", skiprows=1)
            np.testing.assert_array_equal(np.column_stack([predicted["t"], predicted["tau"]]), rows)
            # The prediction is CSV by name, the log is not.
            shutil.copy("test.csv", "run.test.txt")
            same = fxdyn.predict("cli/model.json", "run.test.txt", numbers=numbers, out=folder + "_text")
            np.testing.assert_array_equal(same["tau"], predicted["tau"])
            # The file has its numbers in ten digits: as arrays they are the same.
            log = fxdyn.read_log("test.csv")
            again = fxdyn.predict("cli", log, numbers=numbers)
            np.testing.assert_array_equal(again["tau"], predicted["tau"])

    def test_arrays_and_dicts_are_the_project_file(self):
        logs = {name: fxdyn.read_log(name + ".csv") for name in ("train", "test")}
        self.assertEqual({signal: values.shape for signal, values in logs["train"].items()},
                         {"t": (good.ROWS,), "q": (good.ROWS, 2), "tau": (good.ROWS, 2)})
        np.testing.assert_array_equal(logs["train"]["q"][7], [float(f"{value:.10g}") for value in good.log(0.3)[7][1:3]])
        project = {"robot": {"urdf": "arm.urdf", "rated_torque": np.array([60.0, 20.0])},
                   "log": [{"file": logs["train"], "role": "train"}, {"file": "test.csv", "role": "test"}],
                   "train": {"enabled": False}}
        ours = fxdyn.identify(project, "dict")["model"]
        theirs = fxdyn.identify("robot.toml", "path")["model"]
        for key in ("inertia", "base_parameters", "filter", "joints"):
            self.assertEqual(ours[key], theirs[key], key)

    def test_errors_are_the_program_s(self):
        for arguments, error in ((("gone.toml", "out"), fxdyn.InputError), (("arm.urdf", "out"), fxdyn.InputError)):
            said = program("identify", *arguments[:1], "--out", "out").stderr
            with self.assertRaises(error) as raised:
                fxdyn.identify(*arguments)
            self.assertEqual(said, f"fxdyn: {raised.exception}\n")
        still = fxdyn.read_log("train.csv")
        still["q"] = still["q"] * [1, 0]
        with self.assertRaises(fxdyn.DataError):
            fxdyn.run({"robot": {"urdf": "arm.urdf"}, "log": [{"file": still, "role": "train"}]}, "still")
        self.assertTrue(issubclass(fxdyn.InputError, ValueError) and issubclass(fxdyn.DataError, ValueError))
        log = fxdyn.read_log("test.csv")
        for wrong in ({"t": log["t"]}, {**log, "tau": log["tau"][:-1]}, {**log, "torque": log["tau"]}, {**log, "q": log["t"]}):
            with self.assertRaises(fxdyn.InputError):
                fxdyn.predict("cli", wrong)
        for call in (lambda: fxdyn.predict("cli", log, numbers="float"), lambda: fxdyn.read_log("gone.csv"),
                     lambda: fxdyn.read_log("arm.urdf"), lambda: fxdyn.predict("gone", log),
                     lambda: fxdyn.identify({"robot": {"urdf": object()}}, "out")):
            with self.assertRaises((fxdyn.InputError, TypeError)):
                call()

    def test_what_the_callback_raises_ends_the_stage(self):
        def stop(stage, step, total):
            raise Stopped(stage)
        with self.assertRaises(Stopped):
            fxdyn.identify("robot.toml", "stopped", progress=stop)
        self.assertFalse(pathlib.Path("stopped/model.json").exists())
        fxdyn.identify("robot.toml", "stopped")  # nobody listens any more
        self.assertTrue(pathlib.Path("stopped/model.json").exists())

    def test_other_threads_run_meanwhile(self):
        done = []
        worker = threading.Thread(target=lambda: done.append(fxdyn.diagnose("robot.toml", "thread")))
        worker.start()
        turns = 0
        while worker.is_alive():
            worker.join(0.001)
            turns += 1
        self.assertEqual(len(done), 1)
        self.assertGreater(turns, 20)  # with the lock held: one, at the end

    def test_simulate_gives_the_logs_of_the_program(self):
        scenario = {"seed": 4, "robot": {"urdf": "arm.urdf", "rated_torque": [60, 20], "acceleration": [8, 8]},
                    "effect": [{"name": "viscous", "joint": "all", "parameters": {"coefficient": [1.5, 0.6]}}],
                    "log": [{"name": "a", "duration_s": 2, "seed": 1}, {"name": "b", "duration_s": 2, "seed": 2}]}
        logs = fxdyn.simulate(scenario, "simulated")
        self.assertEqual(program("simulate", "simulated/scenario.toml", "--out", "simulated_too").returncode, 0)
        self.assertEqual(set(logs), {"a", "b"})
        for name, log in logs.items():
            self.same(name + ".csv", "simulated", "simulated_too")
            rows = np.loadtxt(f"simulated/{name}.csv", delimiter=",", skiprows=1)
            np.testing.assert_array_equal(log["q"], rows[:, 1:3])
            np.testing.assert_array_equal(log["t"], rows[:, 0])

    def test_effects_are_those_of_the_program(self):
        self.assertEqual(fxdyn.effects(), json.loads(program("effects", "--json").stdout))
        self.assertIn(fxdyn.__version__, program("--version").stdout)

    def test_the_stub_is_that_of_the_functions(self):
        stub = ast.parse(pathlib.Path(MODULE, "fxdyn/__init__.pyi").read_text())
        functions = {node.name: node.args for node in stub.body if isinstance(node, ast.FunctionDef)}
        classes = {node.name for node in stub.body if isinstance(node, ast.ClassDef)}
        self.assertEqual(set(functions) | classes, set(fxdyn.__all__))
        for name, arguments in functions.items():
            signature = inspect.signature(getattr(fxdyn, name))
            self.assertEqual([argument.arg for argument in arguments.args], list(signature.parameters), name)
            defaults = [p.default for p in signature.parameters.values() if p.default is not inspect.Parameter.empty]
            self.assertEqual([ast.literal_eval(value) for value in arguments.defaults], defaults, name)

    def test_the_script_of_the_guide_runs(self):
        page = (ROOT / "docs/guide/python.md").read_text()
        script, = re.findall(r"^```python\n(.*?)^```", page, flags=re.M | re.S)
        shutil.copytree(ROOT / "tests/support/elastic_arm", "tests/support/elastic_arm")
        done = subprocess.run([sys.executable, "-B", "-c", script], env={**os.environ, "PYTHONPATH": MODULE}, capture_output=True,
                              text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        errors = [float(value) for value in re.search(r"RMS error \[N\*m\]: \[(.*)\]", done.stdout)[1].split()]
        self.assertEqual(len(errors), 2)
        for error, rated in zip(errors, (60, 20)):
            self.assertLess(error, 0.01 * rated)
        self.assertIn("arrays t and q are needed", done.stdout)
        for function in fxdyn.__all__:
            self.assertIn(f"`{function}", page)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
