#pragma once

#include "hal/gpio.hpp"

namespace fxdyn::hal::fake {

struct InputPin {
  bool level = false;
  bool broken = false;  ///< can't be read
  Status read(bool& on) const {
    if (broken) return Status::failed;
    on = level;
    return Status::ok;
  }
};
static_assert(hal::InputPin<InputPin>);

struct OutputPin {
  bool level = false;
  bool broken = false;  ///< can't be set
  int rises = 0;
  Status set(bool on) {
    if (broken) return Status::failed;
    rises += on && !level ? 1 : 0;
    level = on;
    return Status::ok;
  }
};
static_assert(hal::OutputPin<OutputPin>);

}  // namespace fxdyn::hal::fake
