#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/logs/recorded_log.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using test::Bad;
using test::write;

Log read(const std::filesystem::path& file, std::size_t joints = 1, const LogFormat& format = {}) {
  return uniform_log(read_csv, file, joints, std::vector<bool>(joints, true), format, {}, {});
}

/// t, q1, dq1, tau1 of a sine, with units as asked for.
std::string sine(double q_unit, double dq_unit, double t_unit = 1, bool with_dq = true, double amplitude = 1) {
  std::string text = with_dq ? "t,q1,dq1,tau1\n" : "t,q1,tau1\n";
  for (int i = 0; i < 4000; ++i) {
    const double t = i * 0.002, w = 2;
    text += fmt::format("{},{}", t * t_unit, q_unit * amplitude * std::sin(w * t));
    if (with_dq) text += fmt::format(",{}", dq_unit * amplitude * w * std::cos(w * t));
    text += ",0\n";
  }
  return text;
}
constexpr double degrees = 180 / std::numbers::pi;

class BadCsv : public testing::TestWithParam<Bad> {};
TEST_P(BadCsv, IsRefusedInOneLine) {
  const auto file = write("bad_" + GetParam().name + ".csv", GetParam().text);
  test::expect_refused(file, GetParam().message, [&] { read(file); });
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadCsv,
    testing::Values(
        Bad{"empty", "", {":1:", "name the columns"}}, Bad{"blank", "\n\n", {"name the columns"}},
        Bad{"no_header", "0.0,1,2\n0.1,1,2\n", {":1:", "first line must name the columns"}},
        Bad{"semicolons", "t;q1;tau1\n0;1;2\n", {":1:", "separate columns by commas"}},
        Bad{"no_torque", "t,q1,dq1,tua1\n0,1,2,3\n", {":1:", "no column 'tau1'", "nearest is 'tua1'", "columns ="}},
        Bad{"no_time", "time,q1,tau1\n0,1,2\n", {":1:", "no column 't'"}},
        Bad{"twice", "t,q1,q1,tau1\n0,1,2,3\n", {":1:", "'q1' appears twice"}},
        Bad{"other_robot", "t,q1,q2,tau1,tau2\n0,1,2,3,4\n", {":1:", "'q2'", "1 moving joints", "another robot's"}},
        Bad{"header_only", "t,q1,tau1\n", {"fewer than 2 rows"}},
        Bad{"one_row", "t,q1,tau1\n0,1,2\n", {":2:", "fewer than 2 rows"}},
        Bad{"nan", "t,q1,tau1\n0,1,2\n0.1,nan,2\n", {":3:", "'q1'", "'nan' is not a number"}},
        Bad{"inf", "t,q1,tau1\n0,1,2\n0.1,1,-inf\n", {":3:", "'tau1'", "not a number"}},
        Bad{"missing_value", "t,q1,tau1\n0,1,2\n0.1,,2\n", {":3:", "'q1'", "not a number"}},
        Bad{"text", "t,q1,tau1\n0,1,2\n0.1,1,2Nm\n", {":3:", "'tau1'", "'2Nm' is not a number"}},
        Bad{"hex", "t,q1,tau1\n0,1,2\n0.1,0x10,2\n", {":3:", "not a number"}},
        Bad{"backwards", "t,q1,tau1\n0,1,2\n0.2,1,2\n0.1,1,2\n", {":4:", "time goes backwards"}},
        Bad{"standing", "t,q1,tau1\n0,1,2\n0.2,1,2\n0.2,1,2\n", {":4:", "time stands still"}},
        Bad{"few_fields", "t,q1,tau1\n0,1,2\n0.1,1\n", {":3:", "2 fields where the header has 3"}},
        Bad{"many_fields", "t,q1,tau1\n0,1,2\n0.1,1,2,3\n", {":3:", "4 fields where the header has 3"}},
        Bad{"gap",
            "t,q1,tau1\n0,1,2\n0.1,1,2\n0.2,1,2\n0.3,1,2\n5,1,2\n5.1,1,2\n",
            {"gap of 4.7 s", "0.3 s", "from_s"}},
        Bad{"q_in_degrees", sine(degrees, 1), {"q1 looks like degrees", "pi/180"}},
        Bad{"dq_in_degrees", sine(1, degrees), {"dq1 looks like degrees", "pi/180"}},
        Bad{"all_in_degrees", sine(degrees, degrees), {"q1 looks like degrees", "pi/180"}},
        Bad{"degrees_without_dq", sine(degrees, 1, 1, false), {"q1 looks like degrees", "pi/180"}},
        Bad{"two_units", sine(1, 1, 1e4), {"20 apart may be ms at 50 samples a second or us at 5e+04", "time_unit ="}},
        Bad{"no_unit", sine(1, 1, 1e12), {"in no unit of a robot's log", "time_unit ="}},
        Bad{"milliseconds_at_10_kHz", sine(1, 20, 50), {"t looks like milliseconds", "time_unit = \"ms\""}},
        Bad{"other_format", "PK\x03\x04xl/workbook", {"is a spreadsheet", "save it as CSV"}},
        Bad{"from_zero", "t,q0,tau0\n0,1,2\n", {"count from 0", "q = [\"q0\"]"}}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(Csv, DegreesBesideAVelocityInRadiansCanBeRead) {
  const auto file = write("degrees_and_rad.csv", sine(degrees, 1));
  LogFormat format;
  format.position_gain = {1 / degrees};
  test::expect_refused(file, {"dq = false"}, [&] { uniform_log(read_csv, file, 1, {true}, format, {}, {}); });
  format.columns["dq"] = "";
  const Log log = uniform_log(read_csv, file, 1, {true}, format, {}, {}), rad = read(write("rad.csv", sine(1, 1)));
  EXPECT_EQ(log.dq.size(), 0);
  EXPECT_LT((log.q - rad.q).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Csv, StampsOfOtherUnitsAreSeconds) {
  for (const double per_second : {1e3, 1e6, 1e9}) {
    const Log log = read(write("unit.csv", sine(1, 1, per_second)));
    EXPECT_NEAR(log.step_s, 0.002, 1e-12) << per_second;
    EXPECT_FALSE(log.resampled);
    EXPECT_EQ(log.t[1], 0.002) << per_second;  // windows name such instants
  }
}

TEST(Csv, TheUnitOfStampsMayBeWrittenDown) {
  LogFormat format;
  format.time_unit_s = 1e-6;
  EXPECT_NEAR(read(write("given.csv", sine(1, 1, 1e4)), 1, format).step_s, 2e-5, 1e-12);
  format = {};
  format.columns["t"] = "stamp_ns";
  std::string text = sine(1, 1, 1e9);
  text.replace(0, 1, "stamp_ns");
  EXPECT_NEAR(read(write("named.csv", text), 1, format).step_s, 0.002, 1e-12);
}

TEST(Csv, StampsSince1970AreTakenByTheirSize) {
  std::string text = "t,q1,tau1\n";
  for (int i = 0; i < 200; ++i) text += fmt::format("{},0.{},1\n", 1'700'000'000'000LL + 30 * i, i);
  const Log log = read(write("epoch_ms.csv", text));  // 30 ms: as numbers alone, ms or us
  EXPECT_NEAR(log.step_s, 0.03, 1e-6);
  EXPECT_NEAR(log.t[0], 1.7e9, 1e-3);
}

TEST(Csv, CommentsAreSkippedAndMayNameTheColumns) {
  const std::string rows = "0,1,2\n# paused\n0.1,3,4\n";
  EXPECT_EQ(read(write("commented.csv", "% robot 7\nt,q1,tau1\n" + rows)).q(1, 0), 3);
  EXPECT_EQ(read(write("numpy.csv", "# robot 7\n# t,q1,tau1\n" + rows)).tau(1, 0), 4);
  EXPECT_EQ(read(write("rostopic.csv", "%t,q1,tau1\n" + rows)).tau(1, 0), 4);
}

TEST(Csv, FieldsMayBeApartByTabsOrBlanks) {
  const std::string names = "t q1 tau1", rows = "\n0 1 2\n0.1 3 4\n", table = names + rows;
  for (const char mark : {' ', '\t'}) {
    const auto with = [&](std::string text) {
      std::replace(text.begin(), text.end(), ' ', mark);
      return write("apart.csv", text);
    };
    EXPECT_EQ(read(with(table)).tau(1, 0), 4);
    EXPECT_EQ(read(with(names + " \r\n0 1 2 \r\n0.1 3 4 \r\n")).tau(1, 0), 4);
    EXPECT_EQ(read(with("#" + table)).q(1, 0), 3);
    const auto short_row = with(table + "0.2 1\n");
    test::expect_refused(short_row, {":4:", "2 fields where the header has 3"}, [&] { read(short_row); });
    const auto empty = with(table + "0.2  1\n");
    test::expect_refused(empty, {":4:", "'q1'", "'' is not a number"}, [&] { read(empty); });
  }
  const auto commas = write("commas.csv", names + "\n0 1,5 2\n0,1 3,5 4\n");
  test::expect_refused(commas, {":1:", "separate columns by commas"}, [&] { read(commas); });
}

TEST(Csv, SineInRadiansIsFine) {
  EXPECT_EQ(read(write("sine.csv", sine(1, 1))).samples(), 4000);
  EXPECT_EQ(read(write("sine_q.csv", sine(1, 1, 1, false))).samples(), 4000);
}

TEST(Csv, ManyTurnsAreNotDegrees) {
  EXPECT_NO_THROW(read(write("fast.csv", sine(1, 1, 1, true, 12))));   // 24 rad/s, but less than four turns
  EXPECT_NO_THROW(read(write("slow.csv", sine(1, 1, 4, false, 40))));  // thirteen turns, 20 rad/s
}

TEST(Csv, AnArmOfTurningJointsIsInDegrees) {
  std::string text = "t,q1,q2,q3,tau1,tau2,tau3\n";
  for (int i = 0; i < 1000; ++i) {
    const double q = 10 * std::sin(0.01 * i);  // slower than a joint may be
    text += fmt::format("{},{},{},{},0,0,0\n", 0.02 * i, q, -q, i % 2);
  }
  const auto file = write("arm_in_degrees.csv", text);
  test::expect_refused(file, {"q looks like degrees", "2 of 3 joints"}, [&] { read(file, 3); });
  EXPECT_NO_THROW(uniform_log(read_csv, file, 3, {true, false, true}, {}, {}, {}));
}

TEST(Csv, MissingFileIsNamed) {
  test::expect_refused("nowhere.csv", {"can't be read"}, [] { read("/nowhere.csv"); });
}

TEST(Csv, ReadsWhatItWrote) {
  Log log;
  const Eigen::Index n = 50;
  log.t = Eigen::VectorXd::LinSpaced(n, 100.0, 100.49);
  for (Eigen::MatrixXd* signal : {&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink}) signal->setRandom(n, 3);
  log.qlink.col(1).setConstant(std::nan(""));
  const auto file = write("round.csv", "");
  write_log(file, log);
  const Log back = read(file, 3);
  EXPECT_EQ(back.q, log.q);
  EXPECT_EQ(back.dq, log.dq);
  EXPECT_EQ(back.ddq, log.ddq);
  EXPECT_EQ(back.tau, log.tau);
  EXPECT_EQ(back.t, log.t);
  EXPECT_EQ(back.qlink.col(2), log.qlink.col(2));
  EXPECT_TRUE(std::isnan(back.qlink(0, 1)));
  EXPECT_FALSE(back.resampled);
  EXPECT_NEAR(back.step_s, 0.01, 1e-12);
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".tmp"));
}

TEST(Csv, AcceptsWhatSpreadsheetsWrite) {
  const Log log =
      read(write("excel.csv", "\xEF\xBB\xBF\"t\", q1 ,note,tau1\r\n0, +1.5,start,2\r\n0.1,1.25e0 ,,-2\r\n\r\n"));
  ASSERT_EQ(log.samples(), 2);
  EXPECT_EQ(log.q(0, 0), 1.5);
  EXPECT_EQ(log.tau(1, 0), -2);
  EXPECT_EQ(log.dq.size(), 0);
}

TEST(Csv, MapsColumnsAndScalesTorque) {
  const auto file = write("mapped.csv", "time,q1,q2,i1,i2\n0,0,0,1,2\n1,0,0,3,4\n");
  LogFormat format;
  format.columns = {{"t", "time"}, {"tau", "i"}};
  format.torque_gain = {10, -1};
  const Log log = read(file, 2, format);
  EXPECT_EQ(log.tau(1, 0), 30);
  EXPECT_EQ(log.tau(1, 1), -4);
  format.columns["dq"] = "v";  // asked for, so it has to be there
  test::expect_refused(file, {":1:", "no column 'v1'", "dq of joint 1"}, [&] { read(file, 2, format); });
  format.torque_gain = {1};
  test::expect_refused(file, {"torque_gain has 1 values for 2 joints"}, [&] { read(file, 2, format); });
}

TEST(Csv, AMissingColumnsAdviceCanBePastedAndIsOfItsOwnSignal) {
  const auto one_other = write("one_other.csv", "t,q1,q2,dq1,dq2,tau1,torque2\n0,0,0,0,0,1,2\n1,0,0,0,0,3,4\n");
  test::expect_refused(one_other,
                       {"no column 'tau2'", "nearest is 'torque2'", R"(columns = { tau = ["tau1", "torque2"] })"},
                       [&] { read(one_other, 2, {}); });
  const auto other_prefix = write("other_prefix.csv", "t,q1,q2,tau1,tau2\n0,0,0,1,2\n1,0,0,3,4\n");
  LogFormat format;
  format.columns = {{"tau", "torque"}};
  test::expect_refused(other_prefix, {"no column 'torque1'", R"(columns = { tau = ["tau1", "tau2"] })"},
                       [&] { read(other_prefix, 2, format); });
  const auto none = write("no_torque_at_all.csv", "t,q1,q2,dq1,dq2\n0,0,0,1,2\n1,0,0,3,4\n");
  try {
    read(none, 2, {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find("tau = ["), std::string::npos) << error.what();
  }
}

TEST(Csv, AColumnIsOneSignal) {
  const auto file = write("twice.csv", "t,q1,q2,x\n0,0,0,1\n1,0,0,3\n");
  LogFormat format;
  format.joint_columns = {{"tau", {"q1", "x"}}};
  test::expect_refused(file, {":1:", "column 'q1' is q of joint 1 and tau of joint 1"}, [&] { read(file, 2, format); });
}

TEST(Csv, ColumnsByNumberNeedNoNames) {
  const std::string rows = "0,1,2,3,4\n0.1,5,6,7,8\n";
  LogFormat format;
  format.columns["t"] = "#0";
  format.joint_columns = {{"q", {"#2", "#1"}}, {"tau", {"#4", "#3"}}};
  for (const std::string& text : {rows, "t,a,b,c,d\n" + rows}) {
    const Log log = read(write("numbers.csv", text), 2, format);
    ASSERT_EQ(log.samples(), 2);
    EXPECT_EQ(log.q.row(1), Eigen::RowVector2d(6, 5));
    EXPECT_EQ(log.tau.row(0), Eigen::RowVector2d(4, 3));
  }
  format.joint_columns["tau"] = {"#4", "#9"};
  const auto file = write("few_numbers.csv", rows);
  test::expect_refused(file, {":1:", "no column 9", "the file has 5"}, [&] { read(file, 2, format); });
}

TEST(Csv, ColumnsJointByJointStandInTheChainsOrder) {
  const auto file = write("joints.csv", "t,elbow,shoulder,i_elbow,i_shoulder\n0,1,2,3,4\n1,1,2,3,4\n");
  LogFormat format;
  format.joint_columns = {{"q", {"shoulder", "elbow"}}, {"tau", {"i_shoulder", "i_elbow"}}};
  const Log log = read(file, 2, format);
  EXPECT_EQ(log.q.row(0), Eigen::RowVector2d(2, 1));
  EXPECT_EQ(log.tau.row(0), Eigen::RowVector2d(4, 3));
}

TEST(Csv, GainsAndOffsetsOfPositions) {
  const auto file = write("gains.csv", "t,q1,q2,dq1,dq2,tau1,tau2\n0,10,2,10,2,1,1\n1,20,2,10,2,1,1\n");
  LogFormat format;
  format.position_gain = {0.1, -1};
  format.position_offset = {0, 0.5};
  const Log log = read(file, 2, format);
  EXPECT_DOUBLE_EQ(log.q(1, 0), 2);
  EXPECT_DOUBLE_EQ(log.dq(1, 0), 1);
  EXPECT_DOUBLE_EQ(log.q(1, 1), -1.5);
  EXPECT_DOUBLE_EQ(log.dq(1, 1), -2);
  format.position_gain = {0.1};
  test::expect_refused(file, {"position_gain has 1 values for 2 joints"}, [&] { read(file, 2, format); });
}

TEST(Csv, TorqueMayBeMissingForPrediction) {
  const auto file = write("no_tau.csv", "t,q1\n0,0\n1,0\n");
  EXPECT_EQ(uniform_log(read_csv, file, 1, {true}, {}, {}, {}, false).tau.size(), 0);
}

TEST(Csv, WindowIsHalfOpen) {
  const auto file = write("window.csv", "t,q1,tau1\n10,0,0\n11,1,0\n12,2,0\n13,3,0\n14,4,0\n");
  const Log log = uniform_log(read_csv, file, 1, {true}, {}, 11.0, 13.0);
  ASSERT_EQ(log.samples(), 2);
  EXPECT_EQ(log.t[0], 11);
  EXPECT_EQ(log.t[1], 12);
  test::expect_refused(file, {"window [0, 5) s holds 0 rows", "10 to 14 s"},
                       [&] { uniform_log(read_csv, file, 1, {true}, {}, 0.0, 5.0); });
}

TEST(Csv, IrregularStampsAreResampled) {
  std::string text = "t,q1,tau1\n";
  for (int i = 0; i < 101; ++i) {
    const double t = 0.01 * i + (i % 10 == 3 ? 0.004 : 0.0);
    text += fmt::format("{},{},{}\n", t, 2 * t, 1 - t);
  }
  const Log log = read(write("irregular.csv", text));
  EXPECT_TRUE(log.resampled);
  EXPECT_NEAR(log.step_s, 0.01, 1e-12);
  EXPECT_EQ(log.samples(), 101);
  EXPECT_LT((log.q.col(0) - 2 * log.t).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((log.tau.col(0).array() - 1 + log.t.array()).abs().maxCoeff(), 1e-12);
}

TEST(Csv, AnEncoderKeepsItsStepWhenItsLogIsResampled) {
  const double step = 2 * std::numbers::pi / 4096;
  std::string text = "t,q1,q2,tau1,tau2\n";
  for (int i = 0; i < 400; ++i) {
    const double t = 0.005 * i + (i % 7 == 3 ? 0.002 : 0.0), q = std::sin(3 * t);
    text += fmt::format("{},{:.6g},{},0,0\n", t, step * std::round(q / step), q);
  }
  const Log log = uniform_log(read_csv, write("steps.csv", text), 2, {true, true}, {}, {}, {});
  ASSERT_TRUE(log.resampled);
  EXPECT_NEAR(log.encoder_step[0], step, 1e-5);
  EXPECT_EQ(log.encoder_step[1], 0);
  EXPECT_LT(encoder_step(log.q.col(0)), 0.5 * step);  // of what stands between the samples
}

TEST(Csv, WholeTurnsAreUnwrapped) {
  std::string text = "t,q1,tau1\n";
  for (int i = 0; i < 300; ++i)
    text += fmt::format("{},{},0\n", 0.01 * i, std::remainder(0.1 * i, 2 * std::numbers::pi));
  const auto file = write("wrapped.csv", text);
  EXPECT_NEAR(read(file).q(299, 0), 29.9, 1e-9);
  EXPECT_LT(uniform_log(read_csv, file, 1, {false}, {}, {}, {}).q(299, 0), 4);  // metres don't wrap
}

}  // namespace
}  // namespace fxdyn
