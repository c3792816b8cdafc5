"""Projects, scenarios and models that are dicts, as the files that the stages read."""
import json
import os
import pathlib

from . import arrays
from .stages import InputError


def toml(value):
    """A value of TOML 1.0, on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if hasattr(value, "tolist"):  # of NumPy
        return toml(value.tolist())
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, os.PathLike)):
        return json.dumps(os.fspath(value), ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(entry)}" for key, entry in value.items()) + " }"
    raise InputError(f"project: {value!r} is neither a number nor text, list or dict")


def document(content):
    """Tables and arrays of tables, after the keys that belong to none."""
    is_table = lambda value: isinstance(value, dict)
    is_tables = lambda value: isinstance(value, (list, tuple)) and value and all(map(is_table, value))
    keys = lambda table: [f"{json.dumps(key)} = {toml(value)}" for key, value in table.items() if value is not None]
    lines = keys({key: value for key, value in content.items() if not is_table(value) and not is_tables(value)})
    for name, value in content.items():
        if is_table(value):
            lines += [f"[{name}]", *keys(value)]
        elif is_tables(value):
            for table in value:
                lines += [f"[[{name}]]", *keys(table)]
    return "\n".join(lines) + "\n"


def file_of(project, out, name):
    """The path, or the dict as a file in `out`: paths in it are relative to the working folder, and logs may be arrays."""
    if not isinstance(project, dict):
        return os.fspath(project)
    out.mkdir(parents=True, exist_ok=True)
    here = lambda path: str(pathlib.Path(path).absolute())
    content = dict(project)
    if isinstance(content.get("robot"), dict) and "urdf" in content["robot"]:
        content["robot"] = {**content["robot"], "urdf": here(content["robot"]["urdf"])}
    logs = content.get("log")
    if isinstance(logs, (list, tuple)):
        content["log"] = [log_entry(entry, k, out, here) for k, entry in enumerate(logs, 1)]
    file = out / name
    file.write_text(document(content), encoding="utf-8")
    return str(file)


def log_entry(entry, number, out, here):
    """[[log]] with absolute paths; arrays become a file of their own in `out`."""
    if not isinstance(entry, dict):
        raise InputError(f"project: log {number} is {entry!r}: write a dict with file or arrays, and role")
    entry = dict(entry)
    for key in ("file", "scenario"):
        if isinstance(entry.get(key), dict):
            file = arrays.write_log(out / f"log_{number}.csv", entry[key])
            entry[key] = str(file.absolute())
        elif key in entry:
            entry[key] = here(entry[key])
    return entry


def model_file(model, folder, in_arrays):
    """The path of model.json. For a log in arrays, of a model that reads columns as they are: arrays have SI units."""
    if not isinstance(model, dict):
        file = pathlib.Path(model)
        file = file / "model.json" if file.is_dir() else file
        if not in_arrays:
            return str(file)
        try:
            model = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{file}: not a model: {error}") from None
    if in_arrays:
        model = {**model, "log_formats": {}}
    file = folder / "model.json"
    file.write_text(json.dumps(model), encoding="utf-8")
    return str(file)
