#pragma once

#include <algorithm>

namespace fxdyn::test {

/// Sanitizers make code ten times slower, and what many seeds show is not theirs to find.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

}  // namespace fxdyn::test
