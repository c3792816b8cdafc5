// Kernel filters out of ranges of identifiers.

#include <gtest/gtest.h>

#include "hal/linux/socket_can.hpp"

namespace fxdyn::hal::linux {
namespace {

/// linux/can.h: a filter matches where received id & mask == filter id & mask.
bool passes(const std::vector<can_filter>& filters, canid_t id) {
  return std::any_of(filters.begin(), filters.end(), [&](const can_filter& filter) {
    return (id & filter.can_mask) == (filter.can_id & filter.can_mask);
  });
}

TEST(CanFilters, PassTheRangeAndNothingElse) {
  for (const IdRange range :
       {IdRange{0, 0}, {0, 0x7ff}, {0x201, 0x206}, {0x701, 0x77f}, {0x1ff, 0x200}, {0x7ff, 0x7ff}, {1, 0x7fe}}) {
    const std::vector<can_filter> filters = filters_of(range);
    EXPECT_LE(filters.size(), 20U);
    for (canid_t id = 0; id <= CAN_SFF_MASK; ++id) {
      const bool in = id >= range.first && id <= range.last;
      EXPECT_EQ(passes(filters, id), in) << id;
      EXPECT_EQ(passes(filters, id | CAN_RTR_FLAG), in) << "remote frames have identifiers too";
      EXPECT_FALSE(passes(filters, id | CAN_EFF_FLAG));
    }
  }
}

}  // namespace
}  // namespace fxdyn::hal::linux
