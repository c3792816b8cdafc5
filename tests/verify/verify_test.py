#!/usr/bin/env python3
"""verify_test.py FXDYN: `fxdyn verify` takes the export of a small robot, and refuses in one line, with exit code 1, every
flipped byte of its tables, flipped bytes of the other files, and forged files whose checksums hold."""
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "mistakes"))
import good

PLACES = 40  # bytes flipped in files other than tables.bin; once, on 2026-11-29, it was every byte of them


class Failures(list):
    def expect(self, holds, what):
        if not holds:
            self.append(what)
            print("FAILED:", what)


FAILED = Failures()


def verify(fxdyn, *arguments):
    return subprocess.run([fxdyn, "verify", *map(str, arguments)], capture_output=True, text=True, errors="replace")


def refused(fxdyn, what, said, *arguments):
    done = verify(fxdyn, *arguments)
    FAILED.expect(done.returncode == 1, f"{what}: exit code {done.returncode}: {done.stderr.strip()}")
    FAILED.expect(done.stderr.count("\n") == 1, f"{what}: {done.stderr.count(chr(10))} lines")
    FAILED.expect(said in done.stderr, f"{what}: no '{said}' in: {done.stderr.strip()}")


def with_content(path, content, look):
    before = path.read_bytes()
    path.write_bytes(content)
    look()
    path.write_bytes(before)


def flipped(content, place, bit):
    return content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1:]


def fnv(text):
    """FNV-1a, 64 bits: www.isthe.com/chongo/tech/comp/fnv, by a code of its own."""
    value = 0xCBF29CE484222325
    for byte in text:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return f"{value:016x}"


def sealed(export, *changes):
    """export.json with other texts in it, and a check that holds."""
    text = export.decode()
    check = json.loads(text)["check"]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    line = f' "check": "{check}",\n'
    assert line in text
    return text.replace(check, fnv(text.replace(line, "").rstrip("\n").encode())).encode()


def page(tables, word, value):
    """The page with another word, and both CRCs as they have to be."""
    words = list(struct.unpack(f"<{len(tables) // 4}I", tables))
    words[word] = value
    words[3] = zlib.crc32(struct.pack(f"<{len(words) - 7}I", *words[7:]))
    words[6] = zlib.crc32(struct.pack("<6I", *words[:6]))
    return struct.pack(f"<{len(words)}I", *words)


def check_images(fxdyn, folder, out):
    tables, image = (out / "tables.bin").read_bytes(), folder / "drive.bin"
    image.write_bytes(b"code" * 99 + tables + b"\xff" * 64)
    done = verify(fxdyn, out, "--image", image)
    FAILED.expect(done.returncode == 0 and "holds tables.bin at byte 396" in done.stdout, f"image: {done.stderr}")
    image.write_bytes(b"code" * 99 + (out / "joint_2/tables.bin").read_bytes())
    FAILED.expect("holds joint_2/tables.bin" in verify(fxdyn, out, "--image", image).stdout, "image of one drive")
    image.write_bytes(b"code" * 99 + page(tables, 5, 9) + b"\xff" * 64)
    refused(fxdyn, "image of an update", "holds other tables, CRC-32", out, "--image", image)
    for place in range(len(tables)):
        image.write_bytes(b"code" * 99 + flipped(tables, place, place % 8) + b"\xff" * 64)
        refused(fxdyn, f"byte {place} in the image", "holds no whole page", out, "--image", image)
    FAILED.expect(verify(fxdyn, out, "--image", folder / "gone.elf").returncode == 2, "an image that is not there")


def check_flips(fxdyn, folder, out):
    for path in (out / "tables.bin", out / "joint_2/tables.bin"):
        tables = path.read_bytes()
        step = 1 if path.parent == out else 16
        for place in range(0, len(tables), step):
            with_content(path, flipped(tables, place, place % 8),
                         lambda: refused(fxdyn, f"byte {place} of {path.name}", "damaged", out))
        with_content(path, tables[:-4], lambda: refused(fxdyn, "half a page", "damaged", out))
        with_content(path, tables + b"\0", lambda: refused(fxdyn, "a longer page", "not the file of this export", out))
    for path in (out / "export.json", out / "model.json", out / "tables.hpp"):
        content = path.read_bytes()
        for k in range(PLACES):
            place = k * (len(content) - 1) // (PLACES - 1)
            with_content(path, flipped(content, place, k % 8),
                         lambda: refused(fxdyn, f"byte {place} of {path.name}", path.name, out))
    for name, old, new in (("train.csv", "0.004,", "0.005,"), ("test.csv", "0.004,", "0.005,"),
                           ("robot.toml", "60.0, 20.0", "60.0, 21.0"), ("arm.urdf", 'mass value="4"', 'mass value="5"')):
        text = (folder / name).read_text()
        assert old in text
        said = "robot.toml: it or its URDF is not" if name == "arm.urdf" else name + ": "
        with_content(folder / name, text.replace(old, new, 1).encode(), lambda: refused(fxdyn, name, said, out))
    project = (folder / "robot.toml").read_bytes()
    with_content(folder / "robot.toml", project.replace(b"[robot]", b"[robot", 1),
                 lambda: refused(fxdyn, "a project that is none", "robot.toml:", out))


def check_forged(fxdyn, out):
    """Whoever writes checksums that hold has still no tables of this model."""
    tables, export = (out / "tables.bin").read_bytes(), (out / "export.json").read_bytes()
    same = sealed(export)
    FAILED.expect(same == export, "the test's own seal is another one")
    other = page(tables, 12, 12345)
    (out / "tables.bin").write_bytes(other)
    crcs = [f'"tables_crc": {struct.unpack_from("<I", content, 12)[0]}' for content in (tables, other)]
    forged_export = sealed(export, (fnv(tables), fnv(other)), crcs)
    with_content(out / "export.json", forged_export,
                 lambda: refused(fxdyn, "other tables", "not what this program makes of model.json", out))
    (out / "tables.bin").write_bytes(tables)
    with_content(out / "export.json", sealed(export, (json.loads(export)["of"]["tool_version"], "0.0.9")),
                 lambda: refused(fxdyn, "another version", "made by fxdyn 0.0.9, this is ", out))


def main():
    fxdyn = str(pathlib.Path(sys.argv[1]).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for file, text in good.files().items():
            (folder / file).write_text(text)
        with open(folder / "robot.toml", "a", encoding="utf-8") as project:
            project.write("\n[target]\njoints = [2]\n")
        out = folder / "out/robot"
        FAILED.expect(verify(fxdyn, out).returncode == 2, "a folder that is not there")
        done = subprocess.run([fxdyn, "export", folder / "robot.toml", "--out", out], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        done = verify(fxdyn, out)
        FAILED.expect(done.returncode == 0 and not done.stderr, f"good files: {done.stderr}")
        files = ["export.json", "joint_2/tables.hpp", "model.json", "tables.hpp", "out/robot/tables.bin", "joint_2/tables.bin",
                 "robot.toml", "train.csv", "test.csv"]
        lines = done.stdout.splitlines()
        FAILED.expect(len(lines) == len(files), f"{len(lines)} lines for {len(files)} files")
        for file in files:
            FAILED.expect(any(f"{file}: " in line for line in lines), f"no line of {file}")
        said = json.loads(verify(fxdyn, out, "--json").stdout)
        FAILED.expect(said["belong_together"] and len(said["files"]) == len(files), f"--json: {said}")
        check_images(fxdyn, folder, out)
        check_flips(fxdyn, folder, out)
        check_forged(fxdyn, out)
        # Elsewhere: the project says where its logs are.
        moved = folder / "elsewhere/further/away"
        shutil.copytree(out, moved)
        refused(fxdyn, "moved results", "--project", moved)
        FAILED.expect(verify(fxdyn, moved, "--project", folder / "robot.toml").returncode == 0, "moved results, --project")
        (moved / "tables.hpp").unlink()
        said = json.loads(verify(fxdyn, moved, "--json").stdout)
        FAILED.expect(not said["belong_together"] and "is missing" in said["refused"], f"--json of what is refused: {said}")
        FAILED.expect(verify(fxdyn, out).returncode == 0, "the files as they were")
    if not FAILED:
        print("what does not belong together is refused")
    return bool(FAILED)


if __name__ == "__main__":
    sys.exit(main())
