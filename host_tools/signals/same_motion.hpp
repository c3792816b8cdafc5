#pragma once

#include <cstdint>
#include <vector>

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// What the rows of a log hold beside their time stamps, as sorted numbers without doubles. Rows in which nothing moves
/// are left out: two logs may rest alike.
std::vector<std::uint64_t> row_prints(const Log& log);

/// How many of the rows are in both.
std::size_t rows_in_common(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b);

}  // namespace fxdyn
