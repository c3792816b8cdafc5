// Cut files and flipped bytes: read or refused, never worse.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <sstream>

#include "host_tools/readers/log_reader.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

const std::filesystem::path files = std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/arrays/files";

std::string bytes_of(const std::string& name) {
  std::ostringstream out;
  out << std::ifstream(files / name, std::ios::binary).rdbuf();
  return out.str();
}

/// Whether it was read; refused with anything but one line of an InputError fails the test.
bool is_read(const std::filesystem::path& file) {
  try {
    for (const auto& group : array_columns(file)) {
      LogFormat format{.columns = {{topic_key, group.topic}}};
      if (group.topic.starts_with("data/")) format.columns.insert({{"q", "obs.q"}, {"tau", "obs.tau"}});
      if (group.topic.starts_with("episode_"))
        format.columns.insert({{"q", "observation.state"}, {"tau", "observation.effort"}});
      read_log(file, 2, {true, true}, format, {}, {});
    }
    return true;
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find(file.filename().string()), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    return false;
  }
}

class DamagedArrays : public testing::TestWithParam<const char*> {};

TEST_P(DamagedArrays, CutFilesAreRefused) {
  const std::string whole = bytes_of(GetParam()), ending = std::filesystem::path(GetParam()).extension();
  ASSERT_TRUE(is_read(test::write("whole" + ending, whole)));
  for (const double share : {0.02, 0.3, 0.7, 0.99}) {
    const auto file = test::write("cut" + ending,
                                  whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    EXPECT_FALSE(is_read(file)) << share;
  }
}

TEST_P(DamagedArrays, FlippedBytesAreReadOrRefused) {
  const std::string whole = bytes_of(GetParam()), ending = std::filesystem::path(GetParam()).extension();
  std::mt19937 random(1);
  int refused = 0;
  for (int k = 0; k < 60; ++k) {
    std::string bytes = whole;
    for (int flips = 1 + static_cast<int>(random() % 8); flips > 0; --flips) {
      // Half of them where the structure is.
      const std::size_t range = random() % 2 == 0 ? std::min<std::size_t>(3000, bytes.size() - 8) : bytes.size() - 8;
      bytes[8 + random() % range] = static_cast<char>(random());
    }
    refused += is_read(test::write("flipped" + ending, bytes)) ? 0 : 1;
  }
  EXPECT_GT(refused, 10);
}

INSTANTIATE_TEST_SUITE_P(, DamagedArrays,
                         testing::Values("plain.mat", "rows.mat", "scope.mat", "packed.hdf5", "robomimic.hdf5",
                                         "plain.parquet", "snappy.parquet", "gzip.parquet", "zstd.parquet",
                                         "lz4.parquet", "types.parquet", "lerobot.parquet", "struct.parquet"));

TEST(DamagedArray, APackedVariableMustUnpackToItsEnd) {
  std::string bytes = bytes_of("rows.mat");
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  const auto file = test::write("flipped.mat", bytes);
  test::expect_refused(file, {"is damaged", "save it again"}, [&] { read_log(file, 2, {true, true}, {}, {}, {}); });
}

TEST(DamagedArray, AnEmptyFileIsNone) {
  for (const char* name : {"empty.mat", "empty.h5", "empty.parquet"}) EXPECT_FALSE(is_read(test::write(name, "")));
  EXPECT_FALSE(is_read(test::write("text.mat", "t,q1,tau1\n0,1,2\n")));
}

}  // namespace
}  // namespace fxdyn
