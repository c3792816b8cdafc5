// Files that Arrow's Rust and hyparquet-writer wrote (writers/write_parquet.mjs), against the CSV of the same motion.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "tests/arrays/small_parquet.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

const std::filesystem::path files = std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/arrays/files";

Log read(const std::filesystem::path& file, const LogFormat& format = {}, std::size_t joints = 2,
         std::optional<double> from = {}, std::optional<double> to = {}, bool torque = true) {
  return read_log(file, joints, std::vector<bool>(joints, true), format, from, to, torque);
}

Log truth() { return read(files / "truth.csv"); }

void refused(const std::string& name, const std::vector<std::string>& parts, const LogFormat& format = {}) {
  test::expect_refused(files / name, parts, [&] { read(files / name, format); });
}

LogFormat of_lerobot(const std::string& topic) {
  return {.columns = {{topic_key, topic},
                      {"q", "observation.state"},
                      {"dq", "observation.velocity"},
                      {"tau", "observation.effort"}}};
}

class WrittenParquet : public testing::TestWithParam<const char*> {};

TEST_P(WrittenParquet, EveryNumberIsTheWritersOwn) {
  const Log log = read(files / GetParam()), as_csv = truth();
  ASSERT_EQ(log.samples(), 60);
  EXPECT_TRUE(log.t == as_csv.t);
  EXPECT_TRUE(log.q == as_csv.q);
  EXPECT_TRUE(log.dq == as_csv.dq);
  EXPECT_TRUE(log.tau == as_csv.tau);
  EXPECT_EQ(log.time_note, "");
  // Over a border of row groups, and within one.
  for (const Eigen::Index first : {20, 30}) {
    const Log part = read(files / GetParam(), {}, 2, as_csv.t[first], as_csv.t[first + 15]);
    ASSERT_EQ(part.samples(), 15);
    EXPECT_TRUE(part.tau == as_csv.tau.middleRows(first, 15));
  }
}

// What each was written with: pages of version 1 or 2, plain or with a dictionary, packed or not, lists or columns.
INSTANTIATE_TEST_SUITE_P(, WrittenParquet,
                         testing::Values("plain.parquet", "snappy.parquet", "gzip.parquet", "zstd.parquet",
                                         "lz4.parquet", "apart.parquet", "hyparquet.parquet"));

TEST(ParquetLog, NumbersOfAllTypesAreRead) {
  const Log log = read(files / "types.parquet", {.torque_gain = {1e-3, 1e-3}}), as_csv = truth();
  ASSERT_EQ(log.samples(), 60);
  EXPECT_LT((log.t.array() + 0.25 - as_csv.t.array()).abs().maxCoeff(), 1e-12);
  EXPECT_TRUE(log.q == as_csv.q.cast<float>().cast<double>());
  EXPECT_LE((log.tau - as_csv.tau).cwiseAbs().maxCoeff(), 0.5e-3 + 1e-12);
  const ArrayList list = list_arrays(files / "types.parquet");
  std::vector<std::string> described;
  for (const ArrayInfo& array : list.arrays) described.push_back(list.name_of(array.path) + " " + array.described());
  EXPECT_EQ(described, (std::vector<std::string>{"t_ms 60 int32", "q1 60 float", "q2 60 float", "tau1 60 int64",
                                                 "tau2 60 int32", "moving 60 bool", "note 60 text"}));
  std::vector<double> moving;
  read_arrays(files / "types.parquet", {{"moving"}}, [&](std::size_t, std::uint64_t at, std::span<const double> some) {
    EXPECT_EQ(at, moving.size());
    moving.insert(moving.end(), some.begin(), some.end());
  });
  ASSERT_EQ(moving.size(), 60U);
  for (std::size_t k = 0; k < moving.size(); ++k) EXPECT_EQ(moving[k], k % 3 == 0 ? 1 : 0) << k;
}

TEST(ParquetLog, StampsSince1970AreSeconds) {
  const Log log = read(files / "stamps.parquet");
  EXPECT_EQ(log.t[0], 1.7e9);
  EXPECT_NEAR(log.step_s, 0.002, 1e-6);
  EXPECT_FALSE(log.resampled);
  EXPECT_EQ(log.time_note, "");
  EXPECT_TRUE(log.tau == truth().tau);
}

TEST(ParquetLog, AFileIsKnownByItsContent) {
  EXPECT_EQ(reader_of(files / "plain.parquet").name, "parquet");
  const auto renamed = test::folder() / "plain.csv";
  std::filesystem::copy_file(files / "plain.parquet", renamed, std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(reader_of(renamed).name, "parquet");
  EXPECT_TRUE(read(renamed).tau == truth().tau);
  EXPECT_EQ(reader_of("no/such.parquet").name, "parquet");
  EXPECT_THROW(read("no/such.parquet"), InputError);
}

TEST(ParquetLog, AnEpisodeIsChosenOrAskedFor) {
  LogFormat any = of_lerobot("");
  any.columns.erase(topic_key);
  refused("lerobot.parquet",
          {"episode_3, episode_4, episode_11 all have these joints", "topic = \"episode_3\", or another one"}, any);
  refused("lerobot.parquet", {"no log is called episode_5", "it has episode_3, episode_4, episode_11"},
          of_lerobot("episode_5"));
  const Log as_csv = truth();
  const auto single = [](const Eigen::MatrixXd& numbers) { return numbers.cast<float>().cast<double>().eval(); };
  for (const int episode : {3, 4, 11}) {
    const Log log = read(files / "lerobot.parquet", of_lerobot("episode_" + std::to_string(episode)));
    ASSERT_EQ(log.samples(), 60) << episode;
    EXPECT_TRUE(log.q == single((as_csv.q.array() + episode).matrix())) << episode;
    EXPECT_TRUE(log.dq == single(as_csv.dq)) << episode;
    EXPECT_TRUE(log.tau == single(as_csv.tau)) << episode;
    EXPECT_EQ(log.t[0], 0);
    EXPECT_NEAR(log.step_s, 1 / 30.0, 1e-6);  // stamps are floats
    EXPECT_FALSE(log.resampled);
  }
  refused("unsorted.parquet", {"the rows of episode_3 are not together", "sort them by episode_index"}, any);
}

TEST(ParquetLog, ItsColumnsAreListed) {
  const auto all = array_columns(files / "lerobot.parquet");
  ASSERT_EQ(all.size(), 3U);
  EXPECT_EQ(all[2].topic, "episode_11");
  EXPECT_EQ(all[2].names,
            (std::vector<std::string>{"timestamp", "observation.state1", "observation.state2", "observation.velocity1",
                                      "observation.velocity2", "observation.effort1", "observation.effort2", "action1",
                                      "action2", "frame_index", "episode_index", "index", "task_index", "next.done"}));
  EXPECT_EQ(array_columns(files / "plain.parquet").at(0).topic, "/");
}

/// lerobot.parquet in a data set whose meta/info.json is that.
std::filesystem::path data_set(const std::string& info) {
  const auto root = test::folder() / "data_set";
  auto file = root / "data/chunk-000/file-000.parquet";
  std::filesystem::create_directories(file.parent_path());
  std::filesystem::create_directories(root / "meta");
  std::filesystem::copy_file(files / "lerobot.parquet", file, std::filesystem::copy_options::overwrite_existing);
  std::ofstream(root / "meta/info.json") << info;
  return file;
}

TEST(ParquetLog, ADataSetNamesTheNumbersOfItsLists) {
  const auto file = data_set(R"({"fps": 30, "features": {
    "observation.state": {"dtype": "float32", "names": ["elbow.pos", "wrist.pos"]},
    "observation.velocity": {"names": {"motors": ["elbow", "wrist"]}},
    "observation.effort": {"names": ["twice", "twice"]}, "action": {"names": ["one"]}, "index": {"names": null}}})");
  EXPECT_EQ(array_columns(file).at(0).names,
            (std::vector<std::string>{"timestamp", "observation.state.elbow.pos", "observation.state.wrist.pos",
                                      "observation.velocity.elbow", "observation.velocity.wrist", "observation.effort1",
                                      "observation.effort2", "action1", "action2", "frame_index", "episode_index",
                                      "index", "task_index", "next.done"}));
  const Log numbered = read(file, of_lerobot("episode_4"));
  LogFormat named = of_lerobot("episode_4");
  named.columns.erase("q");
  named.joint_columns["q"] = {"observation.state.wrist.pos", "observation.state.elbow.pos"};
  const Log log = read(file, named);
  EXPECT_TRUE(log.q.col(0) == numbered.q.col(1));
  EXPECT_TRUE(log.q.col(1) == numbered.q.col(0));
  // One column for two signals, by both its names.
  named.joint_columns["tau"] = {"observation.state1", "observation.state2"};
  const Log both = read(file, named);
  EXPECT_TRUE(both.tau.col(0) == both.q.col(1));
  EXPECT_TRUE(both.tau.col(1) == both.q.col(0));
}

TEST(ParquetLog, OfADataSetAFileIsToBeNamed) {
  const auto root = data_set("{}").parent_path().parent_path().parent_path();
  EXPECT_EQ(reader_of(root).name, "parquet");
  const std::vector<std::string> words{"is a data set of LeRobot: name one of its files",
                                       "data_set/data/chunk-000/file-000.parquet"};
  test::expect_refused(root, words, [&] { read(root); });
  test::expect_refused(root, words, [&] { array_columns(root); });
  std::filesystem::remove_all(root / "data");
  test::expect_refused(root, words, [&] { read(root); });
}

TEST(ParquetLog, WithoutNamesItsNumbersAreReadTheSame) {
  for (const char* info : {"", "{", "[]", R"({"features": 3})", R"({"features": {"observation.state": []}})"}) {
    const auto file = data_set(info);
    EXPECT_EQ(array_columns(file).at(0).names.at(1), "observation.state1") << info;
    EXPECT_EQ(read(file, of_lerobot("episode_4")).samples(), 60) << info;
  }
}

TEST(ParquetLog, AStructIsALogOfItsOwn) {
  const auto all = array_columns(files / "struct.parquet");
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].topic, "run");
  EXPECT_EQ(all[0].names, (std::vector<std::string>{"t", "q1", "q2", "tau1", "tau2"}));
  EXPECT_TRUE(read(files / "struct.parquet").tau == truth().tau);
}

TEST(ParquetLog, NullsBetweenNumbersAreRefusedAndAtTheEndsLeftOut) {
  refused("nulls.parquet", {"'tau2' is no number at t = 0.29 s", "from_s"});
  EXPECT_TRUE(read(files / "nulls.parquet", {}, 2, 0.3, {}).tau == truth().tau.bottomRows(35));
  const Log log = read(files / "null_ends.parquet");
  EXPECT_TRUE(log.tau == truth().tau.middleRows(5, 53));
  EXPECT_NE(log.time_note.find("7 rows at its ends are not numbers in every column"), std::string::npos);
}

TEST(ParquetLog, WhatCanNotBeReadIsExplained) {
  refused("brotli.parquet", {"tau2 is packed by brotli: write it with compression='zstd'"});
  refused("ragged.parquet", {"ragged.parquet: tau has lists of different lengths"});
  refused("types.parquet", {"note is text"}, {.columns = {{"tau", "note"}}});
  refused("plain.parquet", {"no column 'torque1'"}, {.columns = {{"tau", "torque"}}});
}

TEST(ParquetLog, TextUnderItsNameIsExplained) {
  const auto pointer = test::write("file-000.parquet", "version https://git-lfs.github.com/spec/v1\noid sha256:12\n");
  test::expect_refused(pointer, {"is a pointer of Git LFS", "git lfs pull"}, [&] { read(pointer); });
  test::expect_refused(pointer, {"is a pointer of Git LFS"}, [&] { array_columns(pointer); });
  const auto text = test::write("text.parquet", "t,q1,tau1\n0,1,2\n");
  test::expect_refused(text, {"is no Parquet, but text"}, [&] { read(text); });
}

/// Two joints of 30 rows, but for one column.
std::vector<test::SmallColumn> small_columns(const test::SmallColumn& odd = {}) {
  std::vector<test::SmallColumn> out;
  for (const char* name : {"t", "q1", "q2", "tau1", "tau2"}) {
    std::vector<double> numbers(30);
    for (std::size_t k = 0; k < numbers.size(); ++k)
      numbers[k] = *name == 't' && name[1] == '\0' ? 0.01 * static_cast<double>(k) : std::sin(static_cast<double>(k));
    out.push_back({.name = name, .values = 30, .pages = test::small_page(30, test::small_numbers(numbers))});
    if (odd.name == name) out.back() = odd;
  }
  return out;
}

std::filesystem::path small(const test::SmallColumn& odd = {}, std::int64_t rows = 30) {
  return test::write("small.parquet", test::small_parquet(small_columns(odd), rows));
}

std::string zeros() { return test::small_numbers(std::vector<double>(30)); }

TEST(SmallParquet, IsRead) {
  EXPECT_EQ(read(small()).samples(), 30);
  EXPECT_EQ(read(small({.name = "tau2", .values = 30, .pages = test::small_page(30, zeros())})).tau(7, 1), 0);
}

TEST(SmallParquet, OlderWritersSayUnitsAndSignsInAnotherWay) {
  constexpr int int64 = 2, milliseconds = 9, microseconds = 10, unsigned_64 = 14, decimal = 5;
  const auto page = [](std::int64_t step, std::int64_t first) {
    std::string bytes;
    for (std::int64_t k = 0; k < 30; ++k) {
      const std::int64_t number = first + k * step;
      bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
    }
    return test::small_page(30, bytes);
  };
  const auto with = [&](const char* name, int converted, std::int64_t step, std::int64_t first = 0) {
    return small({.name = name, .type = int64, .values = 30, .pages = page(step, first), .converted = converted});
  };
  for (const auto& [unit, step] : {std::pair(milliseconds, 10), std::pair(microseconds, 10'000)})
    EXPECT_DOUBLE_EQ(read(with("t", unit, step)).t[29], 0.29);
  EXPECT_EQ(read(with("tau2", unsigned_64, 0, -1)).tau(0, 1), 18446744073709551615.0);
  EXPECT_EQ(read(with("tau2", -1, 0, -1)).tau(0, 1), -1);
  const auto file = with("tau2", decimal, 1);
  test::expect_refused(file, {"tau2 is decimal: write it as double"}, [&] { read(file); });
}

/// Of a list that is the field itself, repeated: 0 and 1 by turns in groups of eight, then 60 times 1, then numbers.
std::string repeated_field() {
  const auto with_length = [](const std::string& runs) {
    const auto length = static_cast<std::uint32_t>(runs.size());
    return std::string(reinterpret_cast<const char*>(&length), sizeof length) + runs;
  };
  std::vector<double> numbers(60);
  for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = static_cast<double>(k);
  return with_length("\x11" + std::string(8, '\xAA')) + with_length("\x78\x01") + test::small_numbers(numbers);
}

TEST(SmallParquet, AListMayBeAFieldThatIsRepeated) {
  std::vector<test::SmallColumn> columns = small_columns();
  columns.erase(columns.begin() + 3, columns.end());
  columns.push_back({.name = "tau", .repetition = 2, .values = 60, .pages = test::small_page(60, repeated_field())});
  const Log log = read(test::write("small.parquet", test::small_parquet(columns, 30)));
  EXPECT_EQ(log.tau(0, 0), 0);
  EXPECT_EQ(log.tau(0, 1), 1);
  EXPECT_EQ(log.tau(29, 1), 59);
}

TEST(SmallParquet, PagesThatNoWriterMakesAreRefused) {
  const auto is_refused = [](const test::SmallColumn& odd, const std::string& why) {
    const auto file = small(odd);
    test::expect_refused(file, {"tau2 " + why}, [&] { read(file); });
  };
  const auto with = [](const std::string& pages, int codec = 0, int repetition = 0, std::int64_t values = 30) {
    return test::SmallColumn{
        .name = "tau2", .repetition = repetition, .codec = codec, .values = values, .pages = pages};
  };
  is_refused(with(""), "ends in the middle");
  is_refused(with(test::small_page(20, zeros())), "ends in the middle");
  is_refused(with(test::small_page(31, zeros())), "is damaged");
  is_refused(with(test::small_page(30, zeros().substr(8))), "ends in the middle");
  is_refused(with(test::small_page(30, zeros(), 6)),
             "has numbers in an encoding that is not read (DELTA_LENGTH_BYTE_ARRAY)");
  is_refused(with(test::small_page(30, zeros(), 8)), "is damaged");
  is_refused(with(test::small_page(30, zeros(), 0, std::int64_t{1} << 40)), "is damaged");
  is_refused(with(test::small_page(30, zeros(), 0, 1 << 20)), "is damaged");
  for (const int codec : {1, 2, 6, 7}) is_refused(with(test::small_page(30, zeros()), codec), "is damaged");
  is_refused(with(test::small_page(30, zeros()), 0, 1), "ends in the middle");  // nullable, and no levels
  is_refused(with(test::small_page(30, zeros()), 0, 0, 60), "is damaged: copy the file again");
  is_refused(with(test::small_page(30, zeros()), 0, 2), "ends in the middle");  // a list, and no levels
}

TEST(SmallParquet, ASumThatIsWrongIsADamagedPage) {
  const auto page = [](std::uint32_t sum) {
    test::ThriftBytes levels;
    levels.integer(1, 30).integer(2, 0).integer(3, 3).integer(4, 3);
    return test::ThriftBytes()
               .integer(1, 0)
               .integer(2, 240)
               .integer(3, 240)
               .integer(4, static_cast<std::int32_t>(sum))
               .structure(5, levels)
               .bytes() +
           zeros();
  };
  constexpr std::uint32_t crc_of_zeros = 0xBC612413;  // python3 -c "import zlib; print(hex(zlib.crc32(bytes(240))))"
  EXPECT_EQ(read(small({.name = "tau2", .values = 30, .pages = page(crc_of_zeros)})).samples(), 30);
  const auto file = small({.name = "tau2", .values = 30, .pages = page(crc_of_zeros + 1)});
  test::expect_refused(file, {"tau2 is damaged: copy the file again"}, [&] { read(file); });
}

TEST(SmallParquet, AFooterThatClaimsTooMuchIsDamaged) {
  const auto refused_as = [](const std::filesystem::path& file, const std::string& why) {
    test::expect_refused(file, {why}, [&] { read(file); });
  };
  refused_as(small({}, std::int64_t{1} << 50), "its footer is damaged");
  refused_as(small({.name = "q1", .values = std::int64_t{1} << 50, .pages = ""}), "its footer is damaged");
  refused_as(small({}, 31), "t is damaged");
  const std::string whole = test::small_parquet(small_columns(), 30);
  refused_as(test::write("small.parquet", whole.substr(0, 11)), "ends in the middle: copy it again");
  refused_as(test::write("small.parquet", whole.substr(0, whole.size() - 1)), "ends in the middle, or its writer");
  refused_as(test::write("small.parquet", "PAR1" + whole.substr(whole.size() - 8)), "is damaged");
  refused_as(test::write("small.parquet", "PARE" + whole.substr(4)), "is encrypted");
  std::string encrypted = whole;
  encrypted.back() = 'E';
  refused_as(test::write("small.parquet", encrypted), "is encrypted");
}

/// What page_kinds.py has written in that folder.
std::vector<std::filesystem::path> page_kinds(const char* subfolder) {
  const char* folder = std::getenv("FXDYN_PAGE_KINDS");
  if (folder == nullptr) return {};
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(folder) / subfolder))
    if (entry.path().extension() == ".parquet") out.push_back(entry.path());
  return out;
}

TEST(PageKinds, EveryNumberIsTheWritersOwn) {
  const auto all = page_kinds("");
  if (all.empty()) GTEST_SKIP() << "page_kinds.py gives the folder";
  const Log as_csv = truth();
  int compared = 0;  // page_kinds.py knows how many it should be
  for (const auto& file : all) {
    SCOPED_TRACE(file.filename());
    const std::string name = file.filename();
    if (name.starts_with("lerobot")) {
      LogFormat only = of_lerobot("");  // one episode
      only.columns.erase(topic_key);
      const Log log = read(file, only);
      ASSERT_EQ(log.samples(), 60);
      EXPECT_TRUE(log.q == as_csv.q.cast<float>().cast<double>());
      EXPECT_TRUE(log.dq == as_csv.dq.cast<float>().cast<double>());
      EXPECT_TRUE(log.tau == as_csv.tau.cast<float>().cast<double>());
      ++compared;
      continue;
    }
    const Log log = read(file);
    const Eigen::Index first = name.starts_with("holes") ? 5 : 0, count = name.starts_with("holes") ? 53 : 60;
    ASSERT_EQ(log.samples(), count);
    EXPECT_LT((log.t - as_csv.t.segment(first, count)).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_TRUE(log.q == as_csv.q.middleRows(first, count));
    EXPECT_TRUE(log.dq == as_csv.dq.middleRows(first, count));
    EXPECT_TRUE(log.tau == as_csv.tau.middleRows(first, count));
    ++compared;
  }
  testing::Test::RecordProperty("files", compared);
}

TEST(PageKinds, WhatIsNotReadIsNamed) {
  const auto all = page_kinds("refused");
  if (all.empty()) GTEST_SKIP() << "page_kinds.py gives the folder";
  int refused = 0;
  for (const auto& file : all) {
    std::ifstream text(std::filesystem::path(file).replace_extension(".txt"));
    std::string words;
    std::getline(text, words);
    test::expect_refused(file, {words}, [&] { read(file); });
    ++refused;
  }
  testing::Test::RecordProperty("files", refused);
}

/// What writers/run_parquet.sh has written.
class LongParquet : public testing::TestWithParam<const char*> {};

TEST_P(LongParquet, EveryNumberIsTheWritersOwn) {
  const char* folder = std::getenv("FXDYN_PARQUET");
  if (folder == nullptr) GTEST_SKIP() << "writers/run_parquet.sh gives the folder";
  const std::filesystem::path file = std::filesystem::path(folder) / GetParam();
  const bool is_lerobot = file.stem() == "lerobot";
  const Log as_csv = read(file.parent_path() / "truth.csv", {}, 6);
  const Log log = read(file, is_lerobot ? of_lerobot("episode_1") : LogFormat{}, 6);
  ASSERT_GT(log.samples(), 1000);
  ASSERT_EQ(log.samples(), as_csv.samples());
  if (is_lerobot) {
    EXPECT_TRUE(log.q == (as_csv.q.array() + 1).matrix().cast<float>().cast<double>());
    EXPECT_TRUE(log.tau == as_csv.tau.cast<float>().cast<double>());
    return;
  }
  EXPECT_TRUE(log.t == as_csv.t);
  EXPECT_TRUE(log.q == as_csv.q);
  EXPECT_TRUE(log.dq == as_csv.dq);
  EXPECT_TRUE(log.tau == as_csv.tau);
}

INSTANTIATE_TEST_SUITE_P(, LongParquet,
                         testing::Values("plain.parquet", "snappy.parquet", "zstd.parquet", "hyparquet.parquet",
                                         "lerobot.parquet"));

}  // namespace
}  // namespace fxdyn
