#include "host_tools/bags/joint_recording.hpp"

#include <gtest/gtest.h>

#include "tests/bags/small_bag.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000, ms = 1'000'000;

/// A bag of one topic, message by message.
class States {
 public:
  States& add(std::int64_t stamp_ns, std::int64_t log_ns, const std::vector<std::string>& names, const test::Reals& q,
              const test::Reals& effort = {}) {
    bag_.message(id_, begin_ns + log_ns, test::joint_state(stamp_ns, names, q, {}, effort));
    return *this;
  }
  JointTopic read() {
    JointRecording all = read_joint_recording(test::write("states.mcap", bag_.bytes()));
    return std::move(all.topics.at(0));
  }

 private:
  test::SmallBag bag_;
  std::uint16_t id_ = bag_.channel("/joint_states", "sensor_msgs/msg/JointState");
};

using Column = std::vector<double>;

TEST(JointRecording, PublishersOfOtherJointsAreMergedByNameAtTheStampsOfTheFastest) {
  States states;
  for (int k = 0; k <= 8; ++k) {
    const std::int64_t at = k * 2 * ms;
    states.add(begin_ns + at, at, {"a"}, {1.0 * k});
    if (k % 2 == 1) states.add(begin_ns + at, at, {"g", "b"}, {7, 10.0 * k});  // starts later, ends earlier
  }
  JointTopic topic = states.read();
  ASSERT_EQ(topic.streams.size(), 2U);
  const JointTable table = take_table(topic, {"a.position", "b.position"}, "states.mcap");
  EXPECT_EQ(table.columns[1], (Column{1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(table.columns[2], (Column{10, 20, 30, 40, 50, 60, 70}));
  EXPECT_NEAR(table.columns[0][0], 0.002, 1e-15);  // since the topic's first message
  EXPECT_NE(table.note.find("'g', 'b' of other publishers"), std::string::npos) << table.note;
}

TEST(JointRecording, AJointOfTwoPublishersIsTakenFromTheOneThatHasMore) {
  States states;
  for (int k = 0; k < 4; ++k) {
    states.add(begin_ns + k * ms, k * ms, {"a"}, {-1});
    states.add(begin_ns + k * ms, k * ms, {"a", "b"}, {1.0 * k, 2});
  }
  JointTopic topic = states.read();
  const JointTable table = take_table(topic, {"a.position", "b.position"}, "states.mcap");
  EXPECT_EQ(table.columns[1], (Column{0, 1, 2, 3}));
  EXPECT_EQ(table.note, "");
}

TEST(JointRecording, RowsAreSortedAndAMessageThatCameTwiceCountsOnce) {
  States states;
  for (const int k : {0, 2, 1, 1, 3}) states.add(begin_ns + k * ms, k * ms, {"a"}, {1.0 * k});
  JointTopic topic = states.read();
  EXPECT_EQ(take_table(topic, {"a.position"}, "states.mcap").columns[1], (Column{0, 1, 2, 3}));
  topic = States().add(begin_ns, 0, {"a"}, {1}).add(begin_ns, 0, {"a"}, {2}).read();
  test::expect_refused("states.mcap", {"'a'", "two publishers"},
                       [&] { take_table(topic, {"a.position"}, "states.mcap"); });
}

TEST(JointRecording, WithoutAStampTheRecordersTimeCounts) {
  JointTopic topic = States().add(0, 0, {"a"}, {1}).add(0, 5 * ms, {"a"}, {2}).read();
  ASSERT_EQ(topic.trouble, "");
  EXPECT_NEAR(take_table(topic, {"a.position"}, "x").columns[0][1], 0.005, 1e-15);
}

TEST(JointRecording, MixedClocksAreSaid) {
  EXPECT_NE(States().add(begin_ns, 0, {"a"}, {1}).add(0, ms, {"a"}, {1}).read().trouble.find("no stamp"),
            std::string::npos);
  // the simulator's time, and then the wall's
  EXPECT_NE(States().add(12'000 * ms, 0, {"a"}, {1}).add(begin_ns, ms, {"a"}, {1}).read().trouble.find("mixed clocks"),
            std::string::npos);
  // a simulator at half the speed is one clock
  EXPECT_EQ(States().add(0 + ms, 0, {"a"}, {1}).add(3000 * ms, 6000 * ms, {"a"}, {1}).read().trouble, "");
  JointTopic topic = States().add(0, 0, {"a"}, {1}).add(begin_ns, 0, {"b"}, {1}).read();
  test::expect_refused("x.mcap", {"mixed clocks", "'a'", "'b'"}, [&] {
    take_table(topic, {"a.position", "b.position"}, "x.mcap");
  });
}

TEST(JointRecording, APublisherThatPausesIsNotInterpolated) {
  States states;
  for (int k = 0; k < 100; ++k) {
    states.add(begin_ns + k * ms, k * ms, {"a"}, {1});
    if (k < 30 || k > 60) states.add(begin_ns + k * ms, k * ms, {"b"}, {1});
  }
  JointTopic topic = states.read();
  test::expect_refused("x.mcap", {"'b' pauses for 0.032 s"}, [&] {
    take_table(topic, {"a.position", "b.position"}, "x.mcap");
  });
}

TEST(JointRecording, AColumnWithoutAnyNumberIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const JointTopic topic = States()
                               .add(begin_ns, 0, {"a", "b"}, {1, 2}, {nan, 3})
                               .add(begin_ns + ms, ms, {"a", "b"}, {1, 2}, {nan, nan})
                               .read();
  EXPECT_EQ(column_names(topic), (std::vector<std::string>{"t", "a.position", "b.position", "b.effort"}));
}

}  // namespace
}  // namespace fxdyn
