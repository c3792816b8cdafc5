#pragma once

#include <concepts>

#include "hal/status.hpp"

namespace fxdyn::hal {

/// What an output shows before its first set().
enum class AtStart : bool { off, on };

/// A digital output; `true` is the asserted level, whatever its polarity. Boards make a fault output active low and
/// assert it before anything can fail: a controller that is dead, unpowered or in reset lets go of the pin, and a
/// pull-down at the reader then says "fault", as it must.
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
