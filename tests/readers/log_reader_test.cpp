#include "host_tools/readers/log_reader.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

RecordedLog read_three_rows(const LogRequest& request) {
  RecordedLog out;
  out.log.t = Eigen::Vector3d(0, 0.1, 0.2);
  out.log.q = Eigen::MatrixXd::Constant(3, static_cast<Eigen::Index>(request.joints), 0.5);
  return out;
}

constexpr std::array with_one_more{LogReader{"binary", ".bin", read_three_rows}, LogReader{"csv", ".csv", read_csv}};

TEST(LogReaders, AFormatIsChosenByTheExtension) {
  EXPECT_EQ(reader_of("logs/run1.bin", with_one_more).name, "binary");
  EXPECT_EQ(reader_of("logs/run1.BIN", with_one_more).name, "binary");
  EXPECT_EQ(reader_of("logs/run1.csv", with_one_more).name, "csv");
}

TEST(LogReaders, TheLastReadsWhatNoOtherKnows) {
  EXPECT_EQ(reader_of("logs/run1.txt", with_one_more).name, "csv");
  EXPECT_EQ(reader_of("logs/run1", with_one_more).name, "csv");
  EXPECT_EQ(reader_of("logs/run1.txt").name, "csv");
}

TEST(LogReaders, AnEntryReads) {
  const RecordedLog recorded =
      reader_of("run1.bin", with_one_more).read({.file = "run1.bin", .joints = 2, .columns = {}});
  EXPECT_EQ(recorded.log.samples(), 3);
  EXPECT_EQ(recorded.log.joints(), 2);
}

}  // namespace
}  // namespace fxdyn
