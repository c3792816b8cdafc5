// write_bags.mjs FOLDER [SECONDS [CAMERA_MEGABYTES]]: one motion of six joints at 500 Hz as truth.csv, and as recordings by
// the writers that others use: @mcap/core, @foxglove/rosmsg2-serialization and @foxglove/cdr, the programs zstd and lz4.
// With CAMERA_MEGABYTES only truth.csv, zstd.mcap and camera.mcap of that size. messages.bin is for write_db3.py.
import { execFileSync } from "node:child_process";
import { randomBytes } from "node:crypto";
import fs from "node:fs";
import path from "node:path";
import { CdrWriter, EncapsulationKind } from "@foxglove/cdr";
import { parse } from "@foxglove/rosmsg";
import { MessageWriter } from "@foxglove/rosmsg2-serialization";
import { McapWriter } from "@mcap/core";

const folder = process.argv[2];
const seconds = Number(process.argv[3] ?? 4);
const cameraMegabytes = Number(process.argv[4] ?? 0);
const rate = 500;
const joints = ["base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"];
const begin = 1_700_000_000n * 1_000_000_000n; // [ns]

const header = `
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
`;
const point = `
================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec
`;
const jointState = `# of a robot's joints
std_msgs/Header header

string[] name
float64[] position   # rad or m
float64[] velocity
float64[] effort
` + header;
const stateOld = `std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error  # Redundant, but useful
` + header + point;
const stateNew = `std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
string[] multi_dof_joint_names
` + header + point;
const image = `std_msgs/Header header
uint8[] data
` + header;

const row = (k) => {
  const t = k / rate;
  const each = (f) => joints.map((_, j) => f(j, 0.3 + 0.11 * j));
  return {
    ns: BigInt(k) * 2_000_000n,
    q: each((j, w) => Math.sin(2 * Math.PI * w * t + j) * (1 + 0.1 * j)),
    dq: each((j, w) => 2 * Math.PI * w * Math.cos(2 * Math.PI * w * t + j) * (1 + 0.1 * j)),
    tau: each((j, w) => 20 * Math.cos(w * t + 2 * j) + Math.sin(17 * t)),
  };
};
const rows = Array.from({ length: Math.round(seconds * rate) }, (_, k) => row(k));

const stamp = (ns) => ({ sec: Number((begin + ns) / 1_000_000_000n), nanosec: Number((begin + ns) % 1_000_000_000n) });
const headerOf = (ns) => ({ stamp: stamp(ns), frame_id: "odd" }); // four bytes with its zero: what follows is unaligned by names
const pointOf = (q, dq, effort) =>
  ({ positions: q, velocities: dq, accelerations: [], effort, time_from_start: { sec: 0, nanosec: 0 } });
const shuffled = (values) => [2, 0, 5, 1, 4, 3].map((j) => values[j]); // drivers have an order of their own

const writers = Object.fromEntries(Object.entries({ jointState, stateOld, stateNew, image })
  .map(([name, text]) => [name, new MessageWriter(parse(text, { ros2: true }))]));
const stateOf = (r) => writers.jointState.writeMessage(
  { header: headerOf(r.ns), name: shuffled(joints), position: shuffled(r.q), velocity: shuffled(r.dq), effort: shuffled(r.tau) });
const stateBy = (kind) => (r) => {
  const w = new CdrWriter({ kind });
  const { sec, nanosec } = stamp(r.ns);
  w.int32(sec).uint32(nanosec).string("odd").sequenceLength(joints.length);
  for (const name of shuffled(joints)) w.string(name);
  for (const values of [r.q, r.dq, r.tau]) w.float64Array(shuffled(values), true);
  return w.data.slice();
};

class Sink {
  constructor(file) { this.descriptor = fs.openSync(file, "w"); this.at = 0n; }
  async write(bytes) { fs.writeSync(this.descriptor, bytes); this.at += BigInt(bytes.length); }
  position() { return this.at; }
}
const packedBy = (program) => (data) =>
  ({ compression: program, compressedData: new Uint8Array(execFileSync(program, ["-c", "-q"], { input: data, maxBuffer: 1 << 30 })) });

async function mcap(name, options, record) {
  const sink = new Sink(path.join(folder, name));
  const writer = new McapWriter({ writable: sink, chunkSize: 64 * 1024, ...options });
  await writer.start({ profile: "ros2", library: "write_bags.mjs" });
  const channels = {};
  const channel = async (topic, type, definition, publisher = "") => channels[topic + publisher] ??= await writer.registerChannel({
    topic, messageEncoding: "cdr", metadata: new Map(),
    schemaId: await writer.registerSchema({ name: type, encoding: "ros2msg", data: new TextEncoder().encode(definition) }),
  });
  let sequence = 0;
  await record({
    channel,
    add: (channelId, ns, data, late = 300_000n) =>
      writer.addMessage({ channelId, sequence: sequence++, logTime: begin + ns + late, publishTime: begin + ns, data }),
  });
  await writer.end();
  fs.closeSync(sink.descriptor);
}
const states = (of) => async ({ channel, add }) => {
  const id = await channel("/joint_states", "sensor_msgs/msg/JointState", jointState);
  for (const r of rows) await add(id, r.ns, of(r));
};
const controller = (definition, of) => async ({ channel, add }) => {
  const id = await channel("/arm_controller/state", "control_msgs/msg/JointTrajectoryControllerState", definition);
  for (const r of rows) await add(id, r.ns, of(r));
};

/// Images of noise in one chunk with the joint states in front of each, so that no chunk can be skipped. Chunks with an image are
/// stored as they are: the time is that of reading and checksums, and none of it is unpacking.
async function camera(megabytes) {
  const noise = randomBytes(4 << 20);
  await mcap("camera.mcap", { compressChunk: (data) => data.length > 1 << 20
    ? { compression: "", compressedData: data } : packedBy("zstd")(data), chunkSize: 256 * 1024 }, async ({ channel, add }) => {
    const id = await channel("/joint_states", "sensor_msgs/msg/JointState", jointState);
    const eye = await channel("/camera/image", "sensor_msgs/msg/CompressedImage", image);
    const every = Math.max(1, Math.floor(rows.length / Math.max(1, megabytes / 4)));
    for (const [k, r] of rows.entries()) {
      if (k % every === 0) await add(eye, r.ns, writers.image.writeMessage({ header: headerOf(r.ns), data: noise }));
      await add(id, r.ns, stateOf(r));
    }
  });
}

fs.mkdirSync(folder, { recursive: true });
const number = (x) => String(x);
fs.writeFileSync(path.join(folder, "truth.csv"), ["t," + ["q", "dq", "tau"].map((s) => joints.map((_, j) => s + (j + 1))).join(","),
  ...rows.map((r, k) => [k / rate, ...r.q, ...r.dq, ...r.tau].map(number).join(","))].join("\n") + "\n");
await mcap("zstd.mcap", { compressChunk: packedBy("zstd") }, states(stateOf));
{ // for write_db3.py: time, size, bytes
  const file = fs.openSync(path.join(folder, "messages.bin"), "w");
  for (const r of rows) {
    const bytes = stateOf(r), head = Buffer.alloc(12);
    head.writeBigInt64LE(begin + r.ns + 300_000n);
    head.writeUInt32LE(bytes.length, 8);
    fs.writeSync(file, head);
    fs.writeSync(file, bytes);
  }
  fs.writeFileSync(path.join(folder, "joint_state.msg"), jointState);
}
if (cameraMegabytes > 0) {
  await camera(cameraMegabytes);
  process.exit(0);
}
await mcap("lz4.mcap", { compressChunk: packedBy("lz4") }, states(stateOf));
await mcap("plain.mcap", {}, states(stateOf));
await mcap("unchunked.mcap", { useChunks: false }, states(stateOf));
await mcap("unindexed.mcap", { compressChunk: packedBy("zstd"), useStatistics: false, useSummaryOffsets: false, repeatSchemas: false,
  repeatChannels: false, useMessageIndex: false, useChunkIndex: false }, states(stateOf));
await mcap("big_endian.mcap", {}, states(stateBy(EncapsulationKind.CDR_BE)));
await mcap("cdr2.mcap", {}, states(stateBy(EncapsulationKind.CDR2_LE)));
await mcap("cdr2_big_endian.mcap", {}, states(stateBy(EncapsulationKind.CDR2_BE)));
await mcap("controller_old.mcap", {}, controller(stateOld, (r) => writers.stateOld.writeMessage({ header: headerOf(r.ns),
  joint_names: joints, desired: pointOf(r.dq, [], []), actual: pointOf(r.q, r.dq, r.tau), error: pointOf([], [], []) })));
await mcap("controller_new.mcap", {}, controller(stateNew, (r) => writers.stateNew.writeMessage({ header: headerOf(r.ns),
  joint_names: joints, reference: pointOf(r.dq, [], []), feedback: pointOf(r.q, r.dq, r.tau), error: pointOf(r.dq, [], []),
  output: pointOf([], [], r.dq), multi_dof_joint_names: [] })));
await mcap("two_publishers.mcap", {}, async ({ channel, add }) => {
  const parts = [[0, 1, 2, 3], [4, 5]];
  const ids = [];
  for (const k of [0, 1]) ids.push(await channel("/joint_states", "sensor_msgs/msg/JointState", jointState, k));
  for (const r of rows) for (const k of [0, 1]) {
    const of = (values) => parts[k].map((j) => values[j]);
    await add(ids[k], r.ns, writers.jointState.writeMessage(
      { header: headerOf(r.ns), name: of(joints), position: of(r.q), velocity: of(r.dq), effort: of(r.tau) }));
  }
});
await camera(64);
