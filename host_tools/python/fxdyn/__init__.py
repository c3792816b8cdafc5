"""fxdyn from Python: the stages of the command line, with the same files as results, and these as dicts and NumPy arrays.

Guide: docs/guide/python.md. Every stage takes a project as the path of its file or as a dict, writes its results to the folder
`out` and returns them. Stages compute without Python's lock and run one at a time. `progress(stage, step, total)` is called for
every step, from any thread; what it raises ends the stage, and so does Ctrl-C.

What is wrong is raised: InputError is bad input, DataError says that the data can't support the answer. Both are ValueErrors.
"""
import json as _json
import os as _os
import pathlib as _pathlib
import tempfile as _tempfile

from . import arrays as _arrays
from . import projects as _projects
from . import stages as _stages
from .stages import DataError, InputError

__version__ = _stages.version
__all__ = ["DataError", "InputError", "diagnose", "effects", "export", "identify", "predict", "read_log", "report", "run",
           "simulate", "train"]

_RESULTS = ("model.json", "metrics.json", "diagnosis.json", "export.json")


def _stage(name, project, out, progress, files):
    out = _pathlib.Path(out)
    _stages.run_stage(name, _projects.file_of(project, out, "project.toml"), out, progress)
    return {_pathlib.Path(file).stem: _json.loads((out / file).read_text(encoding="utf-8"))
            for file in files if (out / file).exists()}


def identify(project, out, progress=None):
    """Base parameters and friction from the train logs: {"model", "metrics"}."""
    return _stage("identify", project, out, progress, _RESULTS[:2])


def diagnose(project, out, progress=None):
    """What the nominal model lacks, named and added: {"model", "metrics", "diagnosis"}."""
    return _stage("diagnose", project, out, progress, _RESULTS[:3])


def train(project, out, progress=None):
    """A Broad Learning System on what diagnosis left: {"model", "metrics", "diagnosis"}."""
    return _stage("train", project, out, progress, _RESULTS[:3])


def export(project, out, progress=None):
    """Integer tables for the drive, tables.hpp and tables.bin: {"model", "metrics", "diagnosis", "export"}."""
    return _stage("export", project, out, progress, _RESULTS)


def report(project, out, progress=None):
    """report.html of what the other stages wrote: the same results as export()."""
    return _stage("report", project, out, progress, _RESULTS)


def run(project, out, progress=None):
    """diagnose, train, export and report in one go: the same results as export()."""
    return _stage("run", project, out, progress, _RESULTS)


def predict(model, log, numbers="real", raw=False, out=None):
    """Torque of a model over a log: {"t" [s], "tau" [N*m | N], samples x joints, "metrics"}.

    model: the path of model.json, a result folder, or the dict. log: the path of a log, or a dict of arrays in SI units, t and q,
    perhaps dq, ddq and tau, samples x joints. numbers: "real" or "fixed", as the firmware computes. raw: with the noise of q;
    else below the torque's cut-off. out: keeps the files that `fxdyn predict` writes. "metrics" is there if the log has torque.
    """
    if numbers not in ("real", "fixed"):
        raise InputError(f"predict: numbers = '{numbers}': write 'real' or 'fixed'")
    with _tempfile.TemporaryDirectory() as temporary:
        folder = _pathlib.Path(temporary)
        results = folder / "out" if out is None else _pathlib.Path(out)
        in_arrays = isinstance(log, dict)
        file = _projects.model_file(model, folder, in_arrays)
        if in_arrays:
            log = _arrays.write_log(folder / "log.csv", log)
        results.mkdir(parents=True, exist_ok=True)
        written = _stages.predict(file, _os.fspath(log), numbers == "fixed", raw, results)
        return _arrays.prediction(_pathlib.Path(written))


def simulate(scenario, out):
    """Logs of a scenario, the path of its file or a dict: {name: {"t", "q", "dq", "ddq", "tau", ..}} in SI units."""
    out = _pathlib.Path(out)
    files = _stages.simulate(_projects.file_of(scenario, out, "scenario.toml"), out)
    return {file.stem: read_log(file) for file in map(_pathlib.Path, files)}


def read_log(file, joints=None, columns=None):
    """Signals of a log as arrays, samples x joints, in the file's own units: {"t", "q", ..}, what there is of dq, ddq, tau, qlink.

    joints: how many; by default a CSV's line of names says it. columns: signal -> prefix of its columns, as in [signals].
    """
    columns = dict(columns or {})
    if joints is None:
        joints = _arrays.joints_of(file, columns.get("q", "q"))
    return _stages.read_log(_os.fspath(file), joints, columns)


def effects():
    """The catalogue of effects: a list of dicts with name, equation, parameters, units and bounds."""
    return _json.loads(_stages.effects())
