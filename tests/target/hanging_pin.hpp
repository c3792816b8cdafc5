#pragma once

#include "hal/gpio.hpp"

namespace {

/// In place of the tick-busy output: the fifth tick after start-up never ends.
struct TickBusy {
  unsigned ticks = 0;
  fxdyn::hal::Status set(bool on) {
    if (on && ++ticks == 5) {
      for (;;) asm volatile("");
    }
    return fxdyn::hal::Status::ok;
  }
};

}  // namespace
