#pragma once

#include <Eigen/Dense>
#include <vector>

namespace fxdyn {

/// Into so many blocks, which judge one another, a single log is cut.
inline constexpr int blocks_of_one_log = 5;

/// Rows [first, first + count).
struct RowRange {
  Eigen::Index first = 0, count = 0;
};

/// The range as `parts` successive ones whose lengths differ by one row at most.
inline std::vector<RowRange> cut(const RowRange& range, int parts) {
  std::vector<RowRange> out;
  for (int part = 0; part < parts; ++part) {
    const Eigen::Index from = range.count * part / parts, to = range.count * (part + 1) / parts;
    out.push_back({range.first + from, to - from});
  }
  return out;
}

}  // namespace fxdyn
