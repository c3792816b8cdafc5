"""Logs and predictions as NumPy arrays."""
import json
import pathlib

import numpy

from .stages import InputError

SIGNALS = ("q", "dq", "ddq", "tau", "qlink")  # after t, in the order of the columns


def write_log(file, log):
    """A dict of arrays as a CSV: 17 significant digits are every bit of a double."""
    unknown = set(log) - {"t", *SIGNALS}
    if unknown or "t" not in log or "q" not in log:
        raise InputError(f"log: arrays t and q are needed, of {', '.join(SIGNALS[1:])} what there is; given: {', '.join(log)}")
    t = numpy.asarray(log["t"], dtype=float)
    if t.ndim != 1:
        raise InputError(f"log: t has shape {t.shape}: write one stamp [s] a sample")
    names, columns, shape = ["t"], [t[:, None]], None
    for signal in SIGNALS:
        if log.get(signal) is None:
            continue
        values = numpy.asarray(log[signal], dtype=float)
        shape = shape or values.shape
        if values.ndim != 2 or len(values) != len(t) or values.shape != shape:
            raise InputError(f"log: {signal} has shape {values.shape}: samples x joints are {(len(t), *shape[1:])}")
        names += [f"{signal}{j + 1}" for j in range(values.shape[1])]
        columns.append(values)
    numpy.savetxt(file, numpy.hstack(columns), fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    return file


def prediction(file):
    """What `fxdyn predict` wrote: torques, and errors beside them."""
    rows = numpy.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    out = {"t": rows[:, 0], "tau": rows[:, 1:]}
    metrics = file.parent / "metrics.json"
    if metrics.exists():
        out["metrics"] = json.loads(metrics.read_text(encoding="utf-8"))
    return out


def joints_of(file, prefix):
    """How many columns PREFIX1, PREFIX2, .. a CSV has."""
    file = pathlib.Path(file)
    try:
        with open(file, encoding="utf-8", errors="replace") as lines:
            names = [name.strip() for name in lines.readline().split(",")]
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    count = 0
    while f"{prefix}{count + 1}" in names:
        count += 1
    if count == 0:
        raise InputError(f"{file}: no column {prefix}1 in its first line: say how many joints it has, joints=6")
    return count
