#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>

#include "host_tools/readers/log_reader.hpp"
#include "tests/bags/small_bag.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000, step_ns = 2'000'000;
constexpr const char* joint_state = "sensor_msgs/msg/JointState";
const std::vector<std::string> joints{"shoulder", "elbow"};

double q_of(int k, int joint) { return std::sin(0.05 * k + joint); }

/// 100 messages on each topic; the effort of message `nan` is none.
void add_states(test::SmallBag& bag, const std::string& topic, const std::vector<std::string>& names,
                const std::vector<int>& nan = {}, bool effort = true) {
  const auto id = bag.channel(topic, joint_state);
  for (int k = 0; k < 100; ++k) {
    const bool is_nan = std::find(nan.begin(), nan.end(), k) != nan.end();
    test::Reals tau{1.0 * k, is_nan ? std::nan("") : 2.0 * k};
    if (!effort) tau.clear();
    bag.message(id, begin_ns + k * step_ns,
                test::joint_state(begin_ns + k * step_ns, names, {q_of(k, 0), q_of(k, 1)}, {}, tau));
  }
}

Log read(const std::filesystem::path& file, const LogFormat& format = {}, std::optional<double> from = {},
         std::optional<double> to = {}, bool torque = true) {
  return read_log(file, 2, {true, true}, with_joint_names(file, format, joints), from, to, torque);
}

std::filesystem::path with_states(const std::string& topic, const std::vector<std::string>& names,
                                  const std::vector<int>& nan = {}, bool effort = true) {
  test::SmallBag bag;
  add_states(bag, topic, names, nan, effort);
  return test::write("states.mcap", bag.bytes());
}

TEST(BagLog, JointsAreFoundByTheirNames) {
  const auto file = with_states("/joint_states", {"elbow", "shoulder"});
  const Log log = read(file);
  ASSERT_EQ(log.samples(), 100);
  EXPECT_EQ(log.q(7, 0), q_of(7, 1));
  EXPECT_EQ(log.tau(7, 1), 7);
  EXPECT_EQ(log.dq.size(), 0);
  EXPECT_EQ(log.time_note, "");
  const Log window = read(file, {}, 0.05, 0.1);
  EXPECT_EQ(window.samples(), 25);
  EXPECT_NEAR(window.t[0], 0.05, 1e-12);
}

TEST(BagLog, AFileIsKnownByItsContent) {
  const auto file = with_states("/joint_states", joints);
  const auto renamed = test::folder() / "states.log";
  std::filesystem::copy_file(file, renamed);
  EXPECT_EQ(reader_of(renamed).name, "mcap");
  EXPECT_EQ(read(renamed).samples(), 100);
  EXPECT_EQ(reader_of(test::write("t.csv", "t,q1\n")).name, "csv");
  EXPECT_EQ(reader_of("no/such.mcap").name, "mcap");
  EXPECT_THROW(read("no/such.mcap"), InputError);
  EXPECT_TRUE(with_joint_names("no/such.csv", {}, joints) == LogFormat{});
}

TEST(BagLog, WithoutJointStatesItSaysWhatThereIs) {
  test::SmallBag bag;
  bag.message(bag.channel("/tf", "tf2_msgs/msg/TFMessage"), begin_ns, "");
  const auto file = test::write("tf.mcap", bag.bytes());
  test::expect_refused(file, {"no joint states", "/tf (tf2_msgs/msg/TFMessage)", "ros2 bag record /joint_states"},
                       [&] { read(file); });
}

TEST(BagLog, OtherJointsAreListed) {
  const auto file = with_states("/joint_states", {"arm_1", "arm_2"});
  test::expect_refused(file,
                       {"no topic has shoulder.position, elbow.position",
                        "/joint_states (sensor_msgs/msg/JointState) of arm_1, arm_2", "arm_1.position"},
                       [&] { read(file); });
  const LogFormat format{
      .joint_columns = {{"q", {"arm_1.position", "arm_2.position"}}, {"tau", {"arm_1.effort", "arm_2.effort"}}}};
  EXPECT_EQ(read(file, format).samples(), 100);
}

TEST(BagLog, WithoutTorqueItSaysSo) {
  const auto file = with_states("/joint_states", joints, {}, false);
  test::expect_refused(file, {"no shoulder.effort, elbow.effort", "measures no torque"}, [&] { read(file); });
  EXPECT_EQ(read(file, {}, {}, {}, false).samples(), 100);
}

TEST(BagLog, NanInTheMiddleIsRefusedAndAtTheEndsLeftOut) {
  const auto middle = with_states("/joint_states", joints, {50});
  test::expect_refused(middle, {"'elbow.effort' is no number at t = 0.1 s", "from_s"}, [&] { read(middle); });
  EXPECT_EQ(read(middle, {}, 0.11, {}).samples(), 45);
  const Log log = read(with_states("/joint_states", joints, {0, 1, 99}));
  EXPECT_EQ(log.samples(), 97);
  EXPECT_NE(log.time_note.find("3 rows at its ends"), std::string::npos) << log.time_note;
}

TEST(BagLog, TheTopicIsChosenOrAskedFor) {
  test::SmallBag bag;
  add_states(bag, "/left/joint_states", joints);
  add_states(bag, "/right/joint_states", joints, {3});
  const auto file = test::write("two.mcap", bag.bytes());
  test::expect_refused(file, {"/left/joint_states and /right/joint_states", "topic = \"/left/joint_states\""},
                       [&] { read(file); });
  EXPECT_EQ(read(file, {.columns = {{topic_key, "/left/joint_states"}}}).samples(), 100);
  test::expect_refused(file, {"'elbow.effort'"}, [&] {
    read(file, {.columns = {{topic_key, "/right/joint_states"}}});
  });
  test::expect_refused(file, {"on topic /none", "/left/joint_states"}, [&] {
    read(file, {.columns = {{topic_key, "/none"}}});
  });
  test::SmallBag with_default;
  add_states(with_default, "/left/joint_states", joints, {3});
  add_states(with_default, "/joint_states", joints);
  EXPECT_EQ(read(test::write("default.mcap", with_default.bytes())).samples(), 100);
}

TEST(BagLog, ACutRecordingIsUsedAndTold) {
  test::SmallBag bag;
  add_states(bag, "/joint_states", joints);
  const std::string whole = bag.bytes();
  const auto file = test::write("cut.mcap", whole.substr(0, whole.size() / 2));
  const Log log = read(file);
  EXPECT_GT(log.samples(), 50);
  EXPECT_LT(log.samples(), 100);
  EXPECT_NE(log.time_note.find("ends in the middle"), std::string::npos);
}

TEST(BagLog, AFolderNeedsItsParts) {
  const auto folder = test::folder() / "bag";
  std::filesystem::create_directories(folder);
  const auto metadata = [&](const std::string& names) {
    test::write("bag/metadata.yaml",
                "rosbag2_bagfile_information:\n  relative_file_paths:\n" + names + "  duration:\n");
  };
  metadata("    - bag_0.mcap\n    - bag_1.mcap\n");
  test::SmallBag bag;
  add_states(bag, "/joint_states", joints);
  test::write("bag/bag_0.mcap", bag.bytes());
  test::expect_refused(folder, {"bag_1.mcap, which is not there"}, [&] { read(folder); });
  metadata("    - bag_0.mcap\n");
  EXPECT_EQ(read(folder).samples(), 100);
}

}  // namespace
}  // namespace fxdyn
