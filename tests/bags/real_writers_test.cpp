// Recordings that other programs wrote (writers/run.sh), against the CSV of the same motion.
#include <gtest/gtest.h>

#include <cstdlib>

#include "host_tools/readers/log_reader.hpp"

namespace fxdyn {
namespace {

const std::vector<std::string> joints{"base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"};

Log read(const std::filesystem::path& file) {
  return read_log(file, joints.size(), std::vector<bool>(joints.size(), true), with_joint_names(file, {}, joints), {},
                  {});
}

class RealWriters : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("FXDYN_BAGS");
    if (folder == nullptr) GTEST_SKIP() << "writers/run.sh gives the folder";
    folder_ = folder;
  }
  std::filesystem::path folder_;
};

TEST_P(RealWriters, EveryNumberIsTheWritersOwn) {
  const Log truth = read(folder_ / "truth.csv"), log = read(folder_ / GetParam());
  ASSERT_GT(truth.samples(), 1000);
  ASSERT_EQ(log.samples(), truth.samples());
  EXPECT_TRUE(log.q == truth.q);
  EXPECT_TRUE(log.dq == truth.dq);
  EXPECT_TRUE(log.tau == truth.tau);
  EXPECT_LT((log.t - truth.t).cwiseAbs().maxCoeff(), 1e-9);  // stamps are whole ns
  EXPECT_FALSE(log.resampled);
}

INSTANTIATE_TEST_SUITE_P(, RealWriters,
                         testing::Values("zstd.mcap", "lz4.mcap", "plain.mcap", "unchunked.mcap", "unindexed.mcap",
                                         "big_endian.mcap", "cdr2.mcap", "cdr2_big_endian.mcap", "controller_old.mcap",
                                         "controller_new.mcap", "two_publishers.mcap", "camera.mcap", "humble.db3",
                                         "jazzy.db3", "split", "packed", "messages", "text.csv.zst", "text.csv.gz"));

}  // namespace
}  // namespace fxdyn
