// write_parquet.mjs FOLDER [SECONDS [CAMERA_KILOBYTES]]: Parquet files by the writers that others use: the one of Arrow's Rust (parquet-wasm) and
// hyparquet-writer. Without SECONDS the numbers of FOLDER/truth.csv, two joints, in many ways: what tests read in
// tests/arrays/files. With SECONDS one motion of six joints at 500 Hz as truth.csv and in four files, and a data set of LeRobot's.
// With CAMERA_KILOBYTES also camera.parquet, with an image of that size in each row.
import { randomBytes } from "node:crypto";
import fs from "node:fs";
import path from "node:path";
import * as arrow from "apache-arrow";
import { parquetWriteFile } from "hyparquet-writer";
import * as parquet from "parquet-wasm";

const { Compression, Encoding, WriterVersion } = parquet;
const folder = process.argv[2];
const seconds = Number(process.argv[3] ?? 0);
const cameraKilobytes = Number(process.argv[4] ?? 0);
fs.mkdirSync(folder, { recursive: true });

const double = new arrow.Float64(), float = new arrow.Float32(), int32 = new arrow.Int32(), int64 = new arrow.Int64();
const listOf = (type) => new arrow.List(new arrow.Field("item", type, true));
const fixedListOf = (type, size) => new arrow.FixedSizeList(size, new arrow.Field("element", type, true));
const vector = (type, values) => arrow.vectorFromArray(values, type);
const each = (names, of) => Object.fromEntries(names.map((name, k) => [name, of(k)]));

/// columns: name -> [type, values]; fields that are no lists of their own are nullable, as of most writers.
function write(name, columns, options) {
  const table = new arrow.Table(each(Object.keys(columns), (k) => vector(...Object.values(columns)[k])));
  const properties = options(new parquet.WriterPropertiesBuilder()).build();
  const bytes = parquet.writeParquet(parquet.Table.fromIPCStream(arrow.tableToIPC(table, "stream")), properties);
  fs.writeFileSync(path.join(folder, name), bytes);
}
const plain = (b) => b.setCompression(Compression.UNCOMPRESSED).setDictionaryEnabled(false).setWriterVersion(WriterVersion.V1);
const packed = (codec, version, rows) => (b) => b.setCompression(codec).setWriterVersion(version).setMaxRowGroupSize(rows)
  .setDataPageSizeLimit(64).setWriteBatchSize(8);
const large = (codec, version) => (b) => b.setCompression(codec).setWriterVersion(version).setMaxRowGroupSize(10_000);

/// A row of the truth: t, and an array of numbers each.
function small() {
  const [, ...lines] = fs.readFileSync(path.join(folder, "truth.csv"), "utf8").trim().split("\n");
  return lines.map((line) => line.split(",").map(Number)).map((row) => ({ t: row[0], q: row.slice(1, 3), dq: row.slice(3, 5), tau: row.slice(5, 7) }));
}
function motion() {
  const joints = [0, 1, 2, 3, 4, 5];
  const rows = Array.from({ length: Math.round(seconds * 500) }, (_, k) => {
    const t = k / 500;
    return {
      t, q: joints.map((j) => Math.sin((1.5 + 0.4 * j) * t)), dq: joints.map((j) => (1.5 + 0.4 * j) * Math.cos((1.5 + 0.4 * j) * t)),
      tau: joints.map((j) => 10 * Math.cos(2 * (1.5 + 0.4 * j) * t) + Math.sin(7 * t)),
    };
  });
  const names = ["t", ...["q", "dq", "tau"].flatMap((signal) => joints.map((j) => signal + (j + 1)))];
  const text = rows.map((row) => [row.t, ...row.q, ...row.dq, ...row.tau].map(String).join(","));
  fs.writeFileSync(path.join(folder, "truth.csv"), [names.join(","), ...text].join("\n") + "\n");
  return rows;
}

const rows = seconds > 0 ? motion() : small();
const all = (of) => rows.map(of);
const flat = (nameOf = (signal, j) => signal + (j + 1)) => {
  const out = { t: [double, all((row) => row.t)] };
  for (const signal of ["q", "dq", "tau"])
    rows[0][signal].forEach((_, j) => { out[nameOf(signal, j)] = [double, all((row) => row[signal][j])]; });
  return out;
};
const lists = (type) => ({ time: [double, all((row) => row.t)], ...each(["q", "dq", "tau"], (k) =>
  [type, all((row) => row[["q", "dq", "tau"][k]])]) });
/// As LeRobot's v3: some episodes one after another, each from time 0; numbers are floats.
const lerobot = (episodes, fps) => {
  const of = (f) => episodes.flatMap((episode) => rows.map((row, k) => f(row, k, episode)));
  const size = rows[0].q.length;
  return {
    "observation.state": [fixedListOf(float, size), of((row, k, e) => row.q.map((x) => x + e))],
    "observation.velocity": [listOf(float), of((row) => row.dq)],
    "observation.effort": [fixedListOf(float, size), of((row) => row.tau)],
    action: [fixedListOf(float, size), of((row, k, e) => row.q.map((x) => x + e + 0.01))],
    timestamp: [float, of((row, k) => k / fps)],
    frame_index: [int64, of((row, k) => BigInt(k))],
    episode_index: [int64, of((row, k, e) => BigInt(e))],
    index: [int64, of((row, k, e) => BigInt(k + e * rows.length))],
    task_index: [int64, of(() => 0n)],
    "next.done": [new arrow.Bool(), of((row, k) => k + 1 === rows.length)],
  };
};
const hyparquet = (name, columns, options) => parquetWriteFile({ filename: path.join(folder, name),
  columnData: Object.entries(columns).map(([name, [, data]]) => ({ name, data, type: "DOUBLE" })), ...options });

if (seconds > 0) {
  write("plain.parquet", flat(), plain);
  write("snappy.parquet", flat(), large(Compression.SNAPPY, WriterVersion.V1));
  write("zstd.parquet", lists(fixedListOf(double, 6)), large(Compression.ZSTD, WriterVersion.V2));
  hyparquet("hyparquet.parquet", flat(), {});
  write("lerobot.parquet", lerobot([0, 1, 2], 500), large(Compression.SNAPPY, WriterVersion.V1));
  if (cameraKilobytes > 0) {
    const size = cameraKilobytes * 1000, noise = randomBytes(16 << 20); // longer than what packers look back
    const images = all((row, k) => noise.subarray((k * size) % (noise.length - size)).subarray(0, size));
    write("camera.parquet", { image: [new arrow.Binary(), images], ...flat() }, large(Compression.SNAPPY, WriterVersion.V1));
  }
  process.exit(0);
}

write("plain.parquet", flat(), plain);
write("snappy.parquet", flat(), packed(Compression.SNAPPY, WriterVersion.V1, 25));
write("gzip.parquet", lists(listOf(double)), packed(Compression.GZIP, WriterVersion.V1, 25));
write("zstd.parquet", lists(fixedListOf(double, 2)), packed(Compression.ZSTD, WriterVersion.V2, 25));
write("lz4.parquet", flat(), packed(Compression.LZ4_RAW, WriterVersion.V2, 100));
write("apart.parquet", flat(), (b) => plain(b).setEncoding(Encoding.BYTE_STREAM_SPLIT));
write("brotli.parquet", flat(), (b) => packed(Compression.SNAPPY, WriterVersion.V1, 100)(b).setColumnCompression("tau2", Compression.BROTLI));
hyparquet("hyparquet.parquet", flat(), { rowGroupSize: 25, pageSize: 100 });
write("lerobot.parquet", lerobot([3, 4, 11], 30), packed(Compression.SNAPPY, WriterVersion.V1, 100));
write("unsorted.parquet", lerobot([3, 4, 3], 30), packed(Compression.SNAPPY, WriterVersion.V1, 100));
write("types.parquet", {
  t_ms: [int32, all((row, k) => 2 * k)],
  q1: [float, all((row) => row.q[0])],
  q2: [float, all((row) => row.q[1])],
  tau1: [int64, all((row) => BigInt(Math.round(1000 * row.tau[0])))],
  tau2: [new arrow.Int16(), all((row) => Math.round(1000 * row.tau[1]))],
  moving: [new arrow.Bool(), all((row, k) => k % 3 === 0)],
  note: [new arrow.Utf8(), all(() => "a run")],
}, (b) => b.setDictionaryEnabled(false).setWriterVersion(WriterVersion.V2));
write("stamps.parquet", { ...flat(), t: [new arrow.TimestampMicrosecond(), all((row, k) => 1_700_000_000_000 + 2 * k)] },
  packed(Compression.SNAPPY, WriterVersion.V1, 100));
const hole = (of) => all((row, k) => (k === of ? null : row.tau[1]));
write("nulls.parquet", { ...flat(), tau2: [double, hole(20)] }, packed(Compression.SNAPPY, WriterVersion.V2, 25));
write("null_ends.parquet", { ...lists(listOf(double)), tau: [listOf(double), all((row, k) => [row.tau[0], k < 5 || k > 57 ? null : row.tau[1]])] },
  packed(Compression.SNAPPY, WriterVersion.V1, 25));
write("ragged.parquet", { ...lists(listOf(double)), tau: [listOf(double), all((row, k) => (k === 20 ? [] : k === 21 ? [...row.tau, 0] : row.tau))] },
  packed(Compression.SNAPPY, WriterVersion.V1, 100));
const run = new arrow.Struct([new arrow.Field("t", double, true), new arrow.Field("q", listOf(double), true),
  new arrow.Field("tau", listOf(double), true)]);
write("struct.parquet", { run: [run, all(({ t, q, tau }) => ({ t, q, tau }))] }, packed(Compression.SNAPPY, WriterVersion.V1, 25));
