#pragma once

#include <cstdint>

namespace fxdyn::hal {

/// What came of an operation that can fail. There are no exceptions on the target.
enum class [[nodiscard]] Status : std::uint8_t{
    ok,
    busy,  ///< nothing wrong, try again later
    failed,
};

}  // namespace fxdyn::hal
