#!/usr/bin/env python3
"""write_db3.py FOLDER: messages.bin of write_bags.mjs as bags of rosbag2's sqlite3 storage: humble.db3 (schema 3),
jazzy.db3 (schema 4, with the definitions), split/ and packed/ (folders of two files, packed/ by zstd), messages/ (its first
messages packed by zstd)."""
import pathlib
import sqlite3
import struct
import subprocess
import sys


def messages(folder):
    data = (folder / "messages.bin").read_bytes()
    at = 0
    while at < len(data):
        time, size = struct.unpack_from("<qI", data, at)
        yield time, data[at + 12:at + 12 + size]
        at += 12 + size


def write(file, rows, definition=None):
    file.unlink(missing_ok=True)
    base = sqlite3.connect(file)
    base.executescript("""
      CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
      CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
      CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
        offered_qos_profiles TEXT NOT NULL);
      CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
      CREATE INDEX timestamp_idx ON messages (timestamp ASC);""")
    base.execute("INSERT INTO schema VALUES(?, ?)", (4, "jazzy") if definition else (3, "humble"))
    base.execute("INSERT INTO topics VALUES(1, '/tf', 'tf2_msgs/msg/TFMessage', 'cdr', '')")
    base.execute("INSERT INTO topics VALUES(2, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', '')")
    if definition:
        base.execute("CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL, "
                     "encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)")
        base.execute("INSERT INTO message_definitions VALUES(1, 'sensor_msgs/msg/JointState', 'ros2msg', ?, '')", (definition,))
    for time, data in rows:
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", (time, b"\0\1\0\0" + bytes(40)))
        base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(2, ?, ?)", (time, data))
    base.commit()
    base.close()


def bag(folder, parts, names):
    folder.mkdir(exist_ok=True)
    for name, rows in zip(names, parts):
        write(folder / name.removesuffix(".zstd"), rows)
        if name.endswith(".zstd"):
            subprocess.run(["zstd", "-q", "-f", "--rm", folder / name.removesuffix(".zstd"), "-o", folder / name], check=True)
    listed = "".join(f"    - {name}\n" for name in names)
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  relative_file_paths:\n" + listed +
        "  duration:\n    nanoseconds: 1\n  topics_with_message_count:\n    - topic_metadata:\n        name: /joint_states\n")


def packed(data):
    return subprocess.run(["zstd", "-q", "-c"], input=data, stdout=subprocess.PIPE, check=True).stdout


def main():
    folder = pathlib.Path(sys.argv[1])
    rows = list(messages(folder))
    write(folder / "humble.db3", rows)
    if len(rows) > 5000:
        return
    write(folder / "jazzy.db3", rows, (folder / "joint_state.msg").read_text())
    half = len(rows) // 2
    bag(folder / "split", [rows[:half], rows[half:]], ["split_0.db3", "split_1.db3"])
    bag(folder / "packed", [rows[:half], rows[half:]], ["packed_0.db3.zstd", "packed_1.db3.zstd"])
    bag(folder / "messages", [[(time, packed(data)) for time, data in rows[:200]] + rows[200:]], ["messages_0.db3"])
    for program, end in (("zstd", "zst"), ("gzip", "gz")):
        with open(folder / f"text.csv.{end}", "wb") as out:
            subprocess.run([program, "-q", "-c", folder / "truth.csv"], stdout=out, check=True)


if __name__ == "__main__":
    main()
