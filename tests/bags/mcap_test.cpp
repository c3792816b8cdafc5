#include <gtest/gtest.h>

#include <random>

#include "host_tools/bags/joint_recording.hpp"
#include "tests/bags/small_bag.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000;

/// Five messages of two joints, 2 ms apart, and images beside them.
test::SmallBag small_bag() {
  test::SmallBag out;
  const auto states = out.channel("/joint_states", "sensor_msgs/msg/JointState");
  const auto camera = out.channel("/camera", "sensor_msgs/msg/Image");
  for (int k = 0; k < 5; ++k) {
    const std::int64_t ns = begin_ns + k * 2'000'000;
    out.message(states, ns + 100, test::joint_state(ns, {"a", "b"}, {k + 0.5, -1.0 * k}, {}, {2.0, 3.0 * k}));
    if (k == 2)
      for (int i = 0; i < 4; ++i) out.message(camera, ns, std::string(1000, 'x'));
  }
  return out;
}

JointTopic read_topic(const std::filesystem::path& file) {
  JointRecording all = read_joint_recording(file);
  EXPECT_EQ(all.topics.size(), 1U);
  return std::move(all.topics.at(0));
}

TEST(Mcap, JointsAreReadAndOtherTopicsAreNamed) {
  const auto file = test::write("small.mcap", small_bag().bytes());
  JointRecording all = read_joint_recording(file);
  ASSERT_EQ(all.topics.size(), 1U);
  EXPECT_EQ(all.topics[0].trouble, "");
  EXPECT_EQ(all.topics[0].messages, 5U);
  ASSERT_EQ(all.others.size(), 1U);
  EXPECT_EQ(all.others[0].name, "/camera");
  EXPECT_EQ(all.note, "");
  EXPECT_EQ(column_names(all.topics[0]),
            (std::vector<std::string>{"t", "a.position", "b.position", "a.effort", "b.effort"}));
  const JointTable table = take_table(all.topics[0], {"b.effort", "a.position"}, "small.mcap");
  EXPECT_EQ(table.columns[1], (std::vector<double>{0, 3, 6, 9, 12}));
  EXPECT_EQ(table.columns[2], (std::vector<double>{0.5, 1.5, 2.5, 3.5, 4.5}));
  EXPECT_EQ(table.columns[0][0], 0);
  EXPECT_NEAR(table.columns[0][4], 0.008, 1e-15);
}

TEST(Mcap, ARecordingThatWasNotClosedIsReadToItsLastWholeRecord) {
  const std::string whole = small_bag().bytes();
  std::size_t before = 0;
  for (std::size_t size = 9; size < whole.size() - 1; size += 7) {
    const auto file = test::write("cut.mcap", whole.substr(0, size));
    const JointRecording all = read_joint_recording(file);
    const std::size_t messages = all.topics.empty() ? 0 : all.topics[0].messages;
    EXPECT_GE(messages, before);
    before = messages;
    const bool has_end = whole.substr(0, size).find("\x0F\4\0\0\0\0\0\0\0", 0, 9) != std::string::npos;
    EXPECT_EQ(all.note.empty(), has_end) << size;
  }
  EXPECT_EQ(before, 5U);
}

TEST(Mcap, DamageIsRefused) {
  const std::string whole = small_bag().bytes();
  const auto refused = [&](const std::string& bytes, const std::vector<std::string>& parts) {
    const auto file = test::write("damaged.mcap", bytes);
    test::expect_refused(file, parts, [&] { read_joint_recording(file); });
  };
  std::string bytes = whole;
  bytes[bytes.find("world") - 20] ^= 1;  // inside of a chunk
  refused(bytes, {"checksum", "mcap recover"});
  test::SmallBag other = small_bag();
  other.name_compression("brotli");
  refused(other.bytes(), {"'brotli'", "zstd, lz4 and none"});
  other = small_bag();
  other.name_compression("zstd");
  refused(other.bytes(), {"zstd can't unpack"});
  other.name_compression("lz4");
  other = small_bag();
  other.claim_more(1, 3);
  refused(other.bytes(), {"5 messages of /joint_states where its statistics say 8"});
  refused("\x89MCAP1\r\n", {"another version"});
  refused("", {"is empty"});
  refused("t,q1\n0,1\n", {"neither MCAP nor a database"});
}

// Damage in a chunk shows whether anybody has looked into it.
TEST(Mcap, ChunksWithoutJointsAreSkippedUnreadWhereTheIndexSaysSo) {
  const std::string whole = small_bag().bytes(), image(1000, 'x');
  const std::size_t beside_joints = whole.find(image), alone = whole.find(image, beside_joints + image.size());
  const auto damaged_at = [&](std::size_t at, std::size_t size) {
    std::string bytes = whole.substr(0, size);
    bytes[at] = 'y';
    return test::write("image.mcap", bytes);
  };
  EXPECT_EQ(read_topic(damaged_at(alone, whole.size())).messages, 5U);
  const auto both = damaged_at(beside_joints, whole.size());
  test::expect_refused(both, {"checksum"}, [&] { read_joint_recording(both); });
  const auto without_index = damaged_at(alone, whole.size() - 1);
  test::expect_refused(without_index, {"checksum"}, [&] { read_joint_recording(without_index); });
}

TEST(Mcap, OtherSchemasAndEncodingsAreTheTopicsTrouble) {
  const auto trouble = [](const std::string& definition, const std::string& encoding) {
    test::SmallBag bag;
    const auto id = bag.channel("/joint_states", "sensor_msgs/msg/JointState", definition, encoding);
    bag.message(id, begin_ns, test::joint_state(begin_ns, {"a"}, {1}, {}, {}));
    return read_topic(test::write("schema.mcap", bag.bytes())).trouble;
  };
  EXPECT_EQ(trouble("std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
                    "cdr"),
            "");
  EXPECT_NE(trouble("std_msgs/Header header\nfloat64 position\n", "cdr").find("'float64 position'"), std::string::npos);
  EXPECT_NE(trouble("", "ros1").find("'ros1'"), std::string::npos);
}

TEST(Mcap, MessagesThatCannotBeReadAreCounted) {
  test::SmallBag bag;
  const auto id = bag.channel("/joint_states", "sensor_msgs/msg/JointState");
  const std::string good = test::joint_state(begin_ns, {"a", "b"}, {1, 2}, {}, {});
  bag.message(id, begin_ns, good);
  bag.message(id, begin_ns, good.substr(0, good.size() - 9));
  EXPECT_NE(read_topic(test::write("short.mcap", bag.bytes())).trouble.find("message 2 has"), std::string::npos);
  test::SmallBag sizes;
  const auto of = sizes.channel("/joint_states", "sensor_msgs/msg/JointState");
  sizes.message(of, begin_ns, test::joint_state(begin_ns, {"a", "b"}, {1, 2, 3}, {}, {}));
  EXPECT_NE(read_topic(test::write("sizes.mcap", sizes.bytes())).trouble.find("2 names and 3 values of position"),
            std::string::npos);
}

TEST(Mcap, FlippedBytesAreReadOrRefusedButNeverWorse) {
  const std::string whole = small_bag().bytes();
  std::mt19937 random(1);
  int refused = 0;
  for (int k = 0; k < 3000; ++k) {
    std::string bytes = whole;
    for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    const auto file = test::write("flipped.mcap", bytes);
    try {
      JointRecording all = read_joint_recording(file);
      for (JointTopic& topic : all.topics) take_table(topic, {"a.position", "b.effort"}, "flipped");
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace fxdyn
