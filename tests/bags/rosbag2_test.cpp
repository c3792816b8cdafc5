#include <gtest/gtest.h>
#include <sqlite3.h>

#include <random>
#include <sstream>

#include "host_tools/bags/joint_recording.hpp"
#include "tests/bags/small_bag.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000;

/// A bag of 200 messages by SQLite itself.
std::string small_database() {
  const auto file = test::folder() / "made.db3";
  std::filesystem::remove(file);
  sqlite3* base = nullptr;
  EXPECT_EQ(::sqlite3_open(file.c_str(), &base), SQLITE_OK);
  const char* tables =
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, qos TEXT);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
      "INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', '');"
      "INSERT INTO topics VALUES(2, '/tf', 'tf2_msgs/msg/TFMessage', 'cdr', ''); BEGIN";
  EXPECT_EQ(::sqlite3_exec(base, tables, nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_stmt* insert = nullptr;
  EXPECT_EQ(::sqlite3_prepare_v2(base, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert,
                                 nullptr),
            SQLITE_OK);
  for (int k = 0; k < 200; ++k) {
    const std::int64_t ns = begin_ns + k * 2'000'000;
    const std::string data = test::joint_state(ns, {"a", "b"}, {1.0 * k, 2}, {3, 4}, {5, -0.5 * k});
    ::sqlite3_bind_int(insert, 1, 1 + k % 2);
    ::sqlite3_bind_int64(insert, 2, ns);
    ::sqlite3_bind_blob(insert, 3, data.data(), static_cast<int>(data.size()), SQLITE_TRANSIENT);
    EXPECT_EQ(::sqlite3_step(insert), SQLITE_DONE);
    ::sqlite3_reset(insert);
  }
  ::sqlite3_finalize(insert);
  EXPECT_EQ(::sqlite3_exec(base, "COMMIT", nullptr, nullptr, nullptr), SQLITE_OK);
  ::sqlite3_close(base);
  std::ostringstream out;
  out << std::ifstream(file, std::ios::binary).rdbuf();
  return out.str();
}

TEST(Rosbag2, OnlyTheMessagesOfTheTopicAreRead) {
  JointRecording all = read_joint_recording(test::write("small.db3", small_database()));
  ASSERT_EQ(all.topics.size(), 1U);
  EXPECT_EQ(all.topics[0].messages, 100U);
  ASSERT_EQ(all.others.size(), 1U);
  EXPECT_EQ(all.others[0].name, "/tf");
  const JointTable table = take_table(all.topics[0], {"a.position", "b.effort"}, "small.db3");
  EXPECT_EQ(table.columns[1][99], 198);
  EXPECT_EQ(table.columns[2][99], -99);
}

TEST(Rosbag2, WhatIsCutOrNoBagIsRefused) {
  const std::string whole = small_database();
  const auto cut = test::write("cut.db3", whole.substr(0, whole.size() / 2));
  test::expect_refused(cut, {"cut or damaged", ".recover"}, [&] { read_joint_recording(cut); });
  const auto file = test::folder() / "other.db3";
  sqlite3* base = nullptr;
  ::sqlite3_open(file.c_str(), &base);
  ::sqlite3_exec(base, "CREATE TABLE rows(t REAL)", nullptr, nullptr, nullptr);
  ::sqlite3_close(base);
  test::expect_refused(file, {"without the tables of a ROS 2 bag"}, [&] { read_joint_recording(file); });
}

TEST(Rosbag2, FlippedBytesAreReadOrRefusedButNeverWorse) {
  const std::string whole = small_database();
  std::mt19937 random(1);
  int refused = 0;
  for (int k = 0; k < 1000; ++k) {
    std::string bytes = whole;
    for (int flips = 1 + static_cast<int>(random() % 8); flips > 0; --flips)
      bytes[16 + random() % (bytes.size() - 16)] = static_cast<char>(random());
    const auto file = test::write("flipped.db3", bytes);
    try {
      JointRecording all = read_joint_recording(file);
      for (JointTopic& topic : all.topics) take_table(topic, {"a.position", "b.effort"}, "flipped");
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

}  // namespace
}  // namespace fxdyn
