// Files that SciPy and h5py wrote (writers/write_arrays.py), against the CSV of the same motion.
#include <gtest/gtest.h>

#include "host_tools/readers/log_reader.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

const std::filesystem::path files = std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/arrays/files";

Log read(const std::string& name, const LogFormat& format = {}, std::optional<double> from = {},
         std::optional<double> to = {}, bool torque = true) {
  const auto file = files / name;
  return read_log(file, 2, {true, true}, with_joint_names(file, format, {"shoulder", "elbow"}), from, to, torque);
}

void refused(const std::string& name, const std::vector<std::string>& parts, const LogFormat& format = {}) {
  test::expect_refused(files / name, parts, [&] { read(name, format); });
}

void expect_same(const Log& log, const Log& truth) {
  ASSERT_EQ(log.samples(), truth.samples());
  EXPECT_TRUE(log.t == truth.t);
  EXPECT_TRUE(log.q == truth.q);
  EXPECT_TRUE(log.dq == truth.dq);
  EXPECT_TRUE(log.tau == truth.tau);
  EXPECT_EQ(log.time_note, "");
}

struct Written {
  const char* name;
  LogFormat format{};
};

void PrintTo(const Written& written, std::ostream* out) { *out << written.name; }

class WrittenArrays : public testing::TestWithParam<Written> {};

TEST_P(WrittenArrays, EveryNumberIsTheWritersOwn) {
  const Log truth = read("truth.csv");
  ASSERT_EQ(truth.samples(), 60);
  expect_same(read(GetParam().name, GetParam().format), truth);
}

INSTANTIATE_TEST_SUITE_P(, WrittenArrays,
                         testing::Values(Written{"plain.mat"}, Written{"rows.mat"}, Written{"old.mat"},
                                         Written{"columns.mat"},
                                         Written{"struct.mat", {.columns = {{"dq", "qd"}, {"tau", "torque"}}}},
                                         Written{"simulink.mat"}, Written{"scope.mat", {.columns = {{"t", "time"}}}},
                                         Written{"two_logs.mat", {.columns = {{topic_key, "second"}}}},
                                         Written{"plain.h5"}, Written{"packed.hdf5"}, Written{"rows.h5"},
                                         Written{"group.h5"}, Written{"big_endian.h5"},
                                         Written{"group.h5", {.columns = {{topic_key, "/run"}}}}));

TEST(ArrayLog, NumbersOfAllTypesAreRead) {
  const Log truth = read("truth.csv");
  const LogFormat format{.torque_gain = {1e-3, 1e-3}};
  const Log log = read("types.mat", format);
  ASSERT_EQ(log.samples(), truth.samples());
  EXPECT_LT((log.t - truth.t).array().abs().maxCoeff() - 0.25, 1e-12);
  EXPECT_TRUE(log.q == truth.q.cast<float>().cast<double>());
  EXPECT_LE((log.tau - truth.tau).cwiseAbs().maxCoeff(), 0.5e-3 + 1e-12);
  EXPECT_EQ(log.dq.size(), 0);
}

TEST(ArrayLog, AWindowIsCutOut) {
  const Log log = read("plain.h5", {}, 0.27, 0.3);
  EXPECT_EQ(log.samples(), 15);
  EXPECT_TRUE(log.tau == read("truth.csv").tau.middleRows(10, 15));
}

TEST(ArrayLog, AFileIsKnownByItsContent) {
  EXPECT_EQ(reader_of(files / "plain.mat").name, "matlab");
  EXPECT_EQ(reader_of(files / "old.mat").name, "matlab");
  EXPECT_EQ(reader_of(files / "packed.hdf5").name, "hdf5");
  const auto renamed = test::folder() / "plain.csv";
  std::filesystem::copy_file(files / "plain.h5", renamed, std::filesystem::copy_options::overwrite_existing);
  EXPECT_EQ(reader_of(renamed).name, "hdf5");
  EXPECT_EQ(reader_of("no/such.mat").name, "matlab");
  EXPECT_THROW(read_log("no/such.mat", 2, {true, true}, {}, {}, {}), InputError);
}

TEST(ArrayLog, ADemonstrationIsChosenOrAskedFor) {
  const LogFormat obs{.columns = {{"q", "obs.q"}, {"tau", "obs.tau"}}};
  refused("robomimic.hdf5", {"data/demo_2, data/demo_10 all have these joints", "topic = \"data/demo_2\""}, obs);
  LogFormat tenth = obs;
  tenth.columns[topic_key] = "data/demo_10";
  const Log log = read("robomimic.hdf5", tenth);
  const Log truth = read("truth.csv");
  EXPECT_TRUE(log.tau == truth.tau);
  EXPECT_TRUE(log.q == (truth.q.array() + 10).matrix());
  EXPECT_EQ(log.step_s, 0.05);  // control_freq = 20
  tenth.columns[topic_key] = "data/demo_3";
  refused("robomimic.hdf5", {"no log is called data/demo_3", "it has data/demo_2, data/demo_10"}, tenth);
  refused("no_rate.hdf5", {"no time stamps", "data/demo_0/obs/q (60 x 2 float64)"});
}

TEST(ArrayLog, SeveralStructsAreAskedFor) {
  refused("two_logs.mat", {"first, second all have these joints", "topic = \"first\""});
}

TEST(ArrayLog, WhatIsThereIsSaid) {
  refused("no_time.mat", {"no time stamps", "q (60 x 2 double)", "robot (3 text)", "columns = { t = \"..\" }"});
  refused("struct.mat", {"struct.mat: log: no column 'tau1' (signal tau of joint 1)", "torque1 .. torque2"});
  refused("struct.mat", {"no column 'no_such' (time stamps)"}, {.columns = {{"t", "no_such"}}});
  refused("records.h5", {"no time stamps", "log (60 record)"});
}

TEST(ArrayLog, WhatIsNoMatrixOfNumbersIsExplained) {
  refused("cell.mat", {"q is a cell", "cell2mat(q)"});
  refused("sparse.mat", {"tau is sparse", "full(tau)"});
  refused("complex.mat", {"q is complex", "real(q)"});
  refused("complex.h5", {"q is complex"});
  refused("text.h5", {"tau is text"});
  refused("shape.mat", {"tau is 59 x 2 double, and t has 60 samples"});
  refused("two_times.mat", {"have different times"});
  refused("lzf.h5", {"is packed by", "compression='gzip'"});
}

TEST(ArrayLog, NanInTheMiddleIsRefusedAndAtTheEndsLeftOut) {
  refused("nan.mat", {"'tau2' is no number at t = 0.29 s", "from_s"});
  refused("zeros.mat", {"time goes backwards at 0 s, sample 58"});
  const Log log = read("unfilled.mat");
  EXPECT_EQ(log.samples(), 55);
  EXPECT_NE(log.time_note.find("5 samples behind its last time stamp"), std::string::npos) << log.time_note;
  EXPECT_EQ(read("nan.mat", {}, 0.3, {}).samples(), 35);
}

TEST(ArrayLog, WithoutTorqueItIsReadWhereNoneIsNeeded) {
  EXPECT_EQ(read("sparse.mat", {}, {}, {}, false).samples(), 60);
}

TEST(ArrayLog, ItsColumnsAreListed) {
  const auto all = array_columns(files / "robomimic.hdf5");
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].topic, "data/demo_2");
  EXPECT_EQ(all[0].names,
            (std::vector<std::string>{"t", "actions1", "actions2", "obs.q1", "obs.q2", "obs.tau1", "obs.tau2"}));
}

}  // namespace
}  // namespace fxdyn
