// Torque output, error log, dictionary: the parts of the drive node that stand alone.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <set>
#include <string>

#include "firmware/emergency.hpp"
#include "firmware/protocol/object_dictionary.hpp"
#include "firmware/protocol/torque_output.hpp"

namespace fxdyn {
namespace {

RC_GTEST_PROP(TorqueOutputProperty, NoStepIsLargerThanTold, ()) {
  const TorqueSteps steps{*rc::gen::inRange<std::int32_t>(1, INT32_MAX), *rc::gen::inRange<std::int32_t>(1, INT32_MAX)};
  TorqueOutput torque;
  const auto actions = *rc::gen::container<std::vector<std::pair<bool, std::int32_t>>>(
      rc::gen::pair(rc::gen::arbitrary<bool>(), rc::gen::arbitrary<std::int32_t>()));
  for (const auto& [follows, target] : actions) {
    const std::int64_t before = torque.value();
    const bool was_following = torque.is_following();
    const std::int64_t goal = follows ? target : 0;
    const bool cut = follows && torque.follow(target, steps);
    if (!follows) torque.release(steps);
    const std::int64_t step = std::abs(torque.value() - before), left = std::abs(goal - torque.value());
    RC_ASSERT(step <= steps.following);
    if (!(follows && was_following)) RC_ASSERT(step <= steps.ramp);
    RC_ASSERT(step + left == std::abs(goal - before));  // straight towards the goal
    if (torque.is_following()) RC_ASSERT(left == 0 || cut);
  }
}

TEST(TorqueOutput, RampsToZeroAndBack) {
  const TorqueSteps steps{10, 100};
  TorqueOutput torque;
  EXPECT_FALSE(torque.follow(25, steps));
  EXPECT_EQ(torque.value(), 10);
  EXPECT_FALSE(torque.is_following());
  torque.follow(25, steps);
  torque.follow(25, steps);
  EXPECT_EQ(torque.value(), 25);
  EXPECT_TRUE(torque.is_following());
  EXPECT_FALSE(torque.follow(-75, steps));  // 100: as far as it may
  EXPECT_EQ(torque.value(), -75);
  EXPECT_TRUE(torque.follow(26, steps));
  EXPECT_EQ(torque.value(), 25);
  EXPECT_TRUE(torque.is_following());
  for (const std::int32_t expected : {15, 5, 0, 0}) {
    torque.release(steps);
    EXPECT_EQ(torque.value(), expected);
    EXPECT_FALSE(torque.is_following());
  }
}

TEST(ErrorLog, TellsAnErrorOnceAndThatItIsGone) {
  ErrorLog log;
  ErrorLog::Message message;
  EXPECT_FALSE(log.next(message));
  log.raise(Error::setpoints_stale, 3, 0);
  log.raise(Error::setpoints_stale, 3, 10);
  log.raise(Error::tables, 0, 10);
  EXPECT_EQ(log.error_register(), 0x11);
  ASSERT_TRUE(log.next(message));
  EXPECT_EQ(message.code, 0x6320);
  ASSERT_TRUE(log.next(message));
  EXPECT_EQ(message.code, 0x8250);
  EXPECT_EQ(message.detail, 3);
  EXPECT_FALSE(log.next(message));
  log.clear(Error::setpoints_stale);
  EXPECT_FALSE(log.next(message));
  EXPECT_EQ(log.error_register(), 0x01);
  log.clear(Error::tables);
  ASSERT_TRUE(log.next(message));
  EXPECT_EQ(message.code, 0);
  EXPECT_FALSE(log.next(message));
}

// 100 ms after it last happened (decision 6).
TEST(ErrorLog, EventsEndByThemselves) {
  constexpr std::uint32_t event_us = 100'000;
  ErrorLog log;
  const std::uint32_t start = 0xFFFF'FF00;  // the clock wraps on the way
  log.raise(Error::overrun, 0, start);
  log.serve(start + event_us - 1);
  EXPECT_TRUE(log.any());
  log.raise(Error::overrun, 0, start + 50'000);
  log.serve(start + event_us);
  EXPECT_TRUE(log.any());
  log.serve(start + 50'000 + event_us);
  EXPECT_FALSE(log.any());
  log.raise(Error::tables, 0, start);
  log.serve(start + 10 * event_us);
  EXPECT_TRUE(log.any());
}

TEST(ErrorLog, HistoryHoldsTheLatestFirst) {
  ErrorLog log;
  for (std::uint32_t i = 0; i < 12; ++i) {
    log.raise(Error::pdo_length, static_cast<std::uint16_t>(i), 0);
    log.clear(Error::pdo_length);
  }
  ASSERT_EQ(log.history_count(), ErrorLog::history_size);
  EXPECT_EQ(log.history(0), 0x000B'8210U);
  EXPECT_EQ(log.history(7), 0x0004'8210U);
  log.clear_history();
  EXPECT_EQ(log.history_count(), 0);
}

constexpr dictionary::Extent six{6, 0x3F}, third_of_six{6, 0x04};

TEST(Dictionary, EveryPlaceIsFoundOnce) {
  for (const auto& extent : {six, third_of_six}) {
    std::set<std::pair<int, int>> places;
    for (const dictionary::Described& described : dictionary::described) {
      const dictionary::Entry& entry = described.entry;
      for (std::size_t offset = 0; offset < extent.joints; ++offset) {
        if (!extent.stands_at(entry, offset)) continue;
        const std::size_t count = entry.array == 0 ? 1 : extent.length(entry);
        for (std::size_t i = 0; i < count; ++i) {
          const auto index = static_cast<std::uint16_t>(entry.index + offset);
          const auto sub = static_cast<std::uint8_t>(entry.sub_index + i);
          EXPECT_TRUE(places.emplace(index, sub).second) << std::hex << index << ":" << int{sub} << " stands twice";
          dictionary::Object object;
          ASSERT_EQ(dictionary::find(extent, index, sub, object), canopen::Abort::none);
          EXPECT_EQ(object.entry->variable, entry.variable) << std::hex << index << ":" << int{sub};
          const std::size_t item = entry.times != dictionary::Times::one ? offset : (sub == 0 ? 0U : sub - 1U);
          EXPECT_EQ(object.item, item);
        }
      }
    }
  }
}

TEST(Dictionary, NothingElseIsFound) {
  for (const auto& extent : {six, third_of_six}) {
    std::size_t found = 0, expected = 0;
    std::set<int> with_sub_indices;
    for (const dictionary::Entry& entry : dictionary::entries) {
      for (std::size_t offset = 0; offset < extent.joints; ++offset) {
        if (!extent.stands_at(entry, offset)) continue;
        expected += entry.array == 0 ? 1 : extent.length(entry);
        if (entry.sub_index > 0 && entry.index != 0x1003)
          with_sub_indices.insert(static_cast<int>(entry.index + offset));
      }
    }
    for (int index = 0; index <= 0xFFFF; ++index) {
      for (int sub = 0; sub <= 0xFF; ++sub) {
        dictionary::Object object;
        const auto abort =
            dictionary::find(extent, static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), object);
        if (abort == canopen::Abort::none) ++found;
        if (abort == canopen::Abort::no_object) {
          EXPECT_EQ(sub, 0);
          break;
        }
      }
    }
    EXPECT_EQ(found, expected + with_sub_indices.size());  // and sub-index 0 of each record and array
  }
}

TEST(Dictionary, AbortCodes) {
  dictionary::Object object;
  EXPECT_EQ(dictionary::find(six, 0x5000, 0, object), canopen::Abort::no_object);
  EXPECT_EQ(dictionary::find(six, 0x1018, 5, object), canopen::Abort::no_sub_index);
  EXPECT_EQ(dictionary::find(six, 0x1406, 1, object), canopen::Abort::no_object);
  EXPECT_EQ(dictionary::find(third_of_six, 0x1801, 1, object), canopen::Abort::no_object);
  EXPECT_EQ(dictionary::find(third_of_six, 0x1802, 1, object), canopen::Abort::none);
  EXPECT_EQ(dictionary::find(six, 0x1018, 0, object), canopen::Abort::none);
  EXPECT_EQ(object.highest_sub_index, 4);
  EXPECT_FALSE(object.writable());
}

// A PDO's mapped objects exist, may be mapped and fill its 8 bytes.
TEST(Dictionary, MappingsAreComplete) {
  for (const bool torque : {false, true}) {
    std::uint32_t bits = 0;
    for (std::size_t place = 1; place <= (torque ? 4U : 3U); ++place) {
      const std::uint32_t mapping = dictionary::mapping(torque, place, 4);
      dictionary::Object object;
      ASSERT_EQ(dictionary::find(six, static_cast<std::uint16_t>(mapping >> 16),
                                 static_cast<std::uint8_t>(mapping >> 8), object),
                canopen::Abort::none);
      EXPECT_EQ(object.item, 4);
      EXPECT_EQ(8 * object.size(), mapping & 0xFF);
      bits += mapping & 0xFF;
      bool mappable = false;
      for (const auto& described : dictionary::described)
        mappable = mappable || (described.entry.variable == object.entry->variable && described.mappable);
      EXPECT_TRUE(mappable);
    }
    EXPECT_EQ(bits, 64U);
  }
}

// What a tool may put into a PDO is what the node's PDOs hold: setpoints and torques, nothing else.
TEST(Dictionary, OnlyWhatTravelsInPdosIsMappable) {
  for (const auto& described : dictionary::described) {
    bool travels = false;
    for (const bool torque : {false, true}) {
      for (std::size_t place = 1; place <= (torque ? 4U : 3U); ++place)
        travels = travels || described.entry.index == dictionary::mapping(torque, place, 4) >> 16;
    }
    EXPECT_TRUE(travels || !described.mappable) << std::hex << described.entry.index;
  }
}

}  // namespace
}  // namespace fxdyn
