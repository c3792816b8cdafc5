#pragma once

#include <concepts>

#include "hal/status.hpp"

namespace fxdyn::hal {

/// A digital output; `true` is the asserted level, whatever its polarity.
template <class T>
concept OutputPin = requires(T& pin, bool on) {
  { pin.set(on) } -> std::same_as<Status>;
};

/// A digital input; `on` keeps its value where the read fails.
template <class T>
concept InputPin = requires(T& pin, bool& on) {
  { pin.read(on) } -> std::same_as<Status>;
};

}  // namespace fxdyn::hal
