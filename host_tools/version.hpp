#pragma once

namespace fxdyn {
inline constexpr const char* version = "0.1.0";
}
