#!/usr/bin/env python3
"""mistakes_test.py FXDYN [NAME..]: makes each mistake of mistakes.toml out of the good project, runs fxdyn on it, and
looks at what it says: the exit code, the right cause in one line, no crash, nothing half-written.

Keys of a [[mistake]]:
  name, exit        its name and the exit code; said: parts of what is printed; unsaid: what must not be
  cure              what to do, for docs/guide/messages.md, which messages.py makes of this list
  before            arguments of a run on the good project, before the mistake is made
  run               arguments, default: identify robot.toml --out out
  rows, of          new values of columns of a log, as expressions of the row's columns, k and motion(t, phase) of good.py;
                    of: default train.csv
  where             a condition: the other rows stay as they are; drop: rows that go
  columns           the line of names; front: text in front of the file; separator
  replace           [[file, old, new], ..] in the texts; write: other files
  bytes             a name of make_bytes(): what the log is packed in
  stdin, fifo       a file that comes through standard input, or through a FIFO of its name
  env               variables of the environment; gone: a file that is removed
  leaves            results are written though the exit code is not 0
"""
import bz2
import gzip
import lzma
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
import zipfile

import good

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import matlab_files
import parquet_files
import ros2_bags
TIMEOUT_S = 60


def make_bag(kind, text):
    """The log's rows as messages of a ROS 2 bag."""
    begin, names = 1700000000 * 10**9, ["shoulder", "elbow"] if kind != "of another robot" else ["joint_a", "joint_b"]
    messages = []
    for k, line in enumerate(text.splitlines()[1:]):
        t, *values = map(float, line.split(","))
        at = begin + round(t * 1e9)
        stamp = round(t * 1e9) + 10**9 if kind == "of two clocks" and k < 500 else at
        effort = values[2:] if kind != "without torque" else []
        if kind == "with NaN" and k == 700:
            effort = [effort[0], float("nan")]
        messages.append((at, ros2_bags.joint_state(stamp, names, values[:2], [], effort)))
    topic = {"without joint states": ("/tf", "tf2_msgs/msg/TFMessage")}.get(kind, ("/joint_states", ros2_bags.JOINT_STATE))
    data = ros2_bags.database(":memory:", messages, *topic)
    return data[:len(data) // 2] if kind == "cut" else data


def make_matlab(kind, text):
    """The log's columns as variables of a MATLAB file: time, and a matrix each of position and torque."""
    rows = [list(map(float, line.split(","))) for line in text.splitlines()[1:]]
    t, q, tau = [row[:1] for row in rows], [row[1:3] for row in rows], [row[3:5] for row in rows]
    if kind == "of other lengths":
        tau = tau[:-1]
    if kind == "with NaN":
        tau[700] = [tau[700][0], float("nan")]
    variables = [] if kind == "without time stamps" else [matlab_files.matrix("time", t)]
    variables.append(matlab_files.matrix("q", list(zip(*q))))  # a row a joint, as it often is
    variables.append(matlab_files.matrix("tau", tau, imaginary=kind == "with complex numbers"))
    data = matlab_files.file(*variables)
    return data[:len(data) // 2] if kind == "cut" else data


def make_parquet(kind, text):
    """The log's columns as Parquet: time stamps, and a list each of position and torque."""
    rows = [list(map(float, line.split(","))) for line in text.splitlines()[1:]]
    tau = [row[3:5] for row in rows]
    if kind == "with a null":
        tau[700] = [tau[700][0], None]
    columns = {"timestamp": (parquet_files.DOUBLE, [row[0] for row in rows]), "q": (parquet_files.DOUBLE, [row[1:3] for row in rows]),
               "tau": (parquet_files.DOUBLE, tau)}
    if kind == "with two episodes":
        columns["episode_index"] = (parquet_files.INT64, [2 * k // len(rows) for k in range(len(rows))])
    data = bytearray(parquet_files.file(columns))
    if kind == "damaged":
        data[4:40] = bytes(36)
    return bytes(data[:len(data) // 2] if kind == "cut" else data)


def make_bytes(kind, text, file):
    """The log's text as other programs would store it; None: `file` was written."""
    data = text.encode()
    if kind.startswith("bag "):
        return make_bag(kind.removeprefix("bag "), text)
    if kind.startswith("matlab "):
        return make_matlab(kind.removeprefix("matlab "), text)
    if kind.startswith("parquet "):
        return make_parquet(kind.removeprefix("parquet "), text)
    if kind == "gzip":
        return gzip.compress(data, 1)
    if kind == "gzip, cut":
        return gzip.compress(data, 1)[:-5000]
    if kind == "gzip, damaged":
        packed = bytearray(gzip.compress(data, 1))
        packed[len(packed) // 2:len(packed) // 2 + 200] = b"\xff" * 200
        return bytes(packed)
    if kind == "spreadsheet":
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("xl/worksheets/sheet1.xml", text)
        return None
    magic = {"hdf5": b"\x89HDF\r\n\x1a\n\0\0", "matlab": b"MATLAB 5.0 MAT-file\0",
             "ros bag": b"#ROSBAG V2.0\n\x45\0\0\0", "sqlite": b"SQLite format 3\0", "numpy": b"\x93NUMPY\x01\0v\0",
             "zstd": b"\x28\xb5\x2f\xfd\x04\x58",
             # a block of the type that the format reserves
             "zstd, damaged": b"\x28\xb5\x2f\xfd\x20\x05\x07\x00\x00t,q1\n"}
    if kind in magic:
        return magic[kind] + bytes(range(256)) * 8
    return {"utf-16": lambda: text.encode("utf-16"), "utf-16 without mark": lambda: text.encode("utf-16-le"),
            "bzip2": lambda: bz2.compress(data), "xz": lambda: lzma.compress(data),
            "floats": lambda: bytes(4) + bytes(range(256)) * 20, "carriage returns": lambda: data.replace(b"\n", b"\r\n"),
            "nothing": lambda: b""}[kind]()


def changed_rows(mistake, rows):
    """The rows with the mistake's expressions in them."""
    new, where = mistake.get("rows", {}), mistake.get("where", "True")
    code = {good.COLUMNS.index(column): compile(text, column, "eval") for column, text in new.items()}
    condition, dropped = compile(where, "where", "eval"), compile(mistake.get("drop", "False"), "drop", "eval")
    out = []
    for k, row in enumerate(rows):
        names = dict(zip(good.COLUMNS, row), k=k, motion=good.motion)
        if eval(dropped, {}, names):
            continue
        row = list(row)
        if eval(condition, {}, names):
            for column, expression in code.items():
                row[column] = eval(expression, {}, names)
        out.append([value if isinstance(value, str) else format(value, ".19g" if value > 1e12 else ".10g") for value in row])
    return out


def log_text(mistake, phase):
    separator = mistake.get("separator", ",")
    rows = changed_rows(mistake, good.log(phase))
    lines = [separator.join(row) for row in rows]
    columns = mistake.get("columns", separator.join(good.COLUMNS))
    return mistake.get("front", "") + (columns + "\n" if columns else "") + "\n".join(lines) + "\n"


def prepare(mistake, files, folder):
    """Writes the project with the mistake in it."""
    files = dict(files)
    of = mistake.get("of", "train.csv")
    if any(key in mistake for key in ("rows", "drop", "columns", "front", "separator")):
        files[of] = log_text(mistake, 0.3 if of == "train.csv" else mistake.get("phase", 1.4))
    files.update(mistake.get("write", {}))
    for name, old, new in mistake.get("replace", []):
        if old not in files[name]:
            raise SystemExit(f"mistakes: {mistake['name']}: {name} has no '{old}'")
        files[name] = files[name].replace(old, new)
    for name, text in files.items():
        (folder / name).write_text(text)
    if "bytes" in mistake:
        data = make_bytes(mistake["bytes"], files[of], folder / of)
        if data is not None:
            (folder / of).write_bytes(data)
    if "gone" in mistake:
        (folder / mistake["gone"]).unlink()


def feed(file, data):
    """Writes into a FIFO, as long as somebody reads."""
    try:
        file.write_bytes(data)
    except BrokenPipeError:
        pass


def run_before(fxdyn, mistake, files, folder):
    prepare({}, files, folder)
    done = subprocess.run([fxdyn, *mistake["before"].split()], cwd=folder, capture_output=True, timeout=TIMEOUT_S, check=False)
    if done.returncode != 0:
        raise SystemExit(f"mistakes: {mistake['name']}: before: {done.stderr.decode(errors='replace')}")


def run(fxdyn, mistake, folder):
    command = [fxdyn, *mistake.get("run", "identify robot.toml --out out").split()]
    environment = {"HOME": str(folder), "PATH": os.environ["PATH"], "LC_ALL": "C", **mistake.get("env", {})}
    for name in ("ASAN_OPTIONS", "UBSAN_OPTIONS"):
        if name in os.environ:
            environment[name] = os.environ[name]
    given = (folder / mistake["stdin"]).read_bytes() if "stdin" in mistake else None
    if "fifo" in mistake:
        fifo = folder / mistake["fifo"]
        data = fifo.read_bytes()
        fifo.unlink()
        os.mkfifo(fifo)
        threading.Thread(target=feed, args=(fifo, data), daemon=True).start()
    options = {"input": given} if given is not None else {"stdin": subprocess.DEVNULL}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=TIMEOUT_S, check=False, **options)


def complaints(mistake, done, folder):
    """What is wrong with what it did."""
    out = []
    code = mistake["exit"]
    said = done.stderr.decode(errors="replace") + done.stdout.decode(errors="replace")
    if done.returncode != code:
        out.append(f"exit code {done.returncode}, not {code}")
    for part in mistake["said"]:
        if part not in said:
            out.append(f"does not say '{part}'")
    for part in mistake.get("unsaid", []) + ["internal error"]:
        if part in said:
            out.append(f"says '{part}'")
    lines = [line for line in done.stderr.decode(errors="replace").splitlines() if line.startswith("fxdyn: ")]
    if len(lines) != (0 if code == 0 else 1):
        out.append(f"{len(lines)} lines begin with 'fxdyn:'")
    if any(byte < 32 and byte not in b"\n\r\t" for byte in done.stderr + done.stdout) or b"\xff" in done.stderr:
        out.append("bytes on the terminal that are no text")
    left = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]
    results = [name for name in left if name.startswith("out/") or name.endswith(".tmp")]
    if code != 0 and results and not mistake.get("leaves"):
        out.append(f"left behind: {', '.join(results)}")
    return out


def main():
    fxdyn, wanted = os.path.abspath(sys.argv[1]), sys.argv[2:]
    mistakes = tomllib.loads((HERE / "mistakes.toml").read_text())["mistake"]
    names = [mistake["name"] for mistake in mistakes]
    if len(set(names)) != len(names):
        raise SystemExit("mistakes: two have the same name")
    files, failed, slowest, start = good.files(), 0, (0, ""), time.monotonic()
    for mistake in mistakes:
        if wanted and mistake["name"] not in wanted:
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            if "before" in mistake:
                run_before(fxdyn, mistake, files, folder)
            prepare(mistake, files, folder)
            begin = time.monotonic()
            done = run(fxdyn, mistake, folder)
            slowest = max(slowest, (time.monotonic() - begin, mistake["name"]))
            wrong = complaints(mistake, done, folder)
        if wrong or wanted:
            output = (done.stderr + done.stdout).decode(errors="backslashreplace").strip()
            print(f"{'FAILED' if wrong else 'as it should'}: {mistake['name']}: {'; '.join(wrong)}\n    "
                  + output.replace("\n", "\n    "))
        failed += bool(wrong)
    print(f"{len(mistakes)} mistakes, {failed} failed; {time.monotonic() - start:.1f} s, the slowest {slowest[0]:.2f} s ({slowest[1]})")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
