#pragma once

#include <string>
#include <string_view>

#include "host_tools/support/error.hpp"

namespace fxdyn {

/// Name of the user's effects that this program was built with (host_tools/effects/add_effects.cmake); empty: none.
std::string_view effect_library();

/// A project that needs the effects of another program, fxdyn-<library>. The message is for where that can't be
/// started.
struct OtherEffectLibrary : InputError {
  OtherEffectLibrary(const std::string& message, std::string name) : InputError(message), library(std::move(name)) {}
  std::string library;
};

}  // namespace fxdyn
