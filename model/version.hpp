#pragma once

#include <cstdint>

namespace fxdyn {
inline constexpr const char* version = "0.1.0";
/// The same as the revision number of a CANopen identity: major in the upper, minor in the lower half.
inline constexpr std::uint32_t version_number = 0x0000'0001;
}  // namespace fxdyn
