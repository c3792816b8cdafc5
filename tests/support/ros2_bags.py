"""Small bags of ROS 2 as Python's sqlite3 writes them, for tests of commands."""
import sqlite3
import struct

JOINT_STATE = 'sensor_msgs/msg/JointState'


def joint_state(stamp_ns, names, position, velocity, effort):
    """sensor_msgs/msg/JointState in little endian CDR."""
    out = bytearray(struct.pack('<iII', stamp_ns // 10**9, stamp_ns % 10**9, 1) + b'\0')

    def align(size):
        out.extend(bytes(-len(out) % size))
    align(4)
    out.extend(struct.pack('<I', len(names)))
    for name in names:
        align(4)
        out.extend(struct.pack('<I', len(name) + 1) + name.encode() + b'\0')
    for values in (position, velocity, effort):
        align(4)
        out.extend(struct.pack('<I', len(values)))
        if values:
            align(8)
        out.extend(struct.pack(f'<{len(values)}d', *values))
    return b'\0\1\0\0' + bytes(out)


def database(file, messages, topic='/joint_states', kind=JOINT_STATE):
    """A bag of one topic. messages: (ns when recorded, bytes). file: a path, or ':memory:'; returns its bytes."""
    bag = sqlite3.connect(file)
    bag.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT)')
    bag.execute('CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)')
    bag.execute('INSERT INTO topics VALUES(1, ?, ?, ?, ?)', (topic, kind, 'cdr', ''))
    bag.executemany('INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)', messages)
    bag.commit()
    out = bag.serialize()
    bag.close()
    return out
